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

import json
import os
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

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
        outcome: in a word or two, what happened ("inserted", "jammed", ...).
        metadata: everything needed to make it again (seed, resolved scenario, versions).
    """

    samples: pd.DataFrame
    good: bool
    outcome: str
    metadata: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        validate_samples(self.samples, "demonstration")

    @property
    def duration(self) -> float:
        """Seconds from the first sample to the last."""
        return float(self.samples["time"].iloc[-1] - self.samples["time"].iloc[0])


def validate_samples(samples: pd.DataFrame, where: str) -> None:
    """Raises a ValueError that names ``where``, what was found and what was expected."""
    missing = [c for c in COLUMNS if c not in samples.columns]
    unknown = [c for c in samples.columns if c not in COLUMNS]
    if missing or unknown:
        raise ValueError(
            f"{where}: missing columns {missing}, unknown columns {unknown}; expected exactly {list(COLUMNS)}"
        )
    if len(samples) < 2:
        raise ValueError(f"{where}: found {len(samples)} samples, expected at least 2")
    for column in COLUMNS:
        if not pd.api.types.is_numeric_dtype(samples[column]):
            raise ValueError(f"{where}: column '{column}' has type {samples[column].dtype}, expected numbers")
        bad = np.flatnonzero(~np.isfinite(samples[column].to_numpy(dtype=float)))
        if bad.size:
            raise ValueError(
                f"{where}: column '{column}' is not finite in row {bad[0]}"
                f" ({bad.size} such rows); expected finite numbers"
            )
    steps = np.diff(samples["time"].to_numpy(dtype=float))
    if np.any(steps <= 0):
        raise ValueError(f"{where}: column 'time' does not increase after row {int(np.argmax(steps <= 0))}")
    axis = samples[["ax", "ay", "az"]].to_numpy(dtype=float)
    off = np.abs(np.linalg.norm(axis, axis=1) - 1.0)
    if off.max() > 1e-6:
        raise ValueError(
            f"{where}: columns ax, ay, az are not a unit axis in row {int(off.argmax())}"
            f" (length off by {off.max():.2g}); expected length 1"
        )


def write_atomically(path: Path, data: bytes) -> None:
    """Writes ``data`` under a temporary name in the same folder and renames it: whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.write(data)
            stream.flush()
            os.fsync(stream.fileno())
        Path(temporary).chmod(0o644)
        Path(temporary).replace(path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


def write_demonstration(demonstration: Demonstration, path: Path) -> None:
    """One Parquet file; the metadata travel in its footer, so that they cannot be parted."""
    header = {
        "format_version": FORMAT_VERSION,
        "good": demonstration.good,
        "outcome": demonstration.outcome,
        "duration_s": demonstration.duration,
        **demonstration.metadata,
    }
    table = pa.Table.from_pandas(demonstration.samples[list(COLUMNS)].astype(float), preserve_index=False)
    table = table.replace_schema_metadata(
        {**(table.schema.metadata or {}), b"demonstration": json.dumps(header).encode()}
    )
    sink = pa.BufferOutputStream()
    pq.write_table(table, sink)
    write_atomically(path, sink.getvalue().to_pybytes())


def read_demonstration(path: Path) -> Demonstration:
    """Reads and validates one file; every fault is a ValueError that names the file."""
    try:
        table = pq.read_table(path)
    except FileNotFoundError:
        raise ValueError(f"{path}: no such demonstration file") from None
    except (pa.ArrowInvalid, OSError) as error:
        raise ValueError(f"{path}: not a complete Parquet file ({error})") from error
    raw = (table.schema.metadata or {}).get(b"demonstration")
    if raw is None:
        raise ValueError(f"{path}: no 'demonstration' metadata; expected a file of this program")
    header = json.loads(raw)
    version = header.pop("format_version", None)
    if version != FORMAT_VERSION:
        raise ValueError(f"{path}: format version {version}, expected {FORMAT_VERSION}")
    samples = table.to_pandas()
    validate_samples(samples, str(path))
    good = bool(header.pop("good"))
    outcome = str(header.pop("outcome"))
    header.pop("duration_s", None)
    return Demonstration(samples=samples, good=good, outcome=outcome, metadata=header)


def read_demonstrations(folder: Path) -> list[Demonstration]:
    """All demonstrations of a folder, in the order of their names."""
    paths: Sequence[Path] = sorted(Path(folder).glob("*.parquet"))
    if not paths:
        raise ValueError(f"{folder}: no demonstrations (*.parquet) found; record some first")
    return [read_demonstration(path) for path in paths]
