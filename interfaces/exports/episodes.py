"""Demonstrations and rig runs as episodes of a data set of LeRobot, with one frame a sample."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.exact_states import UNKNOWN, exact_labels
from models.contact_bodies import ContactLabel
from skill.arrays import Array
from skill.data.demonstration import ACTIONS, COLUMNS, Demonstration
from skill.data.geometry import PegHoleGeometry
from skill.data.outcome import Outcome
from skill.data.refinement import with_following_actions
from skill.data.rig_run import RUN_COLUMNS, ContactPlace, RigRun
from skill.features.measurement import observed_series
from skill.manipulation_skill import ManipulationSkill
from skill.states.estimate import estimates

DEMONSTRATIONS, RUNS = "demonstrations", "rig runs"
"""The kinds of data sets."""

ROBOTS = {DEMONSTRATIONS: "haptic device in a virtual environment", RUNS: "3-DOF rig"}
"""The type of the robot of each kind."""

MAX_RATE_ERROR = 1e-3
"""Largest relative difference of a sampling rate from a whole number of frames per second."""

WRENCH = ("fx", "fy", "fz", "mx", "my", "mz")
WRENCH_UNITS = ("N", "N", "N", "N m", "N m", "N m")

POSE = ("x", "y", "z", "rotation_x", "rotation_y", "rotation_z")
LENGTH_AND_ANGLE = ("m", "m", "m", "rad", "rad", "rad")

RIG_COMMANDS = ("target_pitch", "target_yaw", "target_clocking", "feed_speed")
RIG_STATE = ("depth", *RIG_COMMANDS)


@dataclass(frozen=True)
class Feature:
    """A feature of a data set.

    Attributes:
        dtype: of its numbers: "float32", "float64", "int64" or "bool".
        names: of its numbers; empty for a single number.
        units: of its numbers; empty if they have none.
        frame: coordinate frame in which they are expressed, or their meaning.
        labels: what the numbers from 0 on mean; empty for measured numbers.
    """

    dtype: str
    names: tuple[str, ...] = ()
    units: tuple[str, ...] = ()
    frame: str = ""
    labels: tuple[str, ...] = ()

    @property
    def width(self) -> int:
        """Count of its numbers in a frame."""
        return max(1, len(self.names))


@dataclass(frozen=True)
class Episode:
    """A recording as an episode of n frames.

    Attributes:
        name: of the file of the recording.
        outcome: how it ended.
        columns: the numbers of each feature, (n,) for a single number and (n, width) else.
        header: what the recording holds besides its samples, JSON-serialisable.
    """

    name: str
    outcome: str
    columns: Mapping[str, NDArray[Any]]
    header: Mapping[str, Any]

    def __len__(self) -> int:
        return len(next(iter(self.columns.values())))


def frame_rate(times: Array, where: str) -> int:
    """Returns the frames per second of two or more time stamps (n,), s.

    Raises:
        ValueError: if the rate is no whole number, as a data set of LeRobot has it.
    """
    rate = 1.0 / float(np.median(np.diff(times)))
    if round(rate) < 1 or abs(rate / round(rate) - 1.0) > MAX_RATE_ERROR:
        raise ValueError(f"{where}: sampled at {rate:.5g} Hz, expected a whole number of samples in a second")
    return round(rate)


def check_times(times: Array, fps: int, where: str) -> None:
    """Checks that sample k was taken at k / fps after the first one, within half a frame.

    Raises:
        ValueError: naming the sample, its time and the expected one.
    """
    expected = times[0] + np.arange(len(times)) / fps
    off = np.abs(times - expected) > 0.5 / fps
    if off.any():
        k = int(np.argmax(off))
        raise ValueError(
            f"{where}: sample {k} at {times[k]:.6g} s, expected {expected[k]:.6g} s at {fps} samples in a second;"
            " a data set of LeRobot has no gaps and a single rate"
        )


def demonstration_features(skill: ManipulationSkill | None) -> dict[str, Feature]:
    """Returns the features of demonstrations, with those that a skill adds."""
    features = _features(
        state=Feature("float32", POSE, LENGTH_AND_ANGLE, "tip and rotation vector of the peg P in H"),
        wrench="on the peg about its tip, in P",
        action=Feature("float32", ACTIONS, LENGTH_AND_ANGLE, "motion of the hand until the next frame, in P"),
        label="exact, of the true pose; -1: not known",
        recorded=COLUMNS,
    )
    if skill is not None:
        names = tuple(skill.state_names())
        features["contact_state"] = Feature("int64", frame="most probable state, causal", labels=names)
    return features


def demonstration_episode(demonstration: Demonstration, name: str, skill: ManipulationSkill | None = None) -> Episode:
    """Returns a demonstration as an episode.

    Args:
        demonstration: to convert.
        name: of its file.
        skill: estimates the contact states from the samples so far, as on the rig, but from the wrench of
            the recording, without the noise of a sensor; None for none.

    Raises:
        ValueError: if the skill is made for another peg or hole.
    """
    samples = demonstration.samples
    rotation = samples[["ax", "ay", "az"]].to_numpy() * samples[["angle"]].to_numpy()
    columns = _columns(
        samples,
        state=np.hstack([samples[["x", "y", "z"]].to_numpy(), rotation]),
        action=with_following_actions(samples)[list(ACTIONS)].to_numpy(),
        labels=demonstration_labels(demonstration),
        outcome=demonstration.outcome,
        success=demonstration.outcome in (Outcome.INSERTED, Outcome.INSERTED_ROUGHLY),
        recorded=COLUMNS,
    )
    if skill is not None:
        own = PegHoleGeometry.find(demonstration.metadata, name)
        learnt = PegHoleGeometry.find(skill.metadata_, "the skill")
        if own is not None and learnt is not None and own != learnt:
            raise ValueError(f"{name}: another peg or hole than that of the skill; expected a skill for this one")
        found = list(estimates(skill.estimator(), observed_series(samples)))
        columns["contact_state"] = np.array([estimate.state for estimate in found], dtype=np.int64)
    header = {"good": demonstration.good, "outcome": demonstration.reason, "metadata": demonstration.metadata}
    return Episode(name, str(demonstration.outcome), columns, header)


def run_features(run: RigRun) -> dict[str, Feature]:
    """Returns the features of runs with the columns and the state names of this one."""
    features = _features(
        state=Feature("float32", RIG_STATE, ("m", "rad", "rad", "rad", "m/s"), "measured depth and own commands"),
        wrench="measured, on the peg about its tip, in P",
        action=Feature("float32", RIG_COMMANDS, ("rad", "rad", "rad", "m/s"), "command until the next frame"),
        label="of the simulated contacts; -1: not known",
        recorded=RUN_COLUMNS,
    )
    names = tuple(str(name) for name in run.metadata.get("state_names") or ())
    features["contact_state"] = Feature("int64", frame="estimated on the rig", labels=names)
    return features


def run_episode(run: RigRun, name: str) -> Episode:
    """Returns a run as an episode; ``name`` is that of its file."""
    samples, outcome = run.samples, run.outcome
    commands = samples[list(RIG_COMMANDS)].to_numpy()
    columns = _columns(
        samples,
        state=samples[list(RIG_STATE)].to_numpy(),
        # A row holds the command of the period before it; nothing follows the last one, whose command stays.
        action=np.vstack([commands[1:], commands[-1:]]),
        labels=run_labels(samples, PegHoleGeometry.find(run.metadata, name)),
        outcome=outcome,
        success=outcome is Outcome.INSERTED,
        recorded=RUN_COLUMNS,
    )
    columns["contact_state"] = samples["state"].to_numpy(dtype=np.int64)
    return Episode(name, str(outcome), columns, {"result": run.result, "metadata": run.metadata})


def demonstration_labels(demonstration: Demonstration) -> NDArray[np.int64]:
    """Returns the labels (n,) of `exact_labels`; without a geometry they are `UNKNOWN`."""
    if demonstration.metadata.get("geometry") is None:
        return np.full(len(demonstration.samples), UNKNOWN, dtype=np.int64)
    return exact_labels(demonstration).astype(np.int64)


def run_labels(samples: pd.DataFrame, geometry: PegHoleGeometry | None) -> NDArray[np.int64]:
    """Returns the contact labels (n,) of the simulated contacts; `UNKNOWN` without a geometry.

    The labels are those of `models.contact_bodies.ContactLabel`, but they follow from the forces at mouth, tip and
    face, because the deflection of the mount is not recorded. A face in the lower half of the hole is the floor, and a
    contact at the mouth is on the chamfer until the tip has passed it. Contacts at mouth and tip are a two-point
    contact if their lateral forces oppose each other, and a line contact otherwise.
    """
    if geometry is None:
        return np.full(len(samples), UNKNOWN, dtype=np.int64)
    force = {
        place: samples[[f"contact_{place}_{axis}" for axis in ("fx", "fy", "fz")]].to_numpy() for place in ContactPlace
    }
    mouth, tip, face = (force[place].any(axis=1) for place in ContactPlace)
    lateral = (force[ContactPlace.MOUTH][:, :2] * force[ContactPlace.TIP][:, :2]).sum(axis=1)
    deep = samples["contact_face_z"].to_numpy() < -0.5 * geometry.hole_depth
    rules = {
        ContactLabel.SEATED: face & deep,
        ContactLabel.FACE: face,
        ContactLabel.CHAMFER: (mouth | tip) & (samples["tip_z"].to_numpy() > -geometry.chamfer),
        ContactLabel.TWO_POINT: mouth & tip & (lateral < 0.0),
        ContactLabel.LINE: mouth & tip,
        ContactLabel.MOUTH: mouth,
        ContactLabel.TIP: tip,
    }
    chosen = np.select(list(rules.values()), [int(label) for label in rules], default=int(ContactLabel.FREE))
    return np.asarray(chosen, dtype=np.int64)


def _features(
    *, state: Feature, wrench: str, action: Feature, label: str, recorded: tuple[str, ...]
) -> dict[str, Feature]:
    """The features of both kinds; the wrench is there for policies, and as a copy whose names have units."""
    with_units = tuple(f"{name} [{unit}]" for name, unit in zip(WRENCH, WRENCH_UNITS, strict=True))
    return {
        "observation.state": state,
        "observation.environment_state": Feature("float32", WRENCH, WRENCH_UNITS, wrench),
        "observation.wrench": Feature("float32", with_units, WRENCH_UNITS, wrench),
        "action": action,
        "contact_label": Feature("int64", frame=label, labels=tuple(c.label for c in ContactLabel)),
        "outcome": Feature("int64", frame="of the whole episode", labels=tuple(Outcome)),
        "next.done": Feature("bool"),
        "next.success": Feature("bool"),
        "recording": Feature("float64", recorded, frame="the columns of the recording, unchanged"),
    }


def _columns(
    samples: pd.DataFrame,
    *,
    state: Array,
    action: Array,
    labels: NDArray[np.int64],
    outcome: Outcome,
    success: bool,
    recorded: tuple[str, ...],
) -> dict[str, NDArray[Any]]:
    """The numbers of `_features`; only the last frame ends an episode."""
    wrench = samples[list(WRENCH)].to_numpy(dtype=np.float32)
    done = np.arange(len(samples)) == len(samples) - 1
    return {
        "observation.state": state.astype(np.float32),
        "observation.environment_state": wrench,
        "observation.wrench": wrench,
        "action": action.astype(np.float32),
        "contact_label": labels,
        "outcome": np.full(len(samples), list(Outcome).index(outcome)),
        "next.done": done,
        "next.success": done & success,
        "recording": samples[list(recorded)].to_numpy(dtype=np.float64),
    }
