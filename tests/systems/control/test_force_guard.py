import pytest
from hypothesis import given
from hypothesis import strategies as st

from models.scenario import ControllerParameters
from systems.control.force_guard import BACKING_OFF, WORKING, GuardState, guard_step

P = ControllerParameters()
FEED = -0.01


def step(watch, *, load=0.0, depth=0.0, known=True, support=1.0, feed=FEED):
    return guard_step(P, watch, period=0.02, feed_speed=feed, load=load, depth=depth, known=known, support=support)


def test_a_free_peg_is_fed_as_the_skill_wants():
    verdict = step(GuardState())
    assert (verdict.feed_speed, verdict.turning, verdict.watch.mode) == (FEED, True, WORKING)


def test_the_feed_is_lowered_between_the_soft_force_and_the_holding_force():
    middle = 0.5 * (P.soft_force + P.hold_force)
    assert step(GuardState(), load=P.soft_force).feed_speed == pytest.approx(FEED)
    assert step(GuardState(), load=middle).feed_speed == pytest.approx(0.5 * FEED)
    assert step(GuardState(), load=P.hold_force).feed_speed == pytest.approx(0.0)


def test_an_unknown_state_halves_the_feed():
    assert P.unknown_feed == 0.5
    assert step(GuardState(), known=False).feed_speed == pytest.approx(0.5 * FEED)


@pytest.mark.parametrize("support", [0.0, 0.3, 1.0])
def test_the_feed_is_lowered_with_the_support(support):
    assert step(GuardState(), support=support).feed_speed == pytest.approx(support * FEED)
    assert step(GuardState(), support=support, known=False).feed_speed == pytest.approx(0.5 * support * FEED)
    assert step(GuardState(), support=support, feed=0.01).feed_speed == 0.01


@pytest.mark.parametrize("doubtful", [{"known": False}, {"support": 0.9}])
def test_what_is_not_recognised_for_long_is_backed_off_from_and_tried_again(doubtful):
    watch, depth, time = GuardState(anchor=0.005), 0.005, 0.0
    while watch.mode == WORKING:
        depth += P.stall_depth  # it does come deeper
        watch, time = step(watch, depth=depth, **doubtful).watch, time + 0.02
        assert time < 3.0
    assert time == pytest.approx(P.doubt_time, abs=0.041)
    verdict = step(watch, depth=depth - 1.1 * P.back_off_distance, **doubtful)
    assert verdict.watch.mode == WORKING
    assert verdict.watch.doubt == pytest.approx(0.02)  # counted anew
    assert verdict.feed_speed < 0


def test_a_moment_of_recognition_ends_the_doubt():
    watch = GuardState()
    for k in range(200):  # recognised once in 0.8 s
        watch = step(watch, depth=k * P.stall_depth, known=k % 40 == 0).watch
        assert watch.mode == WORKING
    assert step(GuardState(doubt=0.9), known=True, support=1.0).watch.doubt == 0.0


def test_pulling_out_is_never_slowed():
    assert step(GuardState(), load=0.99 * P.force_limit, known=False, feed=0.01).feed_speed == 0.01


def test_beyond_the_limit_the_peg_is_drawn_back_by_the_distance_and_then_works_on():
    depth = 0.005
    verdict = step(GuardState(anchor=depth), load=P.force_limit + 0.1, depth=depth)
    assert verdict.watch == GuardState(BACKING_OFF, anchor=depth)
    while verdict.watch.mode == BACKING_OFF:
        assert verdict.feed_speed == P.retract_speed
        assert not verdict.turning
        depth -= P.retract_speed * 0.02
        verdict = step(verdict.watch, depth=depth)
    assert 0.005 - depth == pytest.approx(P.back_off_distance, abs=P.retract_speed * 0.02)
    assert verdict.feed_speed == FEED


def test_a_peg_that_cannot_be_drawn_back_is_not_pulled_for_ever():
    watch, periods = GuardState(BACKING_OFF, anchor=0.005), 0
    while watch.mode == BACKING_OFF:
        watch, periods = step(watch, depth=0.005).watch, periods + 1
    assert 0.02 * (periods - 1) == pytest.approx(P.back_off_time, abs=0.021)


def test_pushing_without_progress_is_recognised_as_stuck():
    watch, time = GuardState(anchor=0.005), 0.0
    while watch.mode == WORKING:
        watch, time = step(watch, depth=0.005, load=5.0).watch, time + 0.02
        assert time < 2.0
    assert time == pytest.approx(P.stall_time, abs=0.041)


def test_slow_progress_is_not_stuck():
    watch, depth = GuardState(anchor=0.005), 0.005
    for _ in range(500):
        depth += 1.2 * P.stall_depth * 0.02 / P.stall_time
        watch = step(watch, depth=depth).watch
        assert watch.mode == WORKING


@given(
    load=st.floats(0, 500),
    depth=st.floats(-0.01, 0.03),
    elapsed=st.floats(0, 5),
    anchor=st.floats(-1, 0.03),
    mode=st.sampled_from([WORKING, BACKING_OFF]),
    known=st.booleans(),
    support=st.floats(0, 1),
    doubt=st.floats(0, 2),
    feed=st.floats(-0.05, 0.05),
)
def test_the_peg_is_never_pushed_in_faster_than_the_skill_wants_nor_at_all_beyond_the_limit(
    load, depth, elapsed, anchor, mode, known, support, doubt, feed
):
    watch = GuardState(mode, elapsed, anchor, doubt)
    verdict = step(watch, load=load, depth=depth, known=known, support=support, feed=feed)
    assert verdict.feed_speed >= min(feed, 0.0)
    if load > P.force_limit:
        assert verdict.feed_speed >= 0.0


def test_a_peg_that_cannot_be_drawn_back_has_its_turns_unwound():
    depth = 0.005
    watch = step(GuardState(anchor=depth), load=P.force_limit + 1.0, depth=depth).watch
    seen = []
    while watch.mode == BACKING_OFF:
        verdict = step(watch, load=P.force_limit + 1.0, depth=depth)
        seen.append((watch.elapsed, verdict.unwinding))
        if watch.elapsed >= P.back_off_time:
            break
        watch = verdict.watch
    half = 0.5 * P.back_off_time
    assert {unwinding for elapsed, unwinding in seen[:-1] if elapsed < half - 0.01} == {False}
    assert {unwinding for elapsed, unwinding in seen[:-1] if elapsed > half + 0.01} == {True}
    risen = GuardState(BACKING_OFF, elapsed=0.6 * P.back_off_time, anchor=depth)
    assert not step(risen, depth=depth - 1.1 * P.stall_depth).unwinding
