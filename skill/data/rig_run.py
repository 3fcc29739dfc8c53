"""The record of one run of the rig: what it measured, commanded and did.

One row a controller period, SI units. The wrench is the measured one on the peg about its tip, in P.

====================================  =====  ==================================================================
column                                unit   meaning
====================================  =====  ==================================================================
time                                  s      since the start of the run
fx fy fz                              N      measured contact force on the peg
mx my mz                              N m    measured contact moment about the tip
depth                                 m      measured depth of the tip below the mouth
state                                 1      number of the estimated contact state
known                                 1      1 where the measurement is one that the state explains
target_pitch target_yaw               rad    commanded angles of the hole, from where it stood at the start
feed_speed                            m/s    commanded speed of the peg, negative into the hole
guard                                 1      1 while the force guard backs the peg off
support                               1      of the action by what the skill remembers, 1 where it is not lacking
fault                                 1      number of the fault that the rig has noticed, 0 if none
pitch_taken yaw_taken                 1      steps that each stepper has taken
pitch_lost yaw_lost                   1      steps that each stepper has lost
tip_z                                 m      true height of the tip above the mouth (for the eye only)
pitch yaw                             rad    true angles of the hole (for the eye only)
====================================  =====  ==================================================================
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pandas as pd

from skill.data.tables import read_table, validate_table, write_table

RUN_COLUMNS = (
    *("time", "fx", "fy", "fz", "mx", "my", "mz", "depth", "state", "known"),
    *("target_pitch", "target_yaw", "feed_speed", "guard", "support", "fault"),
    *("pitch_taken", "pitch_lost", "yaw_taken", "yaw_lost"),
    *("tip_z", "pitch", "yaw"),
)

RUN_VERSION = 2


@dataclass(frozen=True)
class RigRun:
    """One run.

    Attributes:
        samples: DataFrame with exactly the columns ``RUN_COLUMNS``, one row a controller period.
        result: the trial's row (inserted, reason, time_s, depth_mm, peak forces, ...).
        metadata: geometry, resolved scenario, skill, versions.
    """

    samples: pd.DataFrame
    result: dict[str, Any]
    metadata: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        validate_table(self.samples, RUN_COLUMNS, "rig run", least=1)


def write_rig_run(run: RigRun, path: Path) -> None:
    """One Parquet file, written whole or not at all."""
    header = {"result": run.result, "metadata": run.metadata}
    write_table(run.samples, RUN_COLUMNS, path, kind="rig_run", version=RUN_VERSION, header=header)


def read_rig_run(path: Path) -> RigRun:
    """Reads and validates one file; every fault is a ValueError that names the file."""
    samples, header = read_table(
        path, RUN_COLUMNS, kind="rig_run", version=RUN_VERSION, keys=("result", "metadata"), least=1
    )
    return RigRun(samples=samples, result=header["result"], metadata=header["metadata"])
