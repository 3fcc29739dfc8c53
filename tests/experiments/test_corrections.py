from dataclasses import replace

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator

from experiments import corrections
from experiments.corrections import (
    LIFT,
    StuckTrial,
    correct,
    correction_scenario,
    demonstrate_correction,
    find_query_state,
    practice_trial,
)
from experiments.demonstration_set import OPERATORS, Request, demonstrate
from experiments.trial.trial_set import trial_scenario
from models.scenario import parse_scenario
from skill.features.measurement import contact_load
from skill.policy.rig_policy import Action
from systems.law.control_law import ControlLaw
from systems.rig import MakeRig
from systems.virtual_environment import start_pose
from tests.query_states import QUERY_STATE
from tests.trajectories import STATE_NAMES, make_rig_run

REFUSED = ValueError("moments look like N mm")


class Push(ControlLaw):
    """Feeds without a turn, so that it gets stuck."""

    def act(self, measured, estimate=None):
        return Action(turn=np.zeros(2), feed=-2e-4)


def test_a_policy_is_stuck_where_the_first_back_off_begins(quick_scenario):
    run, resolved = make_rig_run(), practice_trial(quick_scenario, 12)
    row = run.samples[run.samples["back_off"] > 0].iloc[0]
    found = find_query_state(run, resolved, number=12, inserted=True)
    assert found.trial == 12
    assert (found.time, found.depth) == (row["time"], row["depth"])
    assert (*found.tilt, found.clocking) == (-row["pitch"], -row["yaw"], -row["clocking"])
    assert found.load == contact_load(row[["fx", "fy", "fz", "mx", "my", "mz"]].to_numpy(dtype=float), 0.01)
    assert found.state == STATE_NAMES[int(row["state"])]
    assert (found.pivot_height, found.friction) == (resolved.rig.pivot_height, resolved.contact.friction)


def test_a_run_without_a_back_off_was_stuck_at_its_end_unless_it_inserted(quick_scenario):
    run = make_rig_run()
    run = replace(run, samples=run.samples.assign(back_off=0.0))
    assert find_query_state(run, quick_scenario, number=1, inserted=True) is None
    found = find_query_state(run, quick_scenario, number=1, inserted=False)
    assert found.depth == run.samples["depth"].iloc[-1]


def test_a_correction_has_the_pivot_and_the_friction_of_the_practice_trial(quick_scenario):
    found = correction_scenario(quick_scenario, QUERY_STATE, seed=5, person=21)
    assert found.rig.pivot_height == QUERY_STATE.pivot_height
    assert found.contact.friction == QUERY_STATE.friction
    assert (found.start.tilt, found.start.clocking) == (list(QUERY_STATE.tilt), QUERY_STATE.clocking)
    assert found.start.tip_height == pytest.approx(LIFT - QUERY_STATE.depth)
    again = correction_scenario(quick_scenario, QUERY_STATE, seed=6, person=21)
    assert again.operator == found.operator  # the same person ...
    assert again.seed != found.seed  # ... with other noise


def test_practice_trials_differ_from_all_other_trials(quick_scenario):
    assert practice_trial(quick_scenario, 4).start.tilt != trial_scenario(quick_scenario, number=4).start.tilt


def test_the_operator_of_a_correction_is_one_of_the_set(quick_scenario):
    shown = demonstrate(quick_scenario, Request(4, "expert", True), seed=2)
    found = correction_scenario(quick_scenario, QUERY_STATE, seed=5, person=2 * OPERATORS + 4)
    assert shown.metadata["operator"] == 2 * OPERATORS + 4
    assert parse_scenario(shown.metadata["scenario"], "test").operator == found.operator


def test_a_correction_begins_in_the_pose_in_which_the_rig_was_stuck(quick_scenario):
    """The pose of the peg in the hole on the rig, which turns the hole, and in the virtual environment, which turns the
    peg: equal but for the lift along the axis and the compliance of the mount."""
    quick_scenario.start.tilt = [0.012, -0.02]
    rig_scenario = practice_trial(quick_scenario, 3)
    rig = MakeRig(rig_scenario, Push())
    simulator = Simulator(rig.diagram)
    context = simulator.get_mutable_context()
    rig.set_start(context)
    simulator.AdvanceTo(0.14)
    X_HP = rig.plant.peg_in_hole(context)
    samples = rig.recorder.samples(context)
    depth = -X_HP.translation()[2]
    assert depth > LIFT
    tilt = (-float(samples["pitch"].iloc[-1]), -float(samples["yaw"].iloc[-1]))
    stuck = replace(QUERY_STATE, depth=depth, tilt=tilt, pivot_height=rig_scenario.rig.pivot_height)
    X_start = start_pose(correction_scenario(quick_scenario, stuck, seed=0))
    np.testing.assert_allclose(X_start.rotation().col(2), X_HP.rotation().col(2), atol=5e-5)
    lifted = X_HP.translation() + LIFT * X_HP.rotation().col(2)
    np.testing.assert_allclose(X_start.translation(), lifted, atol=2e-5)


def test_the_scenario_of_a_rig_does_not_begin_inside_the_hole(quick_scenario):
    quick_scenario.start.depth = 0.002
    with pytest.raises(ValueError, match=r"start\.depth is 0\.002 m; expected 0 on the rig"):
        MakeRig(practice_trial(quick_scenario, 0), Push())


class Recorded:
    """The part of a demonstration that `demonstrate_correction` judges."""

    def __init__(self, *, good):
        self.good, self.metadata = good, {}


@pytest.fixture
def attempts(monkeypatch):
    """Lets the attempts end as told, the last end again and again."""

    def end_as(*ends):
        left = list(ends)

        def run(scenario):
            end = left.pop(0) if len(left) > 1 else left[0]
            if end is REFUSED:
                raise REFUSED
            return Recorded(good=end)

        monkeypatch.setattr(corrections, "run_demonstration", run)

    return end_as


@pytest.mark.parametrize(
    ("ends", "good", "number"),
    [([REFUSED, False, True], True, 3), ([False, REFUSED], False, 5), ([REFUSED, REFUSED, True], True, 3)],
)
def test_an_attempt_that_no_file_may_hold_is_repeated(quick_scenario, attempts, ends, good, number):
    attempts(*ends)
    shown = demonstrate_correction(quick_scenario, QUERY_STATE, number=0, seed=0)
    assert (shown.good, shown.metadata["attempts"]) == (good, number)


def test_if_no_file_may_hold_any_attempt_the_error_says_why(quick_scenario, attempts):
    attempts(REFUSED)
    with pytest.raises(ValueError, match=r"correction 0: none of 5 attempts can be kept \(moments look like N mm\)"):
        demonstrate_correction(quick_scenario, QUERY_STATE, number=0, seed=0)


@pytest.mark.parametrize(
    ("stuck_in", "shown", "trained"), [((1, 2, 3), True, 3), ((1, 3), True, 1), ((1, 2, 3), False, 0), ((), True, 0)]
)
def test_the_loop_ends_after_a_round_without_a_stuck_trial_or_a_demonstration(stuck_in, shown, trained):
    def practise(policy, number):
        return [StuckTrial(replace(QUERY_STATE, trial=number), None)] if number in stuck_in else []

    def demonstrate(query_states, number):
        assert [state.trial for state in query_states] == [number]
        return shown

    def train(policy, stuck, number):
        assert stuck[0].query_state.trial == number
        return policy + 1

    assert correct(0, 3, practise=practise, demonstrate=demonstrate, train=train) == trained
