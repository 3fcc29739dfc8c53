"""Query states in which a skill was stuck, and a skill that gets stuck, for tests."""

import math

from models.scenario import dump_scenario
from skill.data.demonstration import read_demonstrations
from skill.manipulation_skill import ManipulationSkill
from skill.policy.query_state import QueryState
from tests.quick_scenario import make_quick_scenario

QUERY_STATE = QueryState(
    trial=3,
    time=0.5,
    depth=0.004,
    tilt=(0.02, -0.015),
    clocking=0.004,
    load=9.0,
    state="against the wall",
    pivot_height=-0.0007,
    friction=0.17,
)
"""From which tests derive others with `dataclasses.replace`."""


def write_stuck_skill(folder, demonstration_folder, *, time_limit=1.2):
    """Writes quick.yaml, a scenario, and straight.npz, a skill that gets stuck: it has learnt feeds, but no turns."""
    scenario = make_quick_scenario()
    scenario.start.tilt_range = math.radians(3.0)
    scenario.trial.time_limit = time_limit
    scenario.controller.back_off.stall_time = 0.2
    (folder / "quick.yaml").write_text(dump_scenario(scenario))
    skill = ManipulationSkill().fit(read_demonstrations(demonstration_folder))
    skill.regressor_.y_[:, :2] = 0.0
    skill.save(folder / "straight.npz")
