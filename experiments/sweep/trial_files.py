"""The data set of a sweep: where its files are, and their columns. Nothing in here needs Drake.

A folder of results has trials/policy=<name, percent-encoded>/trial_set=<name>/engine=<name>/<block>.parquet, one row a
trial, and sweeps/<name>.yaml.
"""

from __future__ import annotations

from pathlib import Path
from urllib.parse import quote

import pyarrow as pa

from experiments.trial.trial_result import COUNTS, NUMBERS

TRIALS, SWEEPS, SETS, SKILLS = "trials", "sweeps", "demonstrations", "skills"
"""Folders within the results: rows, specifications, sets of demonstrations, and skills."""

PUBLISHED = "trials.parquet"
"""The name of the files of a published copy, one for each policy, set of trials and engine."""

PARTITIONS = ("policy", "trial_set", "engine")
"""Columns that the names of the folders hold, from the outermost on."""

MEASURED_NUMBERS = ("tilt_x_deg", "tilt_y_deg", *NUMBERS)

SCHEMA = pa.schema(
    [
        *(("key", pa.string()), ("trial", pa.int64()), ("factors", pa.string()), ("inserted", pa.bool_())),
        *(("outcome", pa.string()), ("fault", pa.string()), ("reason", pa.string()), ("trusted", pa.bool_())),
        *((name, pa.float64()) for name in MEASURED_NUMBERS),
        *((name, pa.int64()) for name in COUNTS),
        *(("skill", pa.string()), ("states", pa.int64())),
        *(("demonstration_set", pa.int64()), ("demonstrations", pa.int64())),
        *(("train_s", pa.float64()), ("query_ms", pa.float64()), ("cpu_s", pa.float64())),
        *((name, pa.float64()) for name in ("friction", "pivot_mm", "peg_radius_mm", "hole_radius_mm", "clearance")),
        *((name, pa.float64()) for name in ("force_limit_n", "time_limit_s")),
        *((name, pa.string()) for name in ("scenario", "versions", "code", "began")),
    ]
)
"""The columns of every file; docs/sweeps.md has their units and meanings. A published copy has no ``scenario``."""


def partition(results: Path, policy: str, trial_set: str, engine: str) -> Path:
    """Returns the folder of the trials of a policy, a set of trials and an engine."""
    return results / TRIALS / f"policy={quote(policy, safe='')}" / f"trial_set={trial_set}" / f"engine={engine}"
