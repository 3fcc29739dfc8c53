import math
from dataclasses import replace

import numpy as np
import pytest

from models.scenario import ControllerParameters
from skill.manipulation_skill import MEASURED, Action
from systems.control.policy_controller import COMMANDS, PolicyController
from tests.stepping import fixed_context, update_unrestricted

RADIUS = 0.01


class Answering:
    """A policy that always gives the same answer, or raises it."""

    def __init__(self, skill, answer):
        self.period_, self.n_states, self.answer = skill.period_, skill.n_states, answer
        self.state_probabilities = skill.state_probabilities

    def act(self, measured, probabilities=None):
        if isinstance(self.answer, Exception):
            raise self.answer
        return self.answer


GENTLE = ControllerParameters(
    gain=1.0, max_turn_rate=100.0, max_turn=1e9, max_feed_speed=100.0, soft_force=1e8, hold_force=1e9, force_limit=1e9
)  # no limit is reached


@pytest.fixture
def measurements(demonstrations):
    return demonstrations[3].samples[list(MEASURED)].to_numpy()[::8]


def controller(skill, row, parameters=GENTLE):
    dut = PolicyController(skill=skill, parameters=parameters, peg_radius=RADIUS)
    probabilities = skill.state_probabilities(row[None])[0]
    context = fixed_context(dut, wrench=row[:6], depth=[-row[6]], probabilities=probabilities, known=[1.0])
    return dut, context, None if isinstance(skill, Answering) else skill.act(row, probabilities)


def commands(dut, context):
    return {name: dut.GetOutputPort(name).Eval(context)[0] for name in COMMANDS}


def step(dut, context, parameters=GENTLE, times=1):
    update_unrestricted(dut, context, period=parameters.period, times=times)
    return commands(dut, context)


def test_before_the_first_decision_nothing_is_commanded(skill, measurements):
    dut, context, _ = controller(skill, measurements[0])
    assert set(commands(dut, context).values()) == {0.0}


def test_the_hole_turns_against_the_learnt_turn_and_the_feed_follows_the_learnt_speed(skill, measurements):
    share = GENTLE.period / skill.period_
    turned = 0
    for row in measurements:
        dut, context, action = controller(skill, row)
        found = step(dut, context)
        assert found["target_pitch"] == pytest.approx(-GENTLE.gain * action.turn[0] * share, rel=1e-12, abs=1e-15)
        assert found["target_yaw"] == pytest.approx(-GENTLE.gain * action.turn[1] * share, rel=1e-12, abs=1e-15)
        assert found["feed_speed"] == pytest.approx(action.feed / skill.period_, rel=1e-12, abs=1e-15)
        assert found["guard"] == 0.0
        turned += np.linalg.norm(action.turn) > 1e-5
    assert turned > 3  # the demonstration does correct its tilt


def test_the_angles_add_up_and_the_speed_does_not(skill, measurements):
    row = measurements[len(measurements) // 3]
    dut, context, _ = controller(skill, row)
    once = step(dut, context)
    assert once["target_pitch"] != 0.0
    thrice = step(dut, context, times=2)
    assert thrice["target_pitch"] == pytest.approx(3 * once["target_pitch"])
    assert thrice["target_yaw"] == pytest.approx(3 * once["target_yaw"])
    assert thrice["feed_speed"] == pytest.approx(once["feed_speed"])


@pytest.mark.parametrize("gain", [0.0, 0.5, 2.0])
def test_the_gain_scales_the_correction_and_not_the_feed(skill, measurements, gain):
    row = measurements[len(measurements) // 3]
    one = step(*controller(skill, row)[:2])
    scaled = ControllerParameters(
        gain=gain,
        max_turn=1e9,
        max_turn_rate=100.0,
        max_feed_speed=100.0,
        soft_force=1e8,
        hold_force=1e9,
        force_limit=1e9,
    )
    found = step(*controller(skill, row, scaled)[:2], scaled)
    assert found["target_pitch"] == pytest.approx(gain * one["target_pitch"])
    assert found["feed_speed"] == one["feed_speed"]


def test_the_turn_keeps_its_direction_at_the_rate_limit(skill, measurements):
    row = measurements[len(measurements) // 3]
    free = step(*controller(skill, row)[:2])
    wanted = np.array([free["target_pitch"], free["target_yaw"]])
    size = np.linalg.norm(wanted)
    slow = ControllerParameters(
        max_turn_rate=0.3 * size / GENTLE.period, max_feed_speed=100.0, soft_force=1e8, hold_force=1e9, force_limit=1e9
    )
    found = step(*controller(skill, row, slow)[:2], slow)
    np.testing.assert_allclose([found["target_pitch"], found["target_yaw"]], 0.3 * wanted, rtol=1e-9)


def test_the_hole_is_turned_no_further_than_the_gimbal_goes(skill, measurements):
    row = measurements[len(measurements) // 3]
    free = step(*controller(skill, row)[:2])
    near = ControllerParameters(
        max_turn=1.5 * abs(free["target_pitch"]), max_turn_rate=100.0, soft_force=1e8, hold_force=1e9, force_limit=1e9
    )
    found = step(*controller(skill, row, near)[:2], near, times=40)
    assert abs(found["target_pitch"]) == pytest.approx(near.max_turn)
    assert abs(found["target_yaw"]) <= near.max_turn


def test_the_feed_is_no_faster_than_its_limit(skill, measurements):
    row = measurements[0]
    free = step(*controller(skill, row)[:2])["feed_speed"]
    assert free < 0  # into the hole
    slow = ControllerParameters(max_feed_speed=0.4 * abs(free), soft_force=1e8, hold_force=1e9, force_limit=1e9)
    assert step(*controller(skill, row, slow)[:2], slow)["feed_speed"] == pytest.approx(0.4 * free)


@pytest.mark.parametrize("direction", [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.48, 0.64, 0.6]])
def test_above_the_force_limit_the_peg_is_backed_off_without_turning(skill, measurements, direction):
    guarded = ControllerParameters(
        soft_force=19.0, hold_force=20.0, force_limit=20.0, max_turn_rate=100.0, max_feed_speed=100.0
    )
    row = measurements[len(measurements) // 3].copy()
    row[3:6] = 0.0
    row[:3] = 19.99 * np.array(direction)
    found = step(*controller(skill, row, guarded)[:2], guarded)
    assert found["guard"] == 0.0
    row[:3] = 20.01 * np.array(direction)
    found = step(*controller(skill, row, guarded)[:2], guarded)
    assert found == {"target_pitch": 0.0, "target_yaw": 0.0, "feed_speed": guarded.retract_speed, "guard": 1.0}


def test_a_couple_counts_as_load_too(skill, measurements):
    """A wedged peg: no net force, but a moment."""
    guarded = ControllerParameters(
        soft_force=19.0, hold_force=20.0, force_limit=20.0, max_turn_rate=100.0, max_feed_speed=100.0
    )
    row = measurements[len(measurements) // 3].copy()
    for size, guard in ((19.99, 0.0), (20.01, 1.0)):
        row[:6] = [0.0, 0.0, 0.0, 0.6 * size * RADIUS, 0.8 * size * RADIUS, 0.0]
        assert step(*controller(skill, row, guarded)[:2], guarded)["guard"] == guard


def test_an_unknown_state_halves_the_feed_and_not_the_turn(skill, measurements):
    row = measurements[0]
    dut, context, _ = controller(skill, row)
    known = step(dut, context)
    dut, context, _ = controller(skill, row)
    dut.GetInputPort("known").FixValue(context, [0.0])
    unknown = step(dut, context)
    assert unknown["feed_speed"] == pytest.approx(0.5 * known["feed_speed"])
    assert unknown["target_pitch"] == known["target_pitch"]


def test_a_tilted_peg_that_is_wedged_is_turned_upright(skill, demonstrations):
    """The sign of the whole chain: on average the command turns the hole towards the demonstrated peg's tilt."""
    agreement = []
    for demonstration in demonstrations[:5]:
        samples = demonstration.samples
        tilt = samples[["ax", "ay"]].to_numpy() * samples[["angle"]].to_numpy()
        force = np.linalg.norm(samples[["fx", "fy"]], axis=1)
        for k in np.flatnonzero((force > 2.0) & (np.linalg.norm(tilt, axis=1) > np.radians(0.5))):
            row = samples[list(MEASURED)].to_numpy()[k]
            found = step(*controller(skill, row)[:2])
            # The peg tilted by theta relative to the hole is aligned by turning the hole by +theta.
            agreement.append(np.dot([found["target_pitch"], found["target_yaw"]], tilt[k]) > 0)
    assert len(agreement) > 20
    assert np.mean(agreement) > 0.8


def test_low_support_slows_the_feed_and_is_said(skill, measurements):
    dut, context, action = controller(skill, measurements[0])
    whole = step(dut, context)["feed_speed"]
    skill = Answering(skill, replace(action, support=0.25))
    dut, context, _ = controller(skill, measurements[0])
    assert dut.GetOutputPort("support").Eval(context)[0] == 1.0
    assert step(dut, context)["feed_speed"] == pytest.approx(0.25 * whole)
    assert dut.GetOutputPort("support").Eval(context)[0] == 0.25


@pytest.mark.parametrize(
    ("answer", "says"),
    [
        (ArithmeticError("beyond\nme"), "ArithmeticError: beyond"),
        (Action(turn=np.array([math.nan, 0.0]), feed=0.0, probabilities=np.ones(1)), "ValueError: the action is not"),
        (Action(turn=np.zeros(2), feed=-math.inf, probabilities=np.ones(1)), "ValueError: the action is not finite"),
    ],
)
def test_a_skill_that_fails_is_not_asked_again(skill, measurements, answer, says):
    sound = skill.act(measurements[0])
    answering = Answering(skill, sound)
    dut, context, _ = controller(answering, measurements[0])
    before = step(dut, context)
    assert (dut.GetOutputPort("failed").Eval(context)[0], dut.failure(context)) == (0.0, "")
    answering.answer = answer
    after = step(dut, context)
    assert after == {**before, "feed_speed": 0.0}
    assert dut.GetOutputPort("failed").Eval(context)[0] == 1.0
    assert dut.failure(context).startswith(says)
    answering.answer = sound
    assert step(dut, context, times=3) == after


def test_the_turns_that_wedged_the_peg_are_unwound_when_it_cannot_be_drawn_back(skill, measurements):
    turning = Answering(skill, Action(turn=np.array([1e-3, -2e-3]), feed=-1e-5, probabilities=np.ones(skill.n_states)))
    guarded = ControllerParameters(gain=1.0, max_turn_rate=0.5, soft_force=5.0, hold_force=20.0, force_limit=30.0)
    easy, wedged = np.zeros(7), np.zeros(7)
    wedged[:3] = [0.0, 0.0, 31.0]
    dut, context, _ = controller(turning, easy, guarded)
    at_ease = step(dut, context, guarded, times=4)
    step(dut, context, guarded)  # the load is still light when this turn is decided
    wrench = dut.GetInputPort("wrench")
    wrench.FixValue(context, [6.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    further = step(dut, context, guarded, times=8)
    assert abs(further["target_yaw"]) > abs(at_ease["target_yaw"])
    wrench.FixValue(context, wedged[:6])
    periods = round(0.5 * guarded.back_off_time / guarded.period)
    held = step(dut, context, guarded, times=periods)
    assert (held["guard"], held["target_yaw"]) == (1.0, further["target_yaw"])
    undone = step(dut, context, guarded, times=periods - 2)
    assert undone["target_pitch"] == pytest.approx(at_ease["target_pitch"])
    assert undone["target_yaw"] == pytest.approx(at_ease["target_yaw"])
