import pytest
from hypothesis import given
from hypothesis import strategies as st

from models.scenario import ForceGuardParameters
from systems.control.force_guard import GuardMode, GuardState, guard_step

P = ForceGuardParameters()
FEED = -0.01


def step(state, *, load=0.0, depth=0.0, known=True, support=1.0, feed=FEED):
    return guard_step(P, state, period=0.02, feed_speed=feed, load=load, depth=depth, known=known, support=support)


def test_without_load_the_feed_is_not_changed():
    decision = step(GuardState())
    assert (decision.feed_speed, decision.turning, decision.state.mode) == (FEED, True, GuardMode.WORKING)


def test_the_feed_falls_to_zero_between_soft_force_and_hold_force():
    middle = 0.5 * (P.soft_force + P.hold_force)
    assert step(GuardState(), load=P.soft_force).feed_speed == pytest.approx(FEED)
    assert step(GuardState(), load=middle).feed_speed == pytest.approx(0.5 * FEED)
    assert step(GuardState(), load=P.hold_force).feed_speed == pytest.approx(0.0)


def test_an_unknown_state_halves_the_feed():
    assert P.unknown_feed == 0.5
    assert step(GuardState(), known=False).feed_speed == pytest.approx(0.5 * FEED)


@pytest.mark.parametrize("support", [0.0, 0.3, 1.0])
def test_the_feed_is_proportional_to_the_support(support):
    assert step(GuardState(), support=support).feed_speed == pytest.approx(support * FEED)
    assert step(GuardState(), support=support, known=False).feed_speed == pytest.approx(0.5 * support * FEED)
    assert step(GuardState(), support=support, feed=0.01).feed_speed == 0.01


@pytest.mark.parametrize("unrecognised", [{"known": False}, {"support": 0.9}])
def test_unrecognised_measurements_cause_a_back_off_after_the_doubt_time(unrecognised):
    state, depth, time = GuardState(anchor=0.005), 0.005, 0.0
    while state.mode == GuardMode.WORKING:
        depth += P.stall_depth  # the peg does move deeper
        state, time = step(state, depth=depth, **unrecognised).state, time + 0.02
        assert time < 3.0
    assert time == pytest.approx(P.doubt_time, abs=0.041)
    decision = step(state, depth=depth - 1.1 * P.back_off_distance, **unrecognised)
    assert decision.state.mode == GuardMode.WORKING
    assert decision.state.doubt == pytest.approx(0.02)  # restarted
    assert decision.feed_speed < 0


def test_one_recognised_measurement_resets_the_doubt():
    state = GuardState()
    for k in range(200):  # recognised once in 0.8 s
        state = step(state, depth=k * P.stall_depth, known=k % 40 == 0).state
        assert state.mode == GuardMode.WORKING
    assert step(GuardState(doubt=0.9), known=True, support=1.0).state.doubt == 0.0


def test_a_feed_out_of_the_hole_is_not_reduced():
    assert step(GuardState(), load=0.99 * P.force_limit, known=False, feed=0.01).feed_speed == 0.01


def test_above_the_force_limit_the_peg_is_backed_off_by_the_distance_and_then_fed_again():
    depth = 0.005
    decision = step(GuardState(anchor=depth), load=P.force_limit + 0.1, depth=depth)
    assert decision.state == GuardState(GuardMode.BACKING_OFF, anchor=depth)
    while decision.state.mode == GuardMode.BACKING_OFF:
        assert decision.feed_speed == P.retract_speed
        assert not decision.turning
        depth -= P.retract_speed * 0.02
        decision = step(decision.state, depth=depth)
    assert 0.005 - depth == pytest.approx(P.back_off_distance, abs=P.retract_speed * 0.02)
    assert decision.feed_speed == FEED


def test_the_back_off_of_a_peg_that_does_not_move_ends_after_the_back_off_time():
    state, periods = GuardState(GuardMode.BACKING_OFF, anchor=0.005), 0
    while state.mode == GuardMode.BACKING_OFF:
        state, periods = step(state, depth=0.005).state, periods + 1
    assert 0.02 * (periods - 1) == pytest.approx(P.back_off_time, abs=0.021)


def test_pushing_without_progress_causes_a_back_off_after_the_stall_time():
    state, time = GuardState(anchor=0.005), 0.0
    while state.mode == GuardMode.WORKING:
        state, time = step(state, depth=0.005, load=5.0).state, time + 0.02
        assert time < 2.0
    assert time == pytest.approx(P.stall_time, abs=0.041)


def test_slow_progress_causes_no_back_off():
    state, depth = GuardState(anchor=0.005), 0.005
    for _ in range(500):
        depth += 1.2 * P.stall_depth * 0.02 / P.stall_time
        state = step(state, depth=depth).state
        assert state.mode == GuardMode.WORKING


@given(
    load=st.floats(0, 500),
    depth=st.floats(-0.01, 0.03),
    elapsed=st.floats(0, 5),
    anchor=st.floats(-1, 0.03),
    mode=st.sampled_from([GuardMode.WORKING, GuardMode.BACKING_OFF]),
    known=st.booleans(),
    support=st.floats(0, 1),
    doubt=st.floats(0, 2),
    feed=st.floats(-0.05, 0.05),
)
def test_the_feed_is_never_faster_than_requested_and_never_inward_above_the_force_limit(
    load, depth, elapsed, anchor, mode, known, support, doubt, feed
):
    state = GuardState(mode, elapsed, anchor, doubt)
    decision = step(state, load=load, depth=depth, known=known, support=support, feed=feed)
    assert decision.feed_speed >= min(feed, 0.0)
    if load > P.force_limit:
        assert decision.feed_speed >= 0.0


def test_turns_are_unwound_in_the_second_half_of_a_back_off_without_motion():
    depth = 0.005
    state = step(GuardState(anchor=depth), load=P.force_limit + 1.0, depth=depth).state
    observed = []
    while state.mode == GuardMode.BACKING_OFF:
        decision = step(state, load=P.force_limit + 1.0, depth=depth)
        observed.append((state.elapsed, decision.unwinding))
        if state.elapsed >= P.back_off_time:
            break
        state = decision.state
    half = 0.5 * P.back_off_time
    assert {unwinding for elapsed, unwinding in observed[:-1] if elapsed < half - 0.01} == {False}
    assert {unwinding for elapsed, unwinding in observed[:-1] if elapsed > half + 0.01} == {True}
    risen = GuardState(GuardMode.BACKING_OFF, elapsed=0.6 * P.back_off_time, anchor=depth)
    assert not step(risen, depth=depth - 1.1 * P.stall_depth).unwinding


def test_moving_out_is_no_progress():
    """Progress is a gain in depth, not a change of depth."""
    stalled = GuardState(elapsed=0.5 * P.stall_time, anchor=0.005)
    state = step(stalled, depth=stalled.anchor - 1.1 * P.stall_depth).state
    assert state.anchor == stalled.anchor
    assert state.elapsed == pytest.approx(stalled.elapsed + 0.02)
    moved_in = step(stalled, depth=stalled.anchor + 1.1 * P.stall_depth).state
    assert (moved_in.anchor, moved_in.elapsed) == (stalled.anchor + 1.1 * P.stall_depth, 0.0)


def test_a_peg_that_is_pushed_deeper_has_not_backed_off():
    """The back-off distance counts upwards only."""
    backing_off = GuardState(GuardMode.BACKING_OFF, elapsed=0.02, anchor=0.005)
    decision = step(backing_off, depth=backing_off.anchor + 1.1 * P.back_off_distance)
    assert decision.state.mode is GuardMode.BACKING_OFF
    assert decision.feed_speed == P.retract_speed


def test_a_state_survives_its_list_of_numbers():
    state = GuardState(GuardMode.BACKING_OFF, elapsed=0.1, anchor=0.005, doubt=0.3)
    assert state.as_list() == [1.0, 0.1, 0.005, 0.3]
    assert GuardState.from_list(state.as_list()) == state
    assert GuardState.from_list(state.as_list()).mode is GuardMode.BACKING_OFF


def test_a_load_at_the_limit_causes_no_back_off():
    assert step(GuardState(), load=P.force_limit).state.mode is GuardMode.WORKING
    assert step(GuardState(), load=1.001 * P.force_limit).state.mode is GuardMode.BACKING_OFF


def test_the_first_measurement_counts_as_progress_at_any_depth():
    """The guard starts with an anchor 1 m above the mouth, so that the time since progress begins with the run."""
    assert GuardState().as_list() == [0.0, 0.0, -1.0, 0.0]
    state = step(GuardState(), depth=-0.05).state
    assert (state.anchor, state.elapsed) == (-0.05, 0.0)
