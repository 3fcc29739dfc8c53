import math
from dataclasses import replace

import numpy as np
import pytest
from pydrake.common.value import Value

from models.control import BackOffParameters, ControllerParameters, ForceGuardParameters
from models.scenario import Scenario
from skill.features.measurement import MEASURED
from skill.policy.rig_policy import Action
from systems.law.back_off import BackOffState
from systems.law.policy_controller import ControllerLimits, ControllerState, PolicyController
from systems.law.turn_reversal import TurnWatch
from tests.stepping import fixed_context, update_unrestricted

RADIUS = 0.01
COMMANDS = ("pitch_rate", "yaw_rate", "clocking_rate", "feed_speed", "unwinding", "back_off")


class FixedPolicy:
    """A policy that always returns the same action, or raises the same exception."""

    def __init__(self, skill, action):
        self.period_, self.action = skill.period_, action
        self.estimate_alone, self.state_names = skill.estimate_alone, skill.state_names

    def act(self, measured, estimate=None):
        if isinstance(self.action, Exception):
            raise self.action
        return self.action


GENTLE = ControllerParameters(
    gain=1.5, max_turn_rate=100.0, max_turn=1e9, max_feed_speed=100.0, guard=ForceGuardParameters(force_limit=1e9)
)  # commands stay within all limits
GUARDED = replace(GENTLE, guard=ForceGuardParameters(force_limit=20.0))
BACK_OFF = BackOffParameters()


@pytest.fixture
def measurements(demonstrations):
    return demonstrations[3].samples[list(MEASURED)].to_numpy()[::8]


def controller(policy, row, parameters=GENTLE):
    scenario = Scenario(controller=parameters)
    dut = PolicyController(policy=policy, limits=ControllerLimits.of(scenario, policy.period_))
    estimate = policy.estimate_alone(row)
    context = fixed_context(dut, wrench=row[:6], depth=[-row[6]], target_pitch=[0.0], target_yaw=[0.0])
    believe(dut, context, estimate)
    return dut, context, None if isinstance(policy, FixedPolicy) else policy.act(row, estimate)


def believe(dut, context, estimate):
    dut.GetInputPort("estimate").FixValue(context, Value[object](estimate))


def commands(dut, context):
    return {name: dut.GetOutputPort(name).Eval(context)[0] for name in COMMANDS}


def step(dut, context, parameters=GENTLE, times=1):
    update_unrestricted(dut, context, period=parameters.period, times=times)
    return commands(dut, context)


def test_the_hole_turns_opposite_to_the_action_and_the_feed_has_its_speed(skill, measurements):
    turned = 0
    for row in measurements:
        dut, context, action = controller(skill, row)
        found = step(dut, context)
        assert found["pitch_rate"] == pytest.approx(-GENTLE.gain * action.turn[0] / skill.period_, rel=1e-12, abs=1e-15)
        assert found["yaw_rate"] == pytest.approx(-GENTLE.gain * action.turn[1] / skill.period_, rel=1e-12, abs=1e-15)
        assert found["feed_speed"] == pytest.approx(action.feed / skill.period_, rel=1e-12, abs=1e-15)
        assert found["back_off"] == 0.0
        turned += np.linalg.norm(action.turn) > 1e-5
    assert turned > 3  # the demonstration does correct its tilt


@pytest.mark.parametrize("turning", [1.0, -1.0])
def test_the_turn_about_the_axis_is_limited_and_never_reversed(skill, measurements, turning):
    action = Action(turn=np.zeros(2), feed=0.0, spin=1e-3)
    dut, context, _ = controller(FixedPolicy(skill, action), measurements[0])
    state = ControllerState(back_off=BackOffState(watch=TurnWatch(float(turning < 0.0))))
    context.SetDiscreteState(state.as_list())
    assert step(dut, context)["clocking_rate"] == pytest.approx(-GENTLE.gain * 1e-3 / skill.period_)
    assert dut.GetOutputPort("turning").Eval(context)[0] == turning
    slow = replace(GENTLE, max_turn_rate=0.02)
    assert step(*controller(FixedPolicy(skill, action), measurements[0], slow)[:2], slow)["clocking_rate"] == -0.02


@pytest.mark.parametrize("direction", [[0.48, 0.64, 0.6, 0, 0, 0], [0, 0, 0, 0.6 * RADIUS, 0.8 * RADIUS, 0]])
def test_above_the_limit_of_force_or_moment_the_peg_is_backed_off_without_turning(skill, measurements, direction):
    row = measurements[len(measurements) // 3].copy()
    row[:6] = 19.99 * np.array(direction)
    found = step(*controller(skill, row, GUARDED)[:2], GUARDED)
    assert found["back_off"] == 0.0
    row[:6] = 20.01 * np.array(direction)
    found = step(*controller(skill, row, GUARDED)[:2], GUARDED)
    drawn_back = {"feed_speed": BACK_OFF.retract_speed, "unwinding": 0.0, "back_off": 1.0}
    assert found == {"pitch_rate": 0.0, "yaw_rate": 0.0, "clocking_rate": 0.0, **drawn_back}


def test_low_support_and_an_unknown_state_reduce_the_feed(skill, measurements):
    dut, context, action = controller(skill, measurements[0])
    whole = step(dut, context)["feed_speed"]
    policy = FixedPolicy(skill, replace(action, support=0.25))
    dut, context, _ = controller(policy, measurements[0])
    assert dut.GetOutputPort("support").Eval(context)[0] == 1.0
    assert step(dut, context)["feed_speed"] == pytest.approx(0.25 * whole)
    assert dut.GetOutputPort("support").Eval(context)[0] == 0.25
    believe(dut, context, replace(skill.estimate_alone(measurements[0]), known=False))
    assert step(dut, context)["feed_speed"] == pytest.approx(0.125 * whole)


@pytest.mark.parametrize(
    "action",
    [
        Action(turn=np.array([1e308, -1e308]), feed=-1e308, spin=1e308),
        Action(turn=np.array([1.7e308, 1.7e308]), feed=1.7e308, spin=-1.7e308),
        Action(turn=np.array([0.0, 5e-324]), feed=-1e308, support=1e308),
        Action(turn=np.array([0.0, 1e300]), feed=-1e-3, support=-1e308),
    ],
)
def test_an_action_of_any_size_is_limited_and_keeps_its_direction(skill, measurements, action):
    limits = ControllerParameters()
    policy = FixedPolicy(skill, skill.act(measurements[0]))
    dut, context, _ = controller(policy, measurements[0], limits)
    policy.action = action
    found = step(dut, context, limits)
    assert dut.failure(context) == ""
    turn = np.array([found["pitch_rate"], found["yaw_rate"]])
    assert np.linalg.norm(turn) <= limits.max_turn_rate * (1 + 1e-12)
    assert abs(found["feed_speed"]) <= limits.max_feed_speed
    if np.abs(action.turn).max() > 1.0:
        wanted = -action.turn / np.abs(action.turn).max()
        np.testing.assert_allclose(turn, limits.max_turn_rate * wanted / np.linalg.norm(wanted), rtol=1e-12)


@pytest.mark.parametrize(
    ("failing", "message"),
    [
        (ArithmeticError("beyond\nme"), "ArithmeticError: beyond"),
        (Action(turn=np.array([math.nan, 0.0]), feed=0.0), "ValueError: the action is not"),
        (Action(turn=np.zeros(2), feed=-math.inf), "ValueError: the action is not finite"),
    ],
)
def test_a_policy_that_fails_is_not_called_again(skill, measurements, failing, message):
    sound = skill.act(measurements[0])
    policy = FixedPolicy(skill, sound)
    dut, context, _ = controller(policy, measurements[0])
    before = step(dut, context)
    assert (dut.GetOutputPort("failed").Eval(context)[0], dut.failure(context)) == (0.0, "")
    policy.action = failing
    after = step(dut, context)
    assert after == {**before, "pitch_rate": 0.0, "yaw_rate": 0.0, "feed_speed": 0.0}
    assert dut.GetOutputPort("failed").Eval(context)[0] == 1.0
    assert dut.GetOutputPort("turning").Eval(context)[0] == 0.0
    assert dut.failure(context).startswith(message)
    policy.action = sound
    assert step(dut, context, times=3) == after


def test_a_policy_with_nothing_new_to_try_stops_and_says_what_it_tried(skill, measurements):
    action = Action(turn=np.array([1e-3, -2e-3]), feed=-1e-4)
    dut, context, _ = controller(FixedPolicy(skill, action), np.array([0.0, 0.0, 5.0, 0.0, 0.0, 0.0, -0.0123]))
    attempt = BACK_OFF.stall_time + BACK_OFF.time
    step(dut, context, times=round(BACK_OFF.max_repeats * attempt / GENTLE.period))
    assert dut.tried(context) == ""
    found = step(dut, context, times=round(1.2 * attempt / GENTLE.period))
    assert (found["pitch_rate"], found["yaw_rate"], found["feed_speed"]) == (0.0, 0.0, 0.0)
    assert dut.GetOutputPort("given_up").Eval(context)[0] == 1.0
    name = skill.state_names()[skill.estimate_alone(np.array([0, 0, 5.0, 0, 0, 0, -0.0123])).state]
    expected = f"{1 + BACK_OFF.max_repeats} attempts in a row ended in {name!r}, none deeper than 12.3 mm"
    assert dut.tried(context) == expected


def test_turns_that_raise_the_lateral_force_are_reversed(skill, measurements):
    """The controller judges its own turns by the angles that the guard permits and the measured force."""
    action = Action(turn=np.array([1e-3, 0.0]), feed=-1e-4)
    dut, context, _ = controller(FixedPolicy(skill, action), measurements[0])
    later = ControllerState(back_off=BackOffState(contact_state=0.0, best=0.004))
    context.SetDiscreteState(later.as_list())
    found = []
    for k in range(20):  # the lateral force rises by 3.2 N, and neither of its components by 3 N
        dut.GetInputPort("wrench").FixValue(context, [0.1 * k, 0.134 * k, 1.0, 0.0, 0.0, 0.0])
        dut.GetInputPort("target_yaw").FixValue(context, [1e-3 * k])
        step(dut, context)
        found.append(dut.GetOutputPort("turning").Eval(context)[0])
    assert found[0] == 1.0
    assert found[-1] == -1.0
    assert set(found) == {1.0, -1.0}  # without a back-off
