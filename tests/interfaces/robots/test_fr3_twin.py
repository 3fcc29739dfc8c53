"""The simulated FR3 through libfranka's protocol: motions, estimates, stops, and an insertion."""

import contextlib
import os
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

pytest.importorskip("franky")
pytest.importorskip("franky_sim")

from experiments.trial.trial_set import TrialSet, trial_scenario
from interfaces.robots import fr3_twin
from interfaces.robots.fr3_twin import SENSOR_PAGE_PORT, SENSOR_PORT, Fr3Twin
from interfaces.robots.franky_arm import FORCE_LIMIT as FRANKA_LIMIT
from interfaces.robots.franky_arm import FrankyArm
from interfaces.robots.insertion import FORCE_LIMIT, ArmSession
from interfaces.robots.open_arm import open_arm
from interfaces.sensors.net_ft import NetFt
from models.hardware import GRAVITY
from models.scenario import load_scenario
from scripts.command_line import SHIPPED
from skill.data.outcome import Outcome
from skill.manipulation_skill import ManipulationSkill
from systems.arm.tip import HEIGHT, X
from systems.arm.tip_servo import tip_at, tip_pose
from tests.waiting import until

pytestmark = pytest.mark.slow
STOP_TIME = 0.05  # in units of s

FOLLOW = """
import numpy as np
from interfaces.robots.franky_arm import FrankyArm
arm = FrankyArm({host!r}, 14250.0)
start = last = arm.state()
print("moves", flush=True)
while True:
    state = arm.state()
    if state.time > last.time + 0.0035:
        last = state
        arm.follow(start.angles + 0.2 * (state.time - start.time), np.full(7, 0.2))
"""


@pytest.fixture(autouse=True)
def priority_as_before():
    """Takes back the real-time priority that libfranka gives its caller; the tests that follow do not expect it."""
    yield
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))


def loopback_address():
    """Returns an address of this machine of which no other test takes the ports."""
    return "127." + ".".join(str(1 + part % 250) for part in os.urandom(3))


class Served:
    """A twin that a thread serves, with what its arm does."""

    def __init__(self, **changes):
        self.scenario = load_scenario("fr3")
        for name, value in changes.items():
            setattr(self.scenario.arm, name, value)
        self.host, self.holes, self.rates = loopback_address(), [], []
        self.twin = Fr3Twin(self.scenario, seed=3, trials=TrialSet.USUAL, host=self.host, ended=self.holes.append)
        self.thread = threading.Thread(target=self._serve, daemon=True)
        self.is_over = self.is_silent = False

    def _serve(self):
        after_step = self.twin.sensor.send

        def send(wrench, status=0):
            self.rates.append((self.twin.arm.time, self.twin.arm.rates))
            if self.is_over:
                raise InterruptedError
            if not self.is_silent:
                after_step(wrench, status)

        self.twin.sensor.send = send
        with contextlib.suppress(InterruptedError):
            self.twin.run(0.2)  # so that a slow and busy machine keeps up with it

    def __enter__(self):
        self.thread.start()
        assert until(lambda: self.rates)
        return self

    def __exit__(self, *_):
        self.is_over = True
        self.thread.join()
        self.twin.close()

    def time_to_stop(self, since, directions):
        """Returns after which time since a time of the arm's clock no joint goes on, s.

        The joints then swing back a little, and rest after some 0.1 s.
        """
        assert until(lambda: self.twin.arm.time > since + 0.3, 20.0)
        moving = [t for t, rates in list(self.rates) if t > since and (directions * rates > 0.02).any()]
        return max(moving, default=since) - since


@pytest.fixture
def served(request, monkeypatch):
    if "gone_stops" not in request.node.name:  # a busy machine may hold up the commands
        monkeypatch.setattr("interfaces.robots.fr3_twin.LOST_COMMANDS", 500)
    with Served() as twin:
        yield twin


@pytest.fixture
def arm(served):
    with contextlib.closing(FrankyArm(served.host, served.scenario.arm.joint_stiffness)) as arm:
        yield arm


@pytest.fixture(scope="module")
def skill():
    """The skill that comes with the program, for the hole of the scenario."""
    return ManipulationSkill.load(SHIPPED)


@contextlib.contextmanager
def session_with(twin):
    with (
        contextlib.closing(open_arm(twin.host, twin.scenario)) as arm,
        contextlib.closing(NetFt(twin.host, port=SENSOR_PORT, http_port=SENSOR_PAGE_PORT)) as sensor,
    ):
        yield ArmSession(arm, sensor, twin.scenario)


def test_the_joints_move_to_angles_and_follow_a_motion(arm):
    start = arm.state()
    arm.move_to(start.angles + 0.02, 0.6)
    # The friction of a joint over its stiffness, and its part of an uncompensated weight.
    np.testing.assert_allclose(arm.state().angles, start.angles + 0.02, atol=5e-4)
    arm.move_to(start.angles, 0.6)
    begin = last = arm.state()
    errors = []
    while last.time < begin.time + 1.0:
        state = arm.state()
        if state.time < last.time + 0.0035:
            time.sleep(2e-4)  # the twin is a thread of this process
            continue
        last, t = state, state.time - begin.time
        arm.follow(begin.angles + 0.02 * (1.0 - np.cos(3.0 * t)), np.full(7, 0.06 * np.sin(3.0 * t)))
        errors.append(state.angles - begin.angles - 0.02 * (1.0 - np.cos(3.0 * t)))
    arm.stop()
    assert np.abs(errors).max() < 1e-3


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGSTOP], ids=["killed", "without commands"])
def test_an_arm_whose_program_is_gone_stops(served, how):
    client = subprocess.Popen(
        [sys.executable, "-c", FOLLOW.format(host=served.host)], stdout=subprocess.PIPE, env=os.environ
    )
    try:
        assert client.stdout.readline() == b"moves\n"
        assert until(lambda: served.rates[-1][1].min() > 0.15)
        since = served.twin.arm.time
        client.send_signal(how)
        assert served.time_to_stop(since, np.ones(7)) < STOP_TIME
    finally:
        client.kill()
        client.wait()


def test_a_silent_sensor_stops_an_insertion(served, skill):
    with session_with(served) as session:
        session.approach()
        since = []

        def fall_silent():
            assert until(lambda: served.twin.arm.peg_in_hole().translation()[2] < 0.0022, 60.0)
            served.is_silent = True
            since.append(served.twin.arm.time)

        threading.Thread(target=fall_silent).start()
        ended = session.insert(skill, 0)
        assert ended.outcome is Outcome.FAILED
        assert ended.detail.startswith("stopped: the sensor is silent")
        at_that_time = next(rates for t, rates in served.rates if t >= since[0])
        assert np.abs(at_that_time).max() > 0.02
        assert served.time_to_stop(since[0], np.sign(at_that_time)) < STOP_TIME


def test_a_limit_of_the_arm_stops_it_by_itself(served, arm):
    """The arm presses on the block beside the hole, until its own estimate passes the limit of its force."""
    beside = tip_at(0.005)
    beside[X] = 0.02
    pressed = beside.copy()
    pressed[HEIGHT] = -0.02
    above, below = (served.twin.arm.kinematics.angles_at(tip_pose(np.zeros(3), tip)) for tip in (beside, pressed))
    arm.move_to(above, 0.6)
    with pytest.raises(ConnectionError, match=r"the arm has stopped: .*cartesian_reflex"):
        arm.move_to(below, 0.1)
    force = served.twin.arm.reading()[2]
    assert FRANKA_LIMIT < force < 1.5 * FRANKA_LIMIT


@pytest.mark.parametrize(
    ("place", "name"),
    [
        (fr3_twin.JOINT_REFLEX, "joint_reflex"),
        (fr3_twin.COMMUNICATION, "communication_constraints_violation"),
    ],
)
def test_an_error_has_the_name_that_libfranka_gives_it(served, arm, place, name):
    served.twin._server.robot_servers[0]._errors = (place,)
    assert until(lambda: arm.state().fault == f'["{name}"]')


def test_a_flange_under_impedance_gives_way_by_its_stiffness():
    """What hangs on the sensor is not told to the arm: the flange sags by its weight over the stiffness."""
    with (
        Served(impedance=[2000.0, 200.0], gravity_error=0.0) as served,
        contextlib.closing(open_arm(served.host, served.scenario)) as arm,
    ):
        kinematics = served.twin.arm.kinematics
        held = start = arm.state()
        while held.time < start.time + 1.0:
            held = arm.state()
            arm.follow(start.angles, np.zeros(7))
            time.sleep(0.005)
        sag = kinematics.flange(start.angles).translation() - kinematics.flange(held.angles).translation()
        np.testing.assert_allclose(sag[2], served.twin.arm.held_weight / 2000.0, rtol=0.3)  # friction holds some of it
        arm.stop()


@pytest.mark.nightly  # the command arm inserts one every day, by the same session
def test_a_tool_is_found_and_a_peg_is_inserted_and_recorded(served, skill):
    with session_with(served) as session:
        tool = session.find_tool()
        session.approach()
        ended = session.insert(skill, 0)
        session.retreat()
        session.approach()  # the next hole
    assert tool.mass == pytest.approx(served.twin.arm.held_weight / GRAVITY, rel=0.01)
    np.testing.assert_allclose(tool.centre, [0.0, 0.0, -served.scenario.sensor.height], atol=1e-3)
    assert ended.result.reason == "inserted"
    assert ended.result.peak_measured_load < FORCE_LIMIT
    (hole,) = served.holes
    assert hole.depth >= served.scenario.full_depth
    run = ended.record(skill)
    assert run.samples["depth"].iloc[-1] == pytest.approx(served.scenario.full_depth, abs=1e-3)
    # The hole of trial 3 is askew by the tilt that this trial has on a rig.
    tilt = trial_scenario(served.scenario, number=3).start.tilt
    np.testing.assert_allclose(-run.samples[["pitch", "yaw"]].iloc[0], tilt, atol=0.01)
