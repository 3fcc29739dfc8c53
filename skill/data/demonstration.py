"""The fourteen channels of a demonstration: schema, validation, reading and writing.

One row is one sample. Units are SI; the frames are those of the design: **H** the hole block (origin at the
centre of the mouth, z out of the hole) and **P** the peg (origin at the centre of its tip face).

==========  =====  =====================================================================
column      unit   meaning
==========  =====  =====================================================================
time        s      since the start of the demonstration
x y z       m      position of the tip in H, p_HP
fx fy fz    N      contact force on the peg, expressed in P
mx my mz    N m    contact moment on the peg about the tip, expressed in P
ax ay az    1      unit axis of R_HP; (0, 0, 1) where the angle is zero
angle       rad    angle of R_HP about that axis, in [0, pi]
dangle      rad    angle of the rotation from the previous sample to this one
ux uy uz    m      the operator's action: translation of the probe over the sample, in P
rx ry rz    rad    the operator's action: rotation vector of the probe over the sample, in P
==========  =====  =====================================================================
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from skill.data.outcome import Outcome, parse_outcome
from skill.data.tables import read_table, validate_table, write_table

CHANNELS = (
    *("x", "y", "z", "fx", "fy", "fz", "mx", "my", "mz"),
    *("ax", "ay", "az", "angle", "dangle"),
)
"""The paper's fourteen channels, in its order."""

ACTIONS = ("ux", "uy", "uz", "rx", "ry", "rz")
"""The operator's action, over one sample."""

COLUMNS = ("time", *CHANNELS, *ACTIONS)

FORMAT_VERSION = 1


@dataclass(frozen=True)
class Demonstration:
    """One demonstration, good or bad.

    Attributes:
        samples: DataFrame with exactly the columns ``COLUMNS``, float64, one row a sample, time increasing.
        good: whether the demonstration reached full depth gently enough to be imitated.
        outcome: how it ended.
        metadata: everything needed to make it again (seed, resolved scenario, geometry, versions).
        detail: what the outcome alone does not say; the word itself of an outcome that is not ours.
    """

    samples: pd.DataFrame
    good: bool
    outcome: Outcome
    metadata: dict[str, Any] = field(default_factory=dict)
    detail: str = ""

    def __post_init__(self) -> None:
        validate_samples(self.samples, "demonstration")
        if not isinstance(self.outcome, Outcome):  # a plain string, perhaps a word of another program
            outcome, detail = parse_outcome(self.outcome)
            object.__setattr__(self, "outcome", outcome)
            object.__setattr__(self, "detail", detail or self.detail)

    @property
    def reason(self) -> str:
        """How it ended, for a person."""
        return self.outcome.text(self.detail)

    @property
    def duration(self) -> float:
        """Seconds from the first sample to the last."""
        return float(self.samples["time"].iloc[-1] - self.samples["time"].iloc[0])


def validate_samples(samples: pd.DataFrame, where: str) -> None:
    """Raises a ValueError that names ``where``, what was found and what was expected."""
    validate_table(samples, COLUMNS, where)
    length = np.linalg.norm(samples[["ax", "ay", "az"]].to_numpy(dtype=float), axis=1)
    off = np.abs(length - 1.0)
    if off.max() > 1e-6:
        row = int(off.argmax())
        raise ValueError(
            f"{where}: columns ax, ay, az have length {length[row]:.6g} in row {row}, expected a unit axis"
        )


def write_demonstration(demonstration: Demonstration, path: Path) -> None:
    """One Parquet file, written whole or not at all."""
    header = {
        "good": demonstration.good,
        "outcome": demonstration.reason,
        "duration_s": demonstration.duration,
        **demonstration.metadata,
    }
    write_table(demonstration.samples, COLUMNS, path, kind="demonstration", version=FORMAT_VERSION, header=header)


def read_demonstration(path: Path) -> Demonstration:
    """Reads and validates one file; every fault is a ValueError that names the file."""
    samples, header = read_table(path, COLUMNS, kind="demonstration", version=FORMAT_VERSION, keys=("good", "outcome"))
    validate_samples(samples, str(path))
    good = bool(header.pop("good"))
    outcome, detail = parse_outcome(str(header.pop("outcome")))
    header.pop("duration_s", None)
    return Demonstration(samples=samples, good=good, outcome=outcome, metadata=header, detail=detail)


def read_demonstrations(folder: Path) -> list[Demonstration]:
    """All demonstrations of a folder, in the order of their names."""
    paths: Sequence[Path] = sorted(Path(folder).glob("*.parquet"))
    if not paths:
        raise ValueError(f"{folder}: no demonstrations (*.parquet) found; record some first")
    return [read_demonstration(path) for path in paths]
