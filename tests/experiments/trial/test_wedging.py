"""Wedges: two contacts against the exact condition of a tilted peg, and the time that counts."""

import math

import numpy as np
import pytest

from experiments.trial.wedging import WEDGE_FORCE, WEDGE_TIME, wedged_samples, wedged_time
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
