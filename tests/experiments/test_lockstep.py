"""Servo and simulation together, without a clock."""

import copy
from itertools import islice

import numpy as np
import pytest
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.systems.framework import LeafSystem

from experiments.demonstration_run import DemonstrationRun
from models.scenario import DEMONSTRATION_STREAM, load_scenario, resolve_scenario
from systems.math.rotation import from_rotation_vector, rotation_vector
from systems.servo.served_environment import MakeServedEnvironment
from systems.servo.servo_diagram import MakeServo
from systems.virtual_environment import MakeVirtualEnvironment, start_pose
from tests.lockstep import lockstep

H = 1e-3


class Path(LeafSystem):
    """A hand that follows poses, one for each tick."""

    def __init__(self, poses):
        super().__init__()
        self._poses = poses
        self.DeclareAbstractOutputPort("hand_pose", Value[RigidTransform], self._calc, {self.time_ticket()})

    def _calc(self, context, output):
        output.set_value(self._poses[min(round(context.get_time() / H), len(self._poses) - 1)])


def scenario_of(seed, time_step, engine="drake", section="round"):
    scenario = load_scenario("live")
    scenario.contact.engine, scenario.geometry.section = engine, section
    scenario.start.tilt, scenario.contact.time_step = [0.05, 0.03], time_step
    return resolve_scenario(scenario, seed=seed, stream=DEMONSTRATION_STREAM)


def pushed(scenario, duration):
    """A hand that goes down by 20 mm in half a second and stays, while it levels the peg."""
    X = start_pose(scenario)
    turn = rotation_vector(X.rotation())
    poses = []
    for t in np.arange(0.0, duration, H):
        part = min(1.0, t / 0.5)
        depth = np.array([0.0, 0.0, -0.02 * part])
        poses.append(RigidTransform(from_rotation_vector((1.0 - 0.3 * part) * turn), X.translation() + depth))
    return poses


def wrenches(scenario, poses):
    environment = MakeServedEnvironment(scenario)
    run = DemonstrationRun(scenario, environment)
    servo = MakeServo(scenario, operator=Path(poses), X_HP_start=environment.X_HP_start)
    servo.start(environment.X_HP_start)
    ticks = lockstep(servo, run, environment, time_step=scenario.contact.time_step)
    return np.array([probe.wrench for probe in islice(ticks, len(poses))])


def reference(scenario, poses):
    """The rendered wrenches with device and contact in one diagram, the contact every millisecond."""
    exact = copy.deepcopy(scenario)
    exact.contact.time_step = H
    environment = MakeVirtualEnvironment(exact, operator=Path(poses))
    run = DemonstrationRun(exact, environment)
    found = []
    for k in range(len(poses)):
        found.append(environment.rendered_wrench(run.simulator.get_context()))
        run.advance((k + 1) * H)
    return np.array(found)


def rms(a):
    return np.sqrt(np.mean(np.sum(np.square(a), axis=1)))


@pytest.fixture(scope="module", params=[("drake", "round"), ("exact", "round"), ("exact", "hexagon")])
def compared(request):
    scenario = scenario_of(1, 0.002, *request.param)
    poses = pushed(scenario, 0.9)
    return reference(scenario, poses), wrenches(scenario, poses), wrenches(scenario, poses)


def test_the_force_is_that_of_a_simulation_with_contact_at_1_khz(compared):
    exact, found, _ = compared
    assert rms(exact[:, 3:]) > 1.0
    assert rms(found[:, 3:] - exact[:, 3:]) < 0.1 * rms(exact[:, 3:])
    assert rms(found[:, :3] - exact[:, :3]) < 0.1 * rms(exact[:, :3])


def test_a_run_is_the_same_every_time(compared):
    _, found, again = compared
    np.testing.assert_array_equal(found, again)


def test_the_force_has_no_steps_where_models_arrive():
    """Against a wall, the largest change from tick to tick is not larger at the ticks of a new model."""
    scenario = scenario_of(1, 0.004)
    found = wrenches(scenario, pushed(scenario, 0.9))[600:, 3:]  # the hand rests
    changes = np.linalg.norm(np.diff(found, axis=0), axis=1)
    assert np.linalg.norm(found, axis=1).min() > 0.5
    assert changes.max() < 0.02
