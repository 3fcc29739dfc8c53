"""The arm as a diagram: at rest, in motion, how it stops, and a whole insertion."""

import math

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator

from experiments.trial.diagram_trial import run_rig
from experiments.trial.run_trial import run_trial
from experiments.trial.trial_set import trial_scenario
from models.arm import FR3, UR5E
from models.scenario import load_scenario, validate_scenario
from scripts.command_line import SHIPPED
from skill.manipulation_skill import ManipulationSkill
from skill.policy.rig_policy import Action
from skill.states.estimate import Estimate
from systems.arm.arm_diagram import MakeArm, stopping_of
from systems.arm.kinematics import ArmKinematics
from systems.law.control_law import ControlLaw
from systems.rig import MakeRig
from tests.diagrams import unconnected_inputs


class Commanded(ControlLaw):
    """Turns and feeds at constant rates."""

    def __init__(self, turn=(0.0, 0.0), feed=0.0):
        self.turn, self.feed = np.array(turn), feed

    def act(self, measured, estimate: Estimate | None = None):
        return Action(self.turn * self.period_, self.feed * self.period_)


@pytest.fixture(params=[FR3, UR5E])
def scenario(request):
    scenario = load_scenario(request.param)
    scenario.start.height, scenario.start.tilt = 0.02, [0.02, -0.01]
    return trial_scenario(scenario, number=1)


def started(scenario, law):
    rig = MakeRig(scenario, law)
    simulator = Simulator(rig.diagram)
    rig.set_start(simulator.get_mutable_context())
    return rig, simulator


def rows(rig, simulator):
    return rig.recorder.samples(simulator.get_context())


def test_every_input_is_connected(scenario):
    names = unconnected_inputs(MakeArm(scenario, Commanded()).diagram)
    assert {name for name in names if "scene_graph" not in str(name) and "plant" not in str(name)} == set()


def test_at_rest_in_free_air_the_tip_stays_and_the_sensor_reads_nothing(scenario):
    rig, simulator = started(scenario, Commanded())
    simulator.AdvanceTo(0.3)
    found = rows(rig, simulator)
    assert np.abs(found[["fx", "fy"]].to_numpy()).max() < 0.5  # bias, noise, and the part of the weight by the tilt
    assert np.abs(found["fz"]).max() < 0.5
    assert abs(found["tip_z"].iloc[-1] - 0.02) < 2e-4  # an error of 1 % in gravity bends the arm
    np.testing.assert_allclose(found[["pitch", "yaw"]].iloc[-1], [-0.02, 0.01], atol=1e-3)
    assert found["fault"].max() == 0


def test_the_peg_turns_about_the_mouth_and_feeds_as_commanded(scenario):
    scenario.arm.delay = 2e-3  # the force guard slows an arm that hears its commands later
    rig, simulator = started(scenario, Commanded(turn=(0.05, -0.02), feed=-0.01))
    simulator.AdvanceTo(0.5)
    found = rows(rig, simulator)
    first, last = found.iloc[10], found.iloc[-1]
    assert last["target_pitch"] - first["target_pitch"] == pytest.approx(-0.05 * 0.3, rel=0.02)
    assert last["pitch"] - first["pitch"] == pytest.approx(-0.05 * 0.3, rel=0.05)
    assert last["yaw"] - first["yaw"] == pytest.approx(0.02 * 0.3, rel=0.1)
    assert last["depth"] - first["depth"] == pytest.approx(0.01 * 0.3, rel=0.02)
    X_HP = rig.plant.peg_in_hole(simulator.get_context())
    across = X_HP.translation() - X_HP.translation() @ X_HP.rotation().col(2) * X_HP.rotation().col(2)
    assert np.linalg.norm(across) < 1e-3  # the axis passes the mouth


def test_a_stop_is_that_of_spring_mass_and_delay(scenario):
    kinematics = ArmKinematics(scenario)
    found, arm = stopping_of(scenario, kinematics), scenario.arm
    assert found.delay == pytest.approx(
        scenario.sensor.delay + scenario.sensor.time_constant + scenario.sensor.period + arm.delay + 1e-3
    )
    stiff = stopping_of(scenario, kinematics).feed_impact
    arm.axial_stiffness, arm.joint_stiffness = 1e4, 1e9  # only the compliance is soft
    assert stopping_of(scenario, kinematics).feed_impact == pytest.approx(
        math.sqrt(1e4 * arm.held_mass) + 1e4 * found.delay, rel=1e-3
    )
    assert stopping_of(scenario, kinematics).feed_impact < stiff


def test_another_trial_in_the_same_diagram_is_that_of_a_new_one(scenario):
    other = trial_scenario(load_scenario(scenario.carrier), number=5)
    other.trial.time_limit = scenario.trial.time_limit = 0.4
    law = Commanded(turn=(0.02, 0.0), feed=-0.02)
    built = trial_scenario(load_scenario(scenario.carrier), number=6)
    built.trial.time_limit = 0.4
    ended = [run_rig(MakeRig(base, law), other, seed=5) for base in (built, other)]
    np.testing.assert_array_equal(ended[0].samples.to_numpy(), ended[1].samples.to_numpy())


def test_an_arm_has_the_exact_engine(scenario):
    scenario.contact.engine = "drake"
    with pytest.raises(ValueError, match=r"contact.engine is 'drake', expected exact, for an arm"):
        validate_scenario(scenario)


@pytest.mark.slow
@pytest.mark.parametrize("carrier", [FR3, UR5E])
def test_the_skill_of_the_rig_inserts_with_an_arm(carrier):
    scenario = load_scenario(carrier)
    scenario.start.tilt, scenario.arm.hole_offset, scenario.trial.time_limit = [0.03, -0.025], [2e-4, -1e-4], 20.0
    result, run = run_trial(trial_scenario(scenario, number=1000), ManipulationSkill.load(SHIPPED), seed=1000)
    assert result.reason == "inserted"
    assert result.steps == 0
    assert np.abs(run.samples[["pitch", "yaw"]].iloc[-1]).max() < 0.01  # upright in the hole
