"""Wedges: two contacts against the exact condition of a tilted peg, and the time that counts."""

import math

import numpy as np
import pytest

from experiments.trial.stuck_peg import (
    JAMMED_FORCE,
    JAMMED_GAIN,
    JAMMED_TIME,
    WEDGE_FORCE,
    WEDGE_TIME,
    is_jammed,
    wedged_samples,
    wedged_time,
)
from models.contact_theory import exact_wedging_tilt, two_point_depth
from skill.data.rig_run import ContactPlace
from systems.plant.contact_forces import Contact, contact_table

SIZES = {"peg_radius": 0.010, "hole_radius": 0.01005}
PERIOD = 0.02


def two_point_contacts(tilt, force=10.0, other=10.0):
    """The contacts of a peg that is tilted about y: its tip's edge touches one wall, its side the opposite mouth."""
    depth = float(two_point_depth(tilt, **SIZES)) - SIZES["peg_radius"] * math.sin(tilt)
    R = SIZES["hole_radius"]
    tip = Contact(ContactPlace.TIP, np.array([R, 0.0, -depth]), np.array([-1.0, 0.0, 0.0]), force)
    normal = np.array([math.cos(tilt), 0.0, math.sin(tilt)])  # of the peg's side, which leans to the other wall
    return [tip, Contact(ContactPlace.MOUTH, np.array([-R, 0.0, 0.0]), normal, other)]


def is_wedged(contacts, friction):
    count, table = contact_table(contacts)
    return bool(wedged_samples(np.array([count]), table[None], friction)[0])


@pytest.mark.parametrize("friction", [0.15, 0.2, 0.3, 0.5])
def test_two_contacts_wedge_from_the_exact_tilt_on(friction):
    tilt = exact_wedging_tilt(friction=friction, **SIZES)
    assert is_wedged(two_point_contacts(1.001 * tilt), friction)
    assert not is_wedged(two_point_contacts(0.999 * tilt), friction)


def test_nothing_wedges_where_the_theory_has_no_wedge():
    assert math.isnan(exact_wedging_tilt(friction=0.09, **SIZES))
    assert not any(is_wedged(two_point_contacts(tilt), 0.09) for tilt in np.linspace(0.001, 0.09, 50))


TIP, MOUTH = two_point_contacts(math.radians(3.0))
APART = [Contact(c.place, c.point, -c.normal, c.force) for c in (TIP, MOUTH)]
FACE = Contact(ContactPlace.FACE, np.zeros(3), np.array([0.0, 0.0, 1.0]), 50.0)


@pytest.mark.parametrize(
    ("contacts", "wedged"),
    [
        ([FACE, TIP, MOUTH], True),
        (two_point_contacts(math.radians(3.0), WEDGE_FORCE, WEDGE_FORCE), True),
        (two_point_contacts(math.radians(3.0), 100.0, 0.99 * WEDGE_FORCE), False),
        (two_point_contacts(math.radians(3.0), 0.99 * WEDGE_FORCE, 100.0), False),
        ([TIP], False),
        ([], False),
        ([TIP, Contact(ContactPlace.MOUTH, MOUTH.point, TIP.normal, 10.0)], False),  # on the same side
        ([TIP, Contact(ContactPlace.MOUTH, TIP.point, -TIP.normal, 10.0)], False),  # at the same point
        (APART, False),
    ],
)
def test_a_wedge_has_two_contacts_that_press_towards_each_other(contacts, wedged):
    assert is_wedged(contacts, 0.3) == wedged


def test_only_wedges_of_a_tenth_of_a_second_count():
    """Runs of 4, 5 and 7 samples of 20 ms: the first is too short."""
    runs = [(2, False), (4, True), (1, False), (5, True), (3, False), (7, True)]
    wedged = np.concatenate([np.full(count, state) for count, state in runs])
    assert round(WEDGE_TIME / PERIOD) == 5
    assert wedged_time(wedged, PERIOD) == pytest.approx(12 * PERIOD)


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
