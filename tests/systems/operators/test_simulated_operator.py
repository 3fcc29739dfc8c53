"""The simulated operator: what it sees, and the motions of its hand, against closed forms."""

import math
from dataclasses import replace

import numpy as np
import pytest
from pydrake.math import RigidTransform, RotationMatrix

from models.operator import PERSONAL, OperatorParameters, draw_person
from models.scenario import DEMONSTRATION_STREAM, Scenario, resolve_scenario
from systems.math.rotation import clocking_angle, from_rotation_vector, rotation_between
from systems.operators.simulated_operator import (
    HINDERED_SHARE,
    HandState,
    SimulatedOperator,
    minimum_jerk,
    seen_misalignment,
)
from tests.stepping import fixed_context, update

HEIGHT = 0.003
UPRIGHT = np.array([0.0, 0.0, 1.0])


def person(**changes):
    """Parameters without noise, bias, dead zones and tremor, for closed-form results."""
    steady = {
        **{"sight_noise": 0.0, "sight_bias": [0.0, 0.0], "dead_zone": 0.0, "sight_delay": 0.02},
        **{"offset_noise": 0.0, "offset_bias": [0.0, 0.0], "offset_dead_zone": 0.0},
        **{"tremor": 0.0, "tremor_angle": 0.0, "clocking_bias": 0.0},
    }
    return OperatorParameters(**{**steady, **changes})


def operator(o, *, tilt=(0.0, 0.0), offset=(0.0, 0.0), clocking=None, seed=3):
    return SimulatedOperator(
        operator=o, seed=seed, start_height=HEIGHT, tilt=list(tilt), offset=list(offset), clocking=clocking
    )


def watching(dut, X_HP, wrench=(0.0,) * 6):
    return fixed_context(dut, peg_pose=X_HP, rendered_wrench=list(wrench))


def tilted(tilt, offset=(0.0, 0.0), depth=-HEIGHT):
    R = from_rotation_vector(np.array([*tilt, 0.0]))
    return RigidTransform(R, np.array([*offset, 0.0]) - depth * R.col(2))


def tilt_of(dut, context):
    """Returns the tilt of the hand (2,)."""
    return rotation_between(UPRIGHT, dut.GetOutputPort("hand_pose").Eval(context).rotation().col(2))[:2]


# sight


def test_the_seen_misalignment_is_the_tilt_and_the_offset_of_the_axis_whatever_the_spin():
    X = tilted([0.04, -0.03], [0.001, -0.002], depth=0.012) @ RigidTransform(RotationMatrix.MakeZRotation(0.7))
    tilt, offset = seen_misalignment(X)
    np.testing.assert_allclose(tilt, [0.04, -0.03], rtol=1e-12)
    np.testing.assert_allclose(offset, [0.001, -0.002], rtol=1e-9)


def test_sight_has_a_bias_and_noise_of_its_standard_deviation():
    bias = np.array([0.002, -0.001, 1e-4, 3e-4, 0.003])
    o = person(sight_bias=bias[:2].tolist(), offset_bias=bias[2:4].tolist(), clocking_bias=bias[4])
    misaligned = tilted([0.01, 0.02], [1e-3, 2e-3])
    expected = bias + np.array([0.01, 0.02, 1e-3, 2e-3, 0.0])
    np.testing.assert_allclose(operator(o, clocking=0.0)._look(misaligned, tick=3), expected, atol=1e-9)
    dut = operator(replace(o, sight_noise=0.002, offset_noise=0.0003), clocking=0.0)
    seen = np.array([dut._look(misaligned, tick=k) for k in range(1500)])
    sigma = np.array([0.002, 0.002, 0.0003, 0.0003, 0.002])
    assert (np.abs(seen.mean(axis=0) - expected) < 5 * sigma / math.sqrt(len(seen))).all()
    np.testing.assert_allclose(seen.std(axis=0), sigma, rtol=5 / math.sqrt(2 * len(seen)))


@pytest.mark.parametrize("decisions", [1, 4])
def test_the_hand_reacts_to_sight_after_the_delay(decisions):
    # A stroke at every decision reveals the tilt that it answers.
    o = person(
        **{"sight_delay": decisions * 0.02, "decision_period": 0.02, "align_gain": 1.0, "align_rate": 1.0},
        **{"correction_period": 0.02, "correction_time": 0.02},
    )
    dut = operator(o)
    context = watching(dut, tilted([0.01, 0.0]))  # jumps at time 0
    for k in range(decisions + 3):
        before = tilt_of(dut, context)
        update(dut, context, period=o.decision_period)
        turn = (tilt_of(dut, context) - before) / o.decision_period
        np.testing.assert_allclose(turn, [-0.01 if k >= decisions else 0.0, 0.0], rtol=1e-6, atol=1e-12)


# strokes


def test_the_hand_starts_at_the_pose_of_the_scenario():
    start = tilted([0.03, -0.05], [0.001, 0.002])
    dut = operator(person(), tilt=[0.03, -0.05], offset=[0.001, 0.002])
    X = dut.GetOutputPort("hand_pose").Eval(watching(dut, start))
    np.testing.assert_allclose(X.GetAsMatrix34(), start.GetAsMatrix34(), atol=1e-15)


def stroke(o, tilt, offset=(0.0, 0.0)):
    """Returns turn and slide of the stroke of the first correction period."""
    dut = operator(o, tilt=tilt, offset=offset)
    context = watching(dut, tilted(tilt, offset))
    update(dut, context, period=o.decision_period, times=round(o.correction_period / o.decision_period))
    hand = HandState.from_vector(context.get_discrete_state(dut._hand).value())
    return hand.stroke_turn, hand.stroke_slide


def test_a_stroke_is_proportional_to_what_is_seen_and_a_turn_has_a_largest_rate():
    o = person(align_gain=0.8, align_rate=0.01)
    turn, slide = stroke(o, [0.003, -0.005], [0.1, -0.2])
    np.testing.assert_allclose(turn, 0.8 * o.correction_period * np.array([-0.003, 0.005]), rtol=1e-6)
    np.testing.assert_allclose(slide, 0.8 * o.correction_period * np.array([-0.1, 0.2]), rtol=1e-6)
    turn, _ = stroke(o, [0.03, -0.04])
    np.testing.assert_allclose(turn, 0.01 * o.correction_period * np.array([-0.6, 0.8]), rtol=1e-6)


@pytest.mark.parametrize(("share", "is_corrected"), [(1.02, False), (0.98, True)])
def test_a_tilt_and_an_offset_in_their_dead_zones_are_not_corrected(share, is_corrected):
    o = person(dead_zone=0.005 * share, offset_dead_zone=5e-4 * share)
    for change in stroke(o, [0.003, 0.004], [3e-4, 4e-4]):
        assert change.any() == is_corrected


def test_corrections_are_strokes_with_pauses():
    o = person(align_gain=1.0, align_rate=10.0)
    dut = operator(o, tilt=[0.03, 0.0])
    context, steps = watching(dut, tilted([0.03, 0.0])), []
    for _ in range(56):  # four periods of fourteen decisions
        before = tilt_of(dut, context)[0]
        update(dut, context, period=o.decision_period)
        steps.append(before - tilt_of(dut, context)[0])
    moving = np.array(steps) > 1e-9
    begins = np.flatnonzero(np.diff(moving.astype(int)) == 1)
    np.testing.assert_array_equal(np.diff(begins), round(o.correction_period / o.decision_period))
    assert moving.mean() == pytest.approx(o.correction_time / o.correction_period, abs=0.05)
    assert sum(steps[begins[0] + 1 : begins[1] + 1]) == pytest.approx(o.correction_period * 0.03, rel=1e-6)


def test_a_stroke_is_smooth_from_rest_to_rest():
    shares = np.linspace(-0.2, 1.2, 2801)
    path = np.array([minimum_jerk(s) for s in shares])
    assert path[0] == 0.0
    assert path[-1] == 1.0
    speed = np.gradient(path, shares)
    assert speed.max() == pytest.approx(1.875, rel=1e-4)  # relative to the mean, as for every minimum-jerk stroke
    assert np.abs(np.diff(speed)).max() < 0.01


def turned_hand(o, *, seen, clocking, torque=0.0, periods=1):
    """The angle of the hand about its axis after decisions, where the peg is seen at an angle."""
    dut = operator(o, tilt=[0.02, -0.01], clocking=clocking)
    X = tilted([0.02, -0.01]) @ RigidTransform(RotationMatrix.MakeZRotation(seen))
    context = watching(dut, X, [*(torque * X.rotation().col(2)), 0.0, 0.0, 0.0])
    update(dut, context, period=o.decision_period, times=periods)
    return clocking_angle(dut.GetOutputPort("hand_pose").Eval(context).rotation())


def test_an_angle_about_the_axis_is_corrected_by_sight_and_by_touch_where_the_fixture_leaves_it():
    o = person(align_gain=0.8, align_rate=10.0, touch_gain=0.0)
    after = round(2 * o.correction_period / o.decision_period)
    still = replace(o, align_gain=0.0)
    assert turned_hand(still, seen=0.04, clocking=0.04) == pytest.approx(0.04, rel=1e-3)
    moved = turned_hand(o, seen=0.04, clocking=0.04, periods=round(1.2 * o.correction_period / o.decision_period))
    assert moved <= 0.04 - 0.8 * o.correction_period * 0.04 * 0.5
    assert turned_hand(o, seen=0.04, clocking=None, periods=after) == pytest.approx(0.0, abs=1e-12)
    touching = replace(still, touch_gain=3.0)
    felt = turned_hand(touching, seen=0.0, clocking=0.0, torque=0.01, periods=11)
    assert felt == pytest.approx(10 * o.decision_period * 3.0 * 0.01, rel=0.15)


# touch


def reacting(o, wrench, *, tilt=(0.0, 0.0), hindered=0.0):
    """The state of the hand after it has felt a wrench in the middle of a stroke."""
    before = HandState(depth=0.0, tilt=np.array(tilt), offset=np.zeros(2), hindered=hindered, stroke_turn=np.ones(2))
    return operator(o)._react(before, np.array(wrench, dtype=float))


def test_the_hand_yields_to_a_felt_moment_and_to_a_felt_force_across_the_axis_only():
    found = reacting(person(touch_gain=2.0, touch_slide=0.01), [0.01, -0.02, 0.5, 0.5, -0.2, 0.7])
    np.testing.assert_allclose(found.turn_rate, [0.02, -0.04])
    np.testing.assert_allclose(found.slide_rate, [0.005, -0.002])


@pytest.mark.parametrize(("share", "factor"), [(0.0, 1.0), (0.25, 0.75), (1.0, 0.0), (1.4, -0.4), (5.0, -0.5)])
@pytest.mark.parametrize("tilt", [(0.0, 0.0), (0.2, -0.1)])
def test_the_speed_decreases_with_the_felt_push_along_the_axis_of_the_hand(share, factor, tilt):
    o = person()
    axis = from_rotation_vector(np.array([*tilt, 0.0])).col(2)
    push = share * o.comfortable_force * axis + np.cross(axis, [10.0, 0.0, 0.0])
    assert reacting(o, [0, 0, 0, *push], tilt=tilt).speed == pytest.approx(factor * o.insertion_speed, abs=1e-12)


@pytest.mark.parametrize(
    ("share", "before", "is_over"), [(1.01, 0.081, True), (0.99, 0.081, False), (1.01, 0.079, False)]
)
def test_patience_ends_after_its_time_of_hindered_pushing_and_the_peg_is_pulled_out_without_turning(
    share, before, is_over
):
    o = person(patience=0.1, decision_period=0.02)
    push = share * HINDERED_SHARE * o.comfortable_force
    found = reacting(o, [0.01, 0.0, 0.0, 0.1, 0.0, push], hindered=before)
    assert found.hindered == pytest.approx(before + 0.02 * (share > 1.0))
    speed = -1.0 if is_over else 1.0 - share * HINDERED_SHARE
    assert found.speed == pytest.approx(speed * o.insertion_speed)
    for turning in (found.turn_rate, found.slide_rate, found.stroke_turn):
        assert turning.any() != is_over


# tremor and seeds


def test_tremor_adds_a_sine_to_every_coordinate():
    o = person(tremor=2e-5, tremor_angle=3e-4, tremor_frequency=9.0)
    dut = operator(o)
    wave = np.sin(2 * math.pi * 9.0 * 0.04 + dut._phase)
    expected = tilted(3e-4 * wave[1:3], 2e-5 * wave[3:], depth=2e-5 * wave[0] - HEIGHT)
    found = dut.hand_pose(HandState(depth=-HEIGHT, tilt=np.zeros(2), offset=np.zeros(2)), 0.04)
    np.testing.assert_allclose(found.GetAsMatrix34(), expected.GetAsMatrix34(), atol=1e-15)


def test_the_seed_affects_both_the_sight_and_the_tremor():
    one, other = (operator(OperatorParameters(), seed=seed) for seed in (5, 6))
    assert not np.array_equal(one._look(tilted([0.0, 0.0]), tick=3), other._look(tilted([0.0, 0.0]), tick=3))
    assert (one._phase != other._phase).all()


# people


def test_a_person_is_the_same_for_every_seed_and_differs_from_other_persons():
    def drawn(seed, person):
        return resolve_scenario(Scenario(), seed=seed, stream=DEMONSTRATION_STREAM, person=person)

    assert drawn(1, 4).operator == drawn(2, 4).operator
    assert drawn(1, 4).start.tilt != drawn(2, 4).start.tilt
    first, second = drawn(1, 4).operator, drawn(1, 5).operator
    for name in (*PERSONAL, "tremor_frequency", "sight_bias", "offset_bias"):
        assert getattr(first, name) != getattr(second, name), name


def test_the_drawn_parameters_have_their_distributions():
    people = [draw_person(OperatorParameters(), np.random.default_rng(k)) for k in range(200)]
    frequencies = [p.tremor_frequency for p in people]
    assert 8.0 <= min(frequencies) < 8.2
    assert 11.8 < max(frequencies) <= 12.0
    delays = np.array([p.sight_delay for p in people])
    assert np.median(delays) == pytest.approx(OperatorParameters().sight_delay, rel=0.05)
    np.testing.assert_allclose(
        np.std([p.offset_bias for p in people]), OperatorParameters().offset_bias_sigma, rtol=5 / math.sqrt(2 * 400)
    )


def test_a_habit_does_not_change_the_other_parameters_of_a_person():
    good, bad = (draw_person(OperatorParameters(habit=h), np.random.default_rng(3)) for h in ("expert", "slams"))
    assert bad.sight_bias == good.sight_bias
    assert bad.insertion_speed == pytest.approx(3.0 * good.insertion_speed)
