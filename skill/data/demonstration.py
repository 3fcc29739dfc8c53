"""Demonstrations: columns, validation, reading and writing.

One row is one sample. Units are SI. Frames: **H** is the hole block, with its origin at the centre of the mouth and z
out of the hole; **P** is the peg, with its origin at the centre of its tip face.

==========  =====  =====================================================================
column      unit   meaning
==========  =====  =====================================================================
time        s      time since the start of the demonstration
x y z       m      position of the tip in H, p_HP
fx fy fz    N      contact force on the peg, expressed in P
mx my mz    N m    contact moment on the peg about the tip, expressed in P
ax ay az    1      unit axis of R_HP; (0, 0, 1) where the angle is zero
angle       rad    angle of R_HP about that axis, in [0, pi]
dangle      rad    angle of the rotation from the previous sample to this one
ux uy uz    m      action of the operator: translation of the probe since the previous sample, in P
rx ry rz    rad    action of the operator: rotation vector of the probe since the previous sample, in P
==========  =====  =====================================================================
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from skill.data.geometry import PegHoleGeometry
from skill.data.outcome import UNPHYSICAL, Outcome, parse_outcome
from skill.data.plausibility import check_demonstration
from skill.data.tables import read_table, validate_table, write_table

CHANNELS = (
    *("x", "y", "z", "fx", "fy", "fz", "mx", "my", "mz"),
    *("ax", "ay", "az", "angle", "dangle"),
)
"""The fourteen channels of the paper, in its order."""

ACTIONS = ("ux", "uy", "uz", "rx", "ry", "rz")
"""The columns of the operator's action: the motion of the probe since the previous sample."""

COLUMNS = ("time", *CHANNELS, *ACTIONS)

FORMAT_VERSION = 2
"""Version of the files that are written and read."""


@dataclass(frozen=True)
class Demonstration:
    """One demonstration, good or bad.

    Attributes:
        samples: DataFrame with exactly the columns ``COLUMNS``, float64, one row a sample, time increasing.
        good: whether the demonstration reached full depth gently enough to be imitated.
        outcome: how the demonstration ended; a string is parsed with `parse_outcome`.
        metadata: everything needed to repeat it (seed, resolved scenario, geometry, versions).
        detail: additional text to the outcome; the stored text itself for `Outcome.OTHER`.
        source: file that it was read from, for error messages; empty for a demonstration that was not read.

    Raises:
        ValueError: if ``good`` is neither true nor false, if the samples fail `validate_samples`, or if they are
            implausible (`check_demonstration`) though the outcome is not that the simulation diverged or failed.
    """

    samples: pd.DataFrame
    good: bool
    outcome: Outcome
    metadata: dict[str, Any] = field(default_factory=dict)
    detail: str = ""
    source: str = ""

    def __post_init__(self) -> None:
        if not isinstance(self.outcome, Outcome):  # a string, perhaps from another program
            outcome, detail = parse_outcome(self.outcome)
            object.__setattr__(self, "outcome", outcome)
            object.__setattr__(self, "detail", detail or self.detail)
        where = self.source or "demonstration"
        if not isinstance(self.good, bool | np.bool_):
            raise ValueError(f"{where}: 'good' is {self.good!r:.60}, expected true or false")
        object.__setattr__(self, "good", bool(self.good))
        validate_samples(self.samples, where)
        if self.outcome not in UNPHYSICAL:
            inserted = self.outcome in (Outcome.INSERTED, Outcome.INSERTED_ROUGHLY)
            check_demonstration(self.samples, PegHoleGeometry.find(self.metadata, where), where, inserted=inserted)

    @property
    def reason(self) -> str:
        """Outcome and detail as one text."""
        return self.outcome.text(self.detail)

    @property
    def duration(self) -> float:
        """Time from the first sample to the last, s."""
        return float(self.samples["time"].iloc[-1] - self.samples["time"].iloc[0])


def validate_samples(samples: pd.DataFrame, where: str) -> None:
    """Checks the samples of a demonstration.

    Args:
        samples: table with the columns ``COLUMNS``, one row a sample.
        where: name of the source, for error messages.

    Raises:
        ValueError: if the table fails `validate_table` or an axis (ax, ay, az) has not unit length.
    """
    validate_table(samples, COLUMNS, where)
    length = np.linalg.norm(samples[["ax", "ay", "az"]].to_numpy(dtype=float), axis=1)
    off = np.abs(length - 1.0)
    if off.max() > 1e-6:
        row = int(off.argmax())
        raise ValueError(
            f"{where}: columns ax, ay, az have length {length[row]:.6g} in row {row}, expected a unit axis"
        )


def write_demonstration(demonstration: Demonstration, path: Path) -> None:
    """Writes a demonstration as one Parquet file, atomically.

    Raises:
        ValueError: if metadata have a name that the header of the file uses itself.
    """
    taken = sorted({"format_version", "good", "outcome"} & set(demonstration.metadata))
    if taken:
        raise ValueError(f"{path}: metadata named {taken} cannot be stored; rename them")
    header = {
        "good": demonstration.good,
        "outcome": demonstration.reason,
        **demonstration.metadata,
    }
    write_table(demonstration.samples, COLUMNS, path, kind="demonstration", version=FORMAT_VERSION, header=header)


def read_demonstration(path: Path) -> Demonstration:
    """Reads and validates one demonstration file.

    Raises:
        ValueError: if the file is missing, damaged, changed, implausible, or of another kind or version. The message
            names the file.
    """
    entries = {"good": bool, "outcome": str}
    samples, header = read_table(path, kind="demonstration", version=FORMAT_VERSION, entries=entries)
    good, text = header.pop("good"), header.pop("outcome")
    outcome, detail = parse_outcome(text)
    return Demonstration(samples=samples, good=good, outcome=outcome, metadata=header, detail=detail, source=str(path))


def read_demonstrations(folder: Path) -> list[Demonstration]:
    """Reads all demonstrations of a folder (``*.parquet``), in the order of their file names.

    Raises:
        ValueError: if there is no demonstration, or a file is not valid.
    """
    paths: Sequence[Path] = sorted(Path(folder).glob("*.parquet"))
    if not paths:
        raise ValueError(f"{folder}: no demonstrations (*.parquet) found; record some first")
    return [read_demonstration(path) for path in paths]
