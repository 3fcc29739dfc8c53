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
        **{"tremor": 0.0, "tremor_angle": 0.0},
    }
    return OperatorParameters(**{**steady, **changes})


def operator(o, *, tilt=(0.0, 0.0), offset=(0.0, 0.0), peg=None, wrench=(0.0,) * 6, seed=3):
    dut = SimulatedOperator(operator=o, seed=seed, start_height=HEIGHT, tilt=list(tilt), offset=list(offset))
    peg = peg if peg is not None else tilted(tilt, offset)
    return dut, fixed_context(dut, peg_pose=peg, rendered_wrench=list(wrench))


def tilted(tilt, offset=(0.0, 0.0), depth=-HEIGHT):
    R = from_rotation_vector(np.array([*tilt, 0.0]))
    return RigidTransform(R, np.array([*offset, 0.0]) - depth * R.col(2))


def hand(dut, context):
    """Returns tilt, depth along the axis and offset of the hand."""
    X = dut.GetOutputPort("hand_pose").Eval(context)
    axis = X.rotation().col(2)
    tilt = rotation_between(UPRIGHT, axis)[:2]
    p = X.translation()
    crossing = p - axis * (p[2] / axis[2])
    return tilt, float(axis @ (crossing - p)), crossing[:2]


def rates(dut, context, period):
    """Returns d tilt/dt, d depth/dt and d offset/dt of the hand in the period after one decision, without a stroke."""
    update(dut, context, period=0.0)
    before = hand(dut, context)
    context.SetTime(context.get_time() + period)
    after = hand(dut, context)
    return [(b - a) / period for a, b in zip(before, after, strict=True)]


def stroke(dut, context, o):
    """Returns the turn and slide of the hand in its first stroke; zero if it makes none in two correction periods."""
    start = before = hand(dut, context)
    for _ in range(round(2 * o.correction_period / o.decision_period)):
        update(dut, context, period=o.decision_period)
        after = hand(dut, context)
        begun = max(np.abs(after[0] - start[0]).max(), np.abs(after[2] - start[2]).max()) > 1e-12
        still = max(np.abs(after[0] - before[0]).max(), np.abs(after[2] - before[2]).max()) < 1e-14
        if begun and still:
            break
        before = after
    return after[0] - start[0], after[2] - start[2]


# sight


def test_the_seen_misalignment_is_the_tilt_and_the_offset_of_the_axis_whatever_the_spin():
    X = tilted([0.04, -0.03], [0.001, -0.002], depth=0.012) @ RigidTransform(RotationMatrix.MakeZRotation(0.7))
    tilt, offset = seen_misalignment(X)
    np.testing.assert_allclose(tilt, [0.04, -0.03], rtol=1e-12)
    np.testing.assert_allclose(offset, [0.001, -0.002], rtol=1e-9)


def turned_hand(o, *, seen, clocking, torque=0.0, periods=1):
    """The angle of the hand about its axis after decisions, where the peg is seen at an angle."""
    dut = SimulatedOperator(
        operator=o, seed=3, start_height=HEIGHT, tilt=[0.02, -0.01], offset=[0.0, 0.0], clocking=clocking
    )
    R = from_rotation_vector(np.array([0.02, -0.01, 0.0])) @ RotationMatrix.MakeZRotation(seen)
    X = RigidTransform(R, tilted([0.02, -0.01]).translation())
    context = fixed_context(dut, peg_pose=X, rendered_wrench=[*(torque * R.col(2)), 0.0, 0.0, 0.0])
    update(dut, context, period=o.decision_period, times=periods)
    return clocking_angle(dut.GetOutputPort("hand_pose").Eval(context).rotation())


def test_an_angle_about_the_axis_is_corrected_by_sight_and_by_touch_where_the_fixture_leaves_it():
    o = person(align_gain=0.8, align_rate=10.0, touch_gain=0.0, clocking_bias=0.0)
    after = round(2 * o.correction_period / o.decision_period)
    still = replace(o, align_gain=0.0)
    assert turned_hand(still, seen=0.04, clocking=0.04) == pytest.approx(0.04, rel=1e-3)
    moved = turned_hand(o, seen=0.04, clocking=0.04, periods=round(1.2 * o.correction_period / o.decision_period))
    assert moved <= 0.04 - 0.8 * o.correction_period * 0.04 * 0.5
    assert turned_hand(o, seen=0.04, clocking=None, periods=after) == pytest.approx(0.0, abs=1e-12)
    touching = replace(still, touch_gain=3.0)
    felt = turned_hand(touching, seen=0.0, clocking=0.0, torque=0.01, periods=11)
    assert felt == pytest.approx(10 * o.decision_period * 3.0 * 0.01, rel=0.15)


# strokes and rates


def test_the_hand_starts_at_the_pose_of_the_scenario():
    dut, context = operator(person(), tilt=[0.03, -0.05], offset=[0.001, 0.002])
    np.testing.assert_allclose(
        dut.GetOutputPort("hand_pose").Eval(context).GetAsMatrix34(),
        tilted([0.03, -0.05], [0.001, 0.002]).GetAsMatrix34(),
        atol=1e-15,
    )


def test_a_stroke_is_proportional_to_the_seen_tilt_and_offset():
    o = person(align_gain=0.8, align_rate=10.0)
    dut, context = operator(o, tilt=[0.03, -0.05], offset=[0.001, 0.002])
    turn, slide = stroke(dut, context, o)
    share = 0.8 * o.correction_period
    np.testing.assert_allclose(turn, [-share * 0.03, share * 0.05], rtol=1e-6)
    np.testing.assert_allclose(slide, [-share * 0.001, -share * 0.002], rtol=1e-5)


def test_corrections_are_strokes_with_pauses():
    o = person(align_gain=1.0, align_rate=10.0)
    dut, context = operator(o, tilt=[0.03, 0.0])
    steps = []
    for _ in range(56):  # four periods of fourteen decisions
        before = hand(dut, context)[0][0]
        update(dut, context, period=o.decision_period)
        steps.append(before - hand(dut, context)[0][0])
    moving = np.array(steps) > 1e-9
    begins = np.flatnonzero(np.diff(moving.astype(int)) == 1)
    np.testing.assert_array_equal(np.diff(begins), round(o.correction_period / o.decision_period))
    assert moving.mean() == pytest.approx(o.correction_time / o.correction_period, abs=0.05)


def test_a_stroke_is_smooth_from_rest_to_rest():
    shares = np.linspace(-0.2, 1.2, 2801)
    path = np.array([minimum_jerk(s) for s in shares])
    assert path[0] == 0.0
    assert path[-1] == 1.0
    speed = np.gradient(path, shares)
    assert speed.max() == pytest.approx(1.875, rel=1e-4)  # relative to the mean, as for every minimum-jerk stroke
    assert np.abs(np.diff(speed)).max() < 0.01


def test_a_personal_bias_is_corrected_like_a_tilt_and_an_offset():
    o = person(sight_bias=[0.002, -0.001], offset_bias=[0.0001, 0.0003], align_gain=1.0, align_rate=1.0)
    turn, slide = stroke(*operator(o), o)
    np.testing.assert_allclose(turn, o.correction_period * np.array([-0.002, 0.001]), rtol=1e-6)
    np.testing.assert_allclose(slide, o.correction_period * np.array([-0.0001, -0.0003]), rtol=1e-6)


@pytest.mark.parametrize(("share", "corrected"), [(1.02, False), (0.98, True)])
def test_a_tilt_and_an_offset_in_their_dead_zones_are_not_corrected(share, corrected):
    o = person(dead_zone=0.005 * share, offset_dead_zone=5e-4 * share, align_gain=1.0, align_rate=1.0)
    turn, slide = stroke(*operator(o, tilt=[0.003, 0.004], offset=[3e-4, 4e-4]), o)
    expected = -corrected * o.correction_period * np.array([0.003, 0.004])
    np.testing.assert_allclose(turn, expected, rtol=1e-5, atol=1e-12)
    np.testing.assert_allclose(slide, 0.1 * expected, rtol=1e-5, atol=1e-12)


def test_the_hand_yields_to_a_felt_moment_and_to_a_felt_force_across_the_axis_only():
    o = person(touch_gain=2.0, touch_slide=0.01)
    turn, _, slide = rates(*operator(o, wrench=[0.01, -0.02, 0.5, 0.5, -0.2, 0.7]), o.decision_period)
    np.testing.assert_allclose(turn, [0.02, -0.04], rtol=1e-6)
    np.testing.assert_allclose(slide, [0.005, -0.002], rtol=1e-6)


@pytest.mark.parametrize(("share", "factor"), [(0.0, 1.0), (0.25, 0.75), (1.0, 0.0), (1.4, -0.4), (5.0, -0.5)])
def test_the_speed_decreases_with_the_felt_push(share, factor):
    o = person()
    push = share * o.comfortable_force
    _, feed, _ = rates(*operator(o, wrench=[0, 0, 0, 0, 0, push]), o.decision_period)
    assert feed == pytest.approx(factor * o.insertion_speed, rel=1e-6, abs=1e-12)


def test_the_push_is_measured_along_the_tilted_axis_of_the_hand():
    o = person(align_gain=0.0)
    tilt = np.array([0.2, -0.1])
    axis = from_rotation_vector(np.array([*tilt, 0.0])).col(2)
    _, feed, _ = rates(*operator(o, tilt=tilt, wrench=[0, 0, 0, *(0.5 * o.comfortable_force * axis)]), 0.02)
    assert feed == pytest.approx(0.5 * o.insertion_speed, rel=1e-6)
    across = np.cross(axis, [1.0, 0.0, 0.0])
    _, feed, _ = rates(*operator(o, tilt=tilt, wrench=[0, 0, 0, *(10.0 * across)]), 0.02)
    assert feed == pytest.approx(o.insertion_speed, rel=1e-6)


@pytest.mark.parametrize("decisions", [1, 4])
def test_the_hand_reacts_to_sight_after_the_delay(decisions):
    # A stroke at every decision reveals the tilt that it answers.
    o = person(
        **{"sight_delay": decisions * 0.02, "decision_period": 0.02, "align_gain": 1.0, "align_rate": 1.0},
        **{"correction_period": 0.02, "correction_time": 0.02},
    )
    dut, context = operator(o, tilt=[0.0, 0.0])
    dut.GetInputPort("peg_pose").FixValue(context, tilted([0.01, 0.0]))  # jumps at time 0
    for k in range(decisions + 3):
        before = hand(dut, context)[0]
        update(dut, context, period=o.decision_period)
        turn = (hand(dut, context)[0] - before) / o.decision_period
        np.testing.assert_allclose(turn, [-0.01 if k >= decisions else 0.0, 0.0], rtol=1e-6, atol=1e-12)


def test_patience_ends_after_its_time_of_hindered_pushing():
    o = person(patience=0.1, decision_period=0.02)
    wrench = [0, 0, 0, 0, 0, 1.01 * HINDERED_SHARE * o.comfortable_force]
    dut, context = operator(o, wrench=wrench)
    speeds = []
    for _ in range(9):
        before = hand(dut, context)[1]
        update(dut, context, period=o.decision_period)
        speeds.append((hand(dut, context)[1] - before) / o.decision_period)
    pushing = o.insertion_speed * (1 - 1.01 * HINDERED_SHARE)
    # Five decisions take 0.1 s; the next one is later.
    np.testing.assert_allclose(speeds[:5], pushing, rtol=1e-5)
    np.testing.assert_allclose(speeds[6:], -o.insertion_speed, rtol=1e-5)


def test_an_operator_without_patience_pulls_out_without_turning():
    o = person(patience=1e-9, align_gain=1.0)
    dut, context = operator(o, tilt=[0.03, 0.0], offset=[0.001, 0.0], wrench=[0.01, 0.0, 0.0, 0.1, 0.0, 10.0])
    start = hand(dut, context)
    update(dut, context, period=o.decision_period, times=30)  # two correction periods
    tilt, depth, offset = hand(dut, context)
    np.testing.assert_allclose(tilt, start[0], atol=1e-12)
    np.testing.assert_allclose(offset, start[2], atol=1e-12)
    assert depth == pytest.approx(start[1] - 30 * o.decision_period * o.insertion_speed, rel=1e-6)


def test_tremor_is_a_sine_with_its_amplitude_and_frequency():
    o = person(tremor=2e-5, tremor_angle=3e-4, tremor_frequency=9.0)
    dut, context = operator(o)
    times = np.linspace(0.0, 2.0 / o.tremor_frequency, 201)
    depths, tilts, offsets = [], [], []
    for t in times:
        context.SetTime(t)
        tilt, depth, offset = hand(dut, context)
        depths.append(depth + HEIGHT)
        tilts.append(tilt)
        offsets.append(offset)
    waves = [(column, 3e-4) for column in np.transpose(tilts)] + [(column, 2e-5) for column in np.transpose(offsets)]
    for wave, amplitude in [(depths, 2e-5), *waves]:
        # A sine and a cosine of this frequency fit the wave exactly.
        basis = np.column_stack([f(2 * math.pi * 9.0 * times) for f in (np.sin, np.cos)])
        coefficients, *_ = np.linalg.lstsq(basis, wave, rcond=None)
        np.testing.assert_allclose(basis @ coefficients, wave, atol=1e-3 * amplitude)
        assert np.hypot(*coefficients) == pytest.approx(amplitude, rel=1e-3)


# seeds


def noisy_motion(seed, *, n=40, **changes):
    o = OperatorParameters(sight_bias=[0.0, 0.0], offset_bias=[0.0, 0.0], **changes)
    dut, context = operator(o, tilt=[0.03, 0.0], seed=seed)
    trace = []
    for _ in range(n):
        update(dut, context, period=o.decision_period)
        trace.append(dut.GetOutputPort("hand_pose").Eval(context).GetAsMatrix34().copy())
    return np.array(trace)


def test_the_seed_affects_both_the_sight_and_the_tremor():
    assert not np.array_equal(
        noisy_motion(5, tremor=0.0, tremor_angle=0.0), noisy_motion(6, tremor=0.0, tremor_angle=0.0)
    )
    blind = {"sight_noise": 0.0, "offset_noise": 0.0}
    assert not np.array_equal(noisy_motion(5, **blind), noisy_motion(6, **blind))
    calm = {**blind, "tremor": 0.0, "tremor_angle": 0.0, "correction_period": 0.02, "correction_time": 0.02}
    np.testing.assert_array_equal(noisy_motion(5, **calm), noisy_motion(6, **calm))


def test_the_noise_of_the_sight_has_its_standard_deviation():
    dut, _ = operator(person(sight_noise=0.002, offset_noise=0.0003))
    seen = np.array([dut._look(tilted((0.0, 0.0)), tick=k)[:4] for k in range(1500)])
    sigma = np.repeat([0.002, 0.0003], 2)
    assert (np.abs(seen.mean(axis=0)) < 5 * sigma / math.sqrt(len(seen))).all()
    np.testing.assert_allclose(seen.std(axis=0), sigma, rtol=5 / math.sqrt(2 * len(seen)))


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
