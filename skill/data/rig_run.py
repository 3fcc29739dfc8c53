"""Records of rig runs: columns, reading and writing.

One row is one controller period. Units are SI. The wrench is the measured one on the peg about its tip, in P.

====================================  =====  ==================================================================
column                                unit   meaning
====================================  =====  ==================================================================
time                                  s      time since the start of the run
fx fy fz                              N      measured contact force on the peg
mx my mz                              N m    measured contact moment about the tip
depth                                 m      measured depth of the tip below the mouth
state                                 1      number of the estimated contact state
known                                 1      1 where the measurement lies within the gate of the state, else 0
target_pitch target_yaw               rad    commanded angles of the hole, relative to its start
target_clocking                       rad    likewise, about its axis; this axis is zero without a clocking stage
feed_speed                            m/s    commanded speed of the peg, negative into the hole
back_off                              1      1 while the controller backs the peg off, else 0
turning                               1      1 where the policy's turns are applied, -1 reversed, 0 not applied
support                               1      support of the action, in [0, 1]; 1 where it is sufficient
fault                                 1      number of the detected fault, 0 if none
pitch_taken yaw_taken clocking_taken  1      microsteps that each stepper has taken
pitch_lost yaw_lost clocking_lost     1      microsteps that each stepper has lost
tip_z                                 m      true height of the tip above the mouth (for replays only)
pitch yaw clocking                    rad    true angles of the hole (for replays only)
contact_mouth_x .._y .._z              m      true contact at the mouth: centre of its normal forces in W
contact_mouth_fx .._fy .._fz           N      sum of its normal forces on the peg in W, zero without contact
contact_tip_x ... contact_face_fz             the same of the contacts at the tip and on a flat face
====================================  =====  ==================================================================

The columns of the contacts are for replays and evaluation only. A place with two contacts, one on either side, holds
the stronger one.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Any

import pandas as pd

from skill.data.geometry import PegHoleGeometry
from skill.data.outcome import Outcome, parse_outcome
from skill.data.tables import read_table, validate_table, write_table

LOGGED_COLUMNS = (
    *("time", "fx", "fy", "fz", "mx", "my", "mz", "depth", "state", "known"),
    *("target_pitch", "target_yaw", "feed_speed", "back_off", "support", "fault"),
    *("pitch_taken", "pitch_lost", "yaw_taken", "yaw_lost"),
    *("tip_z", "pitch", "yaw"),
    "turning",
    *("target_clocking", "clocking_taken", "clocking_lost", "clocking"),
)
"""The columns that the rig logs; its trial adds those of the contacts."""


class ContactPlace(StrEnum):
    """Where peg and block touch; `systems.plant.contact_forces.single_contacts` defines the places."""

    MOUTH = "mouth"
    TIP = "tip"
    FACE = "face"


CONTACT_COLUMNS = tuple(
    f"contact_{place}_{name}" for place in ContactPlace for name in ("x", "y", "z", "fx", "fy", "fz")
)

RUN_COLUMNS = (*LOGGED_COLUMNS, *CONTACT_COLUMNS)

RUN_VERSION = 8
"""Version of the files that are written and read."""


@dataclass(frozen=True)
class RigRun:
    """One rig run.

    Attributes:
        samples: DataFrame with exactly the columns ``RUN_COLUMNS``, one row a controller period.
        result: result of the trial (inserted, reason, time_s, depth_mm, peak forces, ...).
        metadata: geometry, resolved scenario, skill, versions.
        source: file that it was read from, for error messages; empty for a run that was not read.

    Raises:
        ValueError: if the samples fail `validate_table`.
    """

    samples: pd.DataFrame
    result: dict[str, Any]
    metadata: dict[str, Any] = field(default_factory=dict)
    source: str = ""

    def __post_init__(self) -> None:
        validate_table(self.samples, RUN_COLUMNS, self.source or "rig run", min_rows=1)

    @property
    def outcome(self) -> Outcome:
        """How the trial ended."""
        return parse_outcome(self.result["reason"])[0]


def write_rig_run(run: RigRun, path: Path) -> None:
    """Writes a rig run as one Parquet file, atomically."""
    header = {"result": run.result, "metadata": run.metadata}
    write_table(run.samples, RUN_COLUMNS, path, kind="rig_run", version=RUN_VERSION, header=header)


def read_rig_run(path: Path) -> RigRun:
    """Reads and validates one rig run.

    Raises:
        ValueError: if the file is missing, damaged, changed, or of another kind or version. The message names the file.
    """
    samples, header = read_table(path, kind="rig_run", version=RUN_VERSION, entries={"result": dict, "metadata": dict})
    result, metadata = header["result"], header["metadata"]
    names = metadata.get("state_names", [])
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise ValueError(f"{path}: 'state_names' is {names!r:.60}, expected a list of texts")
    if not isinstance(result.get("reason"), str):
        raise ValueError(f"{path}: 'reason' of the result is {result.get('reason')!r:.60}, expected a text")
    PegHoleGeometry.find(metadata, str(path))
    return RigRun(samples=samples, result=result, metadata=metadata, source=str(path))
