"""Trials by the compiled loop are those of the diagram, bit for bit."""

import copy

import numpy as np
import pandas as pd
import pytest

from experiments.trial.diagram_trial import run_rig
from experiments.trial.loop_trial import rolled_out
from experiments.trial.trial_set import TrialSet, trial_scenario
from models.scenario import load_scenario
from scripts.command_line import SHIPPED
from skill.data.outcome import Outcome
from skill.manipulation_skill import ManipulationSkill
from skill.policy.rig_policy import CarriedOver
from skill.practice import PerturbedPolicy, draw_perturbation
from skill.regression.locally_weighted_regression import LWRegressor
from skill.skill_step import skill_numbers
from systems.law.faults import Fault
from systems.rig import MakeRig
from tests.experiments.sweep.pushes import Push


@pytest.fixture(scope="module")
def shipped():
    return ManipulationSkill.load(SHIPPED)


def scenario_of(number, trial_set=TrialSet.USUAL, **changes):
    scenario = load_scenario()
    scenario.contact.engine = "exact"
    for name, value in changes.items():
        part, key = name.split("__")
        setattr(getattr(scenario, part), key, value)
    return trial_scenario(scenario, number=number, trial_set=trial_set)


def compared(scenario, policy):
    """The trial by both; what a diagram computes from poses differs by round-off."""
    fast = rolled_out(scenario, policy, number=7)
    slow = run_rig(MakeRig(scenario, policy), scenario, seed=7)
    pd.testing.assert_frame_equal(fast.samples, slow.samples, check_exact=True)
    assert fast.time == slow.time
    assert (fast.result.outcome, fast.result.reason, fast.result.fault) == (
        slow.result.outcome, slow.result.reason, slow.result.fault,
    )  # fmt: skip
    for name in ("peak_load", "mean_load", "peak_contact_force", "peak_measured_load", "wedged_time", "first_touch"):
        assert getattr(fast.result, name) == pytest.approx(getattr(slow.result, name), rel=1e-9), name
    assert fast.result.penetration == pytest.approx(slow.result.penetration, abs=1e-9)
    for name in ("path_length", "mean_jerk"):
        assert getattr(fast.result, name) == pytest.approx(getattr(slow.result, name), rel=1e-6, abs=1e-10), name
    contacts = [ended.record(policy).samples.filter(like="contact_") for ended in (fast, slow)]
    np.testing.assert_allclose(*contacts, rtol=1e-9, atol=1e-12)
    return fast.result


@pytest.mark.slow
@pytest.mark.parametrize(("number", "trial_set"), [(501, TrialSet.USUAL), (502, TrialSet.HARD), (503, TrialSet.HARD)])
def test_a_trial_is_inserted_alike(shipped, number, trial_set):
    assert compared(scenario_of(number, trial_set), shipped).outcome is Outcome.INSERTED


@pytest.mark.slow
def test_a_carried_over_skill_rolls_out_in_another_hole(shipped):
    scenario = scenario_of(501, geometry__hole_radius=0.01006)
    with pytest.raises(ValueError, match="the skill was trained for"):
        rolled_out(scenario, shipped, number=501)
    assert compared(scenario, CarriedOver(shipped)).outcome is Outcome.INSERTED


@pytest.mark.slow
def test_a_trial_that_runs_out_of_time_ends_alike(shipped):
    assert compared(scenario_of(504, trial__time_limit=1.01), shipped).outcome is Outcome.TIME_OVER


@pytest.mark.slow
def test_a_fault_ends_a_trial_alike(shipped):
    result = compared(scenario_of(505, TrialSet.HARD, stepper__holding_torque=0.02), shipped)
    assert result.fault in {Fault.PITCH_STEPS_LOST, Fault.YAW_STEPS_LOST}


@pytest.mark.slow
def test_a_policy_that_gives_up_ends_a_trial_alike(shipped):
    """A sensor with a bias of several newtons: the skill believes that it is in contact."""
    result = compared(scenario_of(505, sensor__force_bias=5.0), shipped)
    assert result.outcome is Outcome.JAMMED
    assert "attempts in a row" in result.reason


@pytest.mark.slow
def test_a_skill_that_turns_about_the_axis_acts_alike(shipped):
    """Its fourth output is a turn with the moment about the axis."""
    turning, old = copy.copy(shipped), shipped.regressor_
    spin = 3e-3 * old.X_[:, shipped.features_.names.index("mz")]
    turning.regressor_ = LWRegressor.from_arrays({**old.to_arrays(), "y": np.column_stack([old.y_, spin])})
    turning.metadata_ = {**shipped.metadata_, "clocking": True}
    square = {"geometry__section": "square", "geometry__chamfer": 0.001, "rig__clocking_stage": True}
    scenario = scenario_of(501, trial__time_limit=1.5, **square)
    assert scenario.start.clocking != 0.0
    compared(scenario, CarriedOver(turning))
    rows = rolled_out(scenario, CarriedOver(turning), number=501).samples
    assert rows["clocking"].iloc[0] == -scenario.start.clocking
    assert abs(rows["target_clocking"]).max() > 1e-3
    with pytest.raises(ValueError, match="the rig has no clocking stage"):
        rolled_out(scenario_of(501), turning, number=501)


@pytest.mark.slow
def test_a_perturbed_skill_acts_alike(shipped):
    perturbation = draw_perturbation(np.random.default_rng(0), 0.02)
    compared(scenario_of(511, trial__time_limit=1.5), PerturbedPolicy(shipped, perturbation))


def test_only_the_exact_engine_and_skills_that_imitate_have_a_loop(shipped):
    scenario = scenario_of(509)
    assert rolled_out(scenario, Push(), number=1) is None
    scenario.contact.engine = "drake"
    assert rolled_out(scenario, shipped, number=1) is None
    assert skill_numbers(Push()) is None
