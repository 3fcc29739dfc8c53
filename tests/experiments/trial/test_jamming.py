import numpy as np
import pytest

from experiments.trial.jamming import JAMMED_FORCE, JAMMED_GAIN, JAMMED_TIME, is_jammed

TIME = np.arange(0.0, 3.0, 0.02)
PRESSED = np.tile([0.0, 0.6, 0.8], (len(TIME), 1)) * (JAMMED_FORCE + 0.1)


def test_moving_out_and_back_in_is_no_gain():
    depth = 0.004 - 1e-3 * (np.sin(2 * np.pi * TIME / 0.8) > 0.5)
    assert np.ptp(depth[-40:]) > JAMMED_GAIN
    assert is_jammed(TIME, depth, PRESSED)


def test_a_pressed_peg_that_moves_out_is_jammed():
    """A loss of depth is no gain, however large."""
    depth = np.where(TIME[-1] - JAMMED_TIME < TIME, 0.004 - 3 * JAMMED_GAIN, 0.004)
    assert is_jammed(TIME, depth, PRESSED)


@pytest.mark.parametrize(
    ("seconds", "gain", "force", "jammed"),
    [
        (1.2, 0.45e-3, 3.2, True),
        (0.8, 0.45e-3, 3.2, False),
        (1.2, 0.55e-3, 3.2, False),
        (1.2, 0.45e-3, 2.8, False),
    ],
)
def test_a_jammed_peg_gains_less_than_half_a_millimetre_in_a_second_under_three_newtons(seconds, gain, force, jammed):
    time = np.linspace(0.0, seconds, 61)
    depth = np.where(time < 0.3, 0.004, 0.004 + gain)
    assert is_jammed(time, depth, np.tile([force, 0.0, 0.0], (61, 1))) is jammed


def test_the_mean_force_of_the_last_second_counts():
    """Half of it 2 N, the other half 5 N: 3.5 N; a large force before it does not count."""
    last = TIME[-1] - 1.0 < TIME
    force = np.zeros((len(TIME), 3))
    force[last, 2] = np.where(np.arange(last.sum()) % 2, 2.0, 5.0)
    assert is_jammed(TIME, np.zeros(len(TIME)), force)
    force[last, 2] = np.where(np.arange(last.sum()) % 2, 0.0, 5.0)
    force[~last, 2] = 100.0
    assert not is_jammed(TIME, np.zeros(len(TIME)), force)
