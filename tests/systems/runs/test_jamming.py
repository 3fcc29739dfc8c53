import numpy as np
import pytest

from systems.runs.jamming import JAMMED_FORCE, JAMMED_GAIN, JAMMED_TIME, is_jammed

TIME = np.arange(0.0, 3.0, 0.02)
PRESSED = np.tile([0.0, 0.6, 0.8], (len(TIME), 1)) * (JAMMED_FORCE + 0.1)


def test_a_peg_that_is_pressed_and_does_not_come_is_jammed():
    assert is_jammed(TIME, np.full(len(TIME), 0.004), PRESSED)


def test_a_peg_that_is_not_pressed_is_not_jammed():
    assert not is_jammed(TIME, np.full(len(TIME), 0.004), PRESSED * JAMMED_FORCE / (JAMMED_FORCE + 0.2))


@pytest.mark.parametrize(("share", "jammed"), [(0.95, True), (1.05, False)])
def test_depth_gained_in_the_last_second_is_progress(share, jammed):
    depth = 0.004 + share * JAMMED_GAIN * np.clip((TIME - TIME[-1] + JAMMED_TIME) / JAMMED_TIME, 0.0, 1.0)
    assert is_jammed(TIME, depth, PRESSED) is jammed


def test_drawing_back_and_coming_to_the_old_place_is_no_progress():
    depth = 0.004 - 1e-3 * (np.sin(2 * np.pi * TIME / 0.8) > 0.5)
    assert np.ptp(depth[-40:]) > JAMMED_GAIN
    assert is_jammed(TIME, depth, PRESSED)


def test_a_run_shorter_than_the_time_it_takes_is_not_jammed():
    short = TIME < JAMMED_TIME
    assert not is_jammed(TIME[short], np.full(short.sum(), 0.004), PRESSED[short])
