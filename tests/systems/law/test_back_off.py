import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from models.control import BackOffParameters
from systems.law.back_off import BackOffMode, BackOffNumbers, BackOffState, back_off_step
from systems.law.turn_reversal import TurnWatch

P = BackOffNumbers(*vars(BackOffParameters()).values())
FEED = -0.01


CALM = {
    "overloaded": False,
    "depth": 0.0,
    "known": True,
    "support": 1.0,
    "contact_state": 0.0,
    "pitch": 0.0,
    "yaw": 0.0,
    "side": 0.0,
}


def step(state, *, feed=FEED, **measured):
    # One type of each number, for which the step is compiled once.
    floats = BackOffState(*map(float, state[:-1]), TurnWatch(*map(float, state.watch)))
    return back_off_step(P, floats, period=0.02, feed_speed=feed, **{**CALM, **measured})


def test_without_load_the_feed_is_not_changed():
    decision = step(BackOffState())
    assert (decision.feed_speed, decision.turning, decision.state.mode) == (FEED, 1.0, BackOffMode.WORKING)


@pytest.mark.parametrize("support", [0.0, 0.3, 1.0])
def test_the_feed_is_proportional_to_the_support(support):
    assert step(BackOffState(), support=support).feed_speed == pytest.approx(support * FEED)
    assert step(BackOffState(), support=support, known=False).feed_speed == pytest.approx(0.5 * support * FEED)
    assert step(BackOffState(), support=support, feed=0.01).feed_speed == 0.01


@pytest.mark.parametrize("unrecognised", [{"known": False}, {"support": 0.9}])
def test_unrecognised_measurements_cause_a_back_off_after_the_doubt_time(unrecognised):
    doubtful = BackOffState(anchor=-1.0, doubt=P.doubt_time - 0.021)  # the peg does move deeper
    decision = step(doubtful, **unrecognised)
    assert (decision.state.mode, decision.state.doubt) == (BackOffMode.WORKING, pytest.approx(P.doubt_time - 0.001))
    decision = step(decision.state, depth=0.005, **unrecognised)
    assert (decision.state.mode, decision.state.doubt) == (BackOffMode.BACKING_OFF, 0.0)
    decision = step(decision.state, depth=0.005 - 1.1 * P.distance, **unrecognised)
    assert (decision.state.mode, decision.state.doubt) == (BackOffMode.WORKING, 0.02)  # restarted
    assert decision.feed_speed < 0


def test_one_recognised_measurement_resets_the_doubt():
    assert step(BackOffState(doubt=0.9), known=True, support=1.0).state.doubt == 0.0


def test_above_the_force_limit_the_peg_is_backed_off_by_the_distance_and_then_fed_again():
    depth = 0.005
    decision = step(BackOffState(anchor=depth), overloaded=True, depth=depth)
    assert decision.state == BackOffState(BackOffMode.BACKING_OFF, anchor=depth, best=depth, contact_state=0.0)
    while decision.state.mode == BackOffMode.BACKING_OFF:
        assert decision.feed_speed == P.retract_speed
        assert not decision.turning
        depth -= P.retract_speed * 0.02
        decision = step(decision.state, depth=depth)
    assert 0.005 - depth == pytest.approx(P.distance, abs=P.retract_speed * 0.02)
    assert decision.feed_speed == FEED


def test_the_back_off_of_a_peg_that_does_not_move_ends_after_the_back_off_time():
    for elapsed, mode in ((P.time - 1e-6, BackOffMode.BACKING_OFF), (P.time, BackOffMode.WORKING)):
        assert step(BackOffState(BackOffMode.BACKING_OFF, elapsed, 0.005), depth=0.005).state.mode == mode


def test_pushing_without_progress_causes_a_back_off_after_the_stall_time():
    for left, mode in ((0.021, BackOffMode.WORKING), (0.019, BackOffMode.BACKING_OFF)):
        stalled = BackOffState(anchor=0.005, elapsed=P.stall_time - left)
        assert step(stalled, depth=0.005).state.mode == mode


@given(
    overloaded=st.booleans(),
    depth=st.floats(-0.01, 0.03),
    elapsed=st.floats(0, 5),
    anchor=st.floats(-1, 0.03),
    mode=st.sampled_from([BackOffMode.WORKING, BackOffMode.BACKING_OFF]),
    known=st.booleans(),
    support=st.floats(0, 1),
    doubt=st.floats(0, 2),
    feed=st.floats(-0.05, 0.05),
)
def test_the_feed_is_never_faster_than_requested_and_never_inward_above_the_force_limit(
    overloaded, depth, elapsed, anchor, mode, known, support, doubt, feed
):
    state = BackOffState(mode, elapsed, anchor, doubt)
    decision = step(state, overloaded=overloaded, depth=depth, known=known, support=support, feed=feed)
    assert decision.feed_speed >= min(feed, 0.0)
    if overloaded:
        assert decision.feed_speed >= 0.0


@pytest.mark.parametrize(
    ("share", "risen", "unwinding"), [(0.49, 0.0, False), (0.51, 0.0, True), (0.51, 0.9, True), (0.6, 1.1, False)]
)
def test_turns_are_unwound_in_the_second_half_of_a_back_off_without_motion(share, risen, unwinding):
    state = BackOffState(BackOffMode.BACKING_OFF, elapsed=share * P.time, anchor=0.005)
    assert step(state, depth=0.005 - risen * P.stall_depth).unwinding == unwinding


def test_moving_out_is_no_progress():
    """Progress is a gain in depth, not a change of depth."""
    stalled = BackOffState(elapsed=0.5 * P.stall_time, anchor=0.005)
    state = step(stalled, depth=stalled.anchor - 1.1 * P.stall_depth).state
    assert state.anchor == stalled.anchor
    assert state.elapsed == pytest.approx(stalled.elapsed + 0.02)
    moved_in = step(stalled, depth=stalled.anchor + 1.1 * P.stall_depth).state
    assert (moved_in.anchor, moved_in.elapsed) == (stalled.anchor + 1.1 * P.stall_depth, 0.0)


def test_a_peg_that_is_pushed_deeper_has_not_backed_off():
    """The back-off distance counts upwards only."""
    backing_off = BackOffState(BackOffMode.BACKING_OFF, elapsed=0.02, anchor=0.005)
    decision = step(backing_off, depth=backing_off.anchor + 1.1 * P.distance)
    assert decision.state.mode == BackOffMode.BACKING_OFF
    assert decision.feed_speed == P.retract_speed


def test_the_first_measurement_counts_as_progress_at_any_depth():
    """The first anchor is 1 m above the mouth, so that the time since progress begins with the run."""
    assert BackOffState()[:7] == (0.0, 0.0, -1.0, 0.0, -1.0, -1.0, 0.0)
    state = step(BackOffState(), depth=-0.05).state
    assert (state.anchor, state.elapsed) == (-0.05, 0.0)


def attempt(state, *, depth, contact_state=0.0):
    """Pushes at a depth until the peg is drawn back, and draws it back; returns the decision after it."""
    while state.mode == BackOffMode.WORKING:
        state = step(state, depth=depth, contact_state=contact_state).state
    decision = step(state, depth=depth - 1.1 * P.distance, contact_state=contact_state)
    assert decision.state.mode == BackOffMode.WORKING or decision.given_up
    return decision


@pytest.mark.parametrize("contact_state", [0, 3])
def test_after_an_attempt_that_is_not_deeper_the_next_turns_the_other_way(contact_state):
    state = attempt(BackOffState(), depth=0.005).state  # the first: nothing to compare with
    assert step(state).turning == 1.0
    state = attempt(state, depth=0.005, contact_state=contact_state).state
    assert step(state).turning == -1.0
    state = attempt(state, depth=0.005 + 0.9 * P.stall_depth, contact_state=contact_state).state
    assert step(state).turning == 1.0


def test_what_brings_the_peg_deeper_is_kept_and_what_does_not_is_given_up():
    state = attempt(attempt(BackOffState(), depth=0.005).state, depth=0.005).state
    for number in range(3):
        state = attempt(state, depth=0.005 + 1.1 * (number + 1) * P.stall_depth).state
        assert step(state).turning == -1.0
    state = attempt(state, depth=0.005).state
    assert step(state).turning == 1.0


def test_attempts_that_end_alike_are_given_up_with_the_peg_drawn_back():
    state = BackOffState()
    for number in range(1 + P.max_repeats):
        decision = attempt(state, depth=0.005)
        state = decision.state
        assert decision.given_up == (number == P.max_repeats)
    assert (decision.feed_speed, decision.turning) == (0.0, 0.0)


@pytest.mark.parametrize(
    "attempts",
    [
        [{"depth": 0.005 + 1.01 * k * P.stall_depth} for k in range(12)],  # each a little deeper
        [{"depth": 0.005, "contact_state": k % 2} for k in range(12)],  # each in another contact state
    ],
)
def test_an_attempt_that_shows_something_new_is_not_given_up(attempts):
    state = BackOffState()
    for one in attempts:
        decision = attempt(state, **one)
        state = decision.state
        assert not decision.given_up
    assert state.repeats == 0.0


def later():
    """The state at the beginning of a second attempt, whose turns are not reversed."""
    return BackOffState(contact_state=0.0, best=0.004)


def turned(*, degrees=1.0, rise=10.0, time=0.4, gain=0.0, state=None):
    """Turns in pitch at a constant rate while the lateral force rises from 3 N; returns the decisions."""
    count, decisions, state = round(time / 0.02), [], later() if state is None else state
    for k in range(count + 1):
        share = k / count
        pitch, side = share * math.radians(degrees), 3.0 + share * rise
        decisions.append(step(state, depth=0.005 + share * gain, pitch=pitch, yaw=0.3, side=side))
        state = decisions[-1].state
    return decisions


def test_turns_that_raise_the_lateral_force_without_a_gain_are_reversed_within_the_attempt():
    decisions = turned()
    first = next(k for k, decision in enumerate(decisions) if decision.turning < 0)
    assert 11 <= first <= 12  # after half of the time the force has risen by 5 N, and 0.2 s have passed
    assert {decision.state.mode for decision in decisions} == {BackOffMode.WORKING}
    assert decisions[first].state.elapsed == pytest.approx(0.02)  # the other way has the whole time again
    assert {decision.turning for decision in decisions[first:]} == {-1.0}  # the watch has begun anew


@pytest.mark.parametrize(
    "harmless",
    [
        {"rise": 0.98 * P.worse_force},
        {"degrees": 0.98 * math.degrees(P.worse_turn)},
        {"time": 0.8 * P.worse_time},
        {"gain": 20 * 1.02 * P.worse_depth},  # a gain in each period
        {"rise": -10.0},
    ],
)
def test_a_small_rise_a_small_turn_a_short_time_or_a_gain_is_no_sign(harmless):
    assert {decision.turning for decision in turned(**harmless)} == {1.0}


def test_in_the_first_attempt_nothing_is_a_sign():
    assert {decision.turning for decision in turned(state=BackOffState(), rise=30.0)} == {1.0}


def test_the_rise_counts_from_the_lowest_force():
    """A force that falls by 20 N and then rises by 10 N is noticed."""
    state = turned(rise=-20.0, time=0.1)[-1].state
    start = state.watch.side
    for k in range(21):
        decision = step(state, depth=0.005, pitch=0.03 + 0.001 * k, yaw=0.3, side=start + 0.5 * k)
        state = decision.state
    assert decision.turning == -1.0


def test_an_attempt_in_which_the_turns_were_reversed_is_not_reversed_again_at_its_end():
    state = attempt(BackOffState(), depth=0.005).state
    state = turned(state=state)[-1].state
    assert state.watch.reversing == state.watch.changes == 1.0
    state = attempt(state, depth=0.005).state
    assert (state.watch.reversing, state.watch.changes) == (1.0, 0.0)
    assert attempt(state, depth=0.005).state.watch.reversing == 0.0


@pytest.mark.parametrize("reverse", [turned, lambda: [attempt(later(), depth=0.003)]])
def test_a_reversal_ends_where_the_peg_is_deeper_by_the_reversal_depth(reverse):
    state = reverse()[-1].state
    assert state.watch.reversing == 1.0
    start, turning = state.watch.reversed_at, []
    for gain in (0.0, 0.6 * P.reversal_depth, 0.99 * P.reversal_depth, 1.01 * P.reversal_depth, 0.5 * P.reversal_depth):
        decision = step(state, depth=start + gain)
        state = decision.state
        turning.append(decision.turning)
    assert start == pytest.approx(0.005 if reverse is turned else 0.003)
    assert turning == [-1.0, -1.0, -1.0, 1.0, 1.0]


def test_a_new_attempt_is_not_judged_by_the_force_of_the_last():
    state = attempt(BackOffState(), depth=0.005).state
    assert (state.watch.depth, state.watch.time) == (pytest.approx(0.005 - 1.1 * P.distance), 0.0)


def test_an_attempt_whose_turns_are_reversed_again_and_again_ends():
    """A force that rises in either direction of the turn must not keep the peg in place for ever."""
    for changes, elapsed in ((P.max_repeats - 1, 0.2), (P.max_repeats, 0.4)):
        decisions = turned(state=later()._replace(watch=TurnWatch(changes=changes), elapsed=0.0, anchor=0.005))
        assert decisions[-1].turning == -1.0
        assert decisions[-1].state.elapsed == pytest.approx(elapsed, abs=0.03)
