"""The figures of a trial's forces, against sums worked by hand."""

import numpy as np
import pytest

from experiments.trial.force_metrics import contact_rows, force_figures
from skill.data.rig_run import CONTACT_COLUMNS, ContactPlace
from systems.plant.contact_forces import Contact, contact_table, needs_contacts

RADIUS, STEP = 0.01, 2e-3


def figures_of(wrenches):
    return force_figures(np.array(wrenches, dtype=float), RADIUS, STEP, 0.0, 0.0)


def contact(place, force, normal=(1.0, 0.0, 0.0), point=(0.01, 0.0, -0.001)):
    return Contact(place, np.array(point), np.array(normal), force)


def test_a_wedge_has_a_small_force_across_and_a_large_load():
    """A moment of 0.4 N m over 10 mm is 40 N; with 30 N along the peg the load is 50 N."""
    figures = figures_of([[3, 4, 0, 0, 0, 0], [0, 0, -30, 0, 0.4, 0]])
    assert figures.peak_load == pytest.approx(50.0)
    assert figures.peak_lateral_force == pytest.approx(5.0)
    assert figures.peak_axial_force == pytest.approx(30.0)
    assert figures.peak_moment == pytest.approx(0.4)


def test_the_mean_load_and_the_time_above_20_n():
    """Loads of 0.9, 1, 20, 20.1 and 39 N: the first is no contact, the last two are above 20 N."""
    figures = figures_of([[0, 0, f, 0, 0, 0] for f in (0.9, 1.0, 20.0, 20.1, 39.0)])
    assert figures.mean_load == pytest.approx((1.0 + 20.0 + 20.1 + 39.0) / 4)
    assert figures.time_above_20n == pytest.approx(2 * STEP)
    figures = figures_of([[12.0, 16.1, 0, 0, 0, 0], [12.0, 16.0, 0, 0, 0, 0], [0, 0, 0, 0, 0.9, 0]])
    assert figures.force_above_20n == pytest.approx(STEP)  # moments do not count
    assert set(vars(figures_of([])).values()) == {0.0}


def test_the_first_touch_is_the_impulse_of_50_ms():
    """0.5 N is no contact; 25 steps of 2 ms with 3 and 4 N across are 5 N for 50 ms; what follows does not count."""
    wrenches = [[0.5, 0, 0, 0, 0, 0]] * 7 + [[3, 4, 0, 0, 0, 0]] * 25 + [[90, 0, 0, 0, 0, 0]] * 9
    assert figures_of(wrenches).first_touch == pytest.approx(5.0 * 0.050)
    assert figures_of(wrenches[:17]).first_touch == pytest.approx(5.0 * 0.020)


@pytest.mark.parametrize(
    ("load", "extent", "needed"),
    [(99.0, 0.0, False), (10.4, 1.04e-6, False), (10.6, 1e-6, True), (10.0, 1.06e-6, True), (10.0, 1e-6, False)],
)
def test_contacts_are_read_at_a_load_or_extent_that_is_larger_by_five_percent_only(load, extent, needed):
    assert needs_contacts(load, extent, 10.0, 1e-6) == needed


def rows(*looks, count):
    seen, tables = zip(*(contact_table(contacts) for contacts in looks), strict=True)
    return contact_rows(np.array(seen), np.array(tables), count)


def test_a_row_holds_the_stronger_contact_of_each_place():
    tip = contact(ContactPlace.TIP, 4.0, (0.0, -1.0, 0.0), (0.0, 0.01, -0.02))
    row = dict(zip(CONTACT_COLUMNS, rows([tip, contact(ContactPlace.TIP, 3.0)], count=1)[0], strict=True))
    assert [row[f"contact_tip_{name}"] for name in ("x", "y", "z", "fx", "fy", "fz")] == [0, 0.01, -0.02, 0, -4, 0]
    assert not any(value for name, value in row.items() if not name.startswith("contact_tip"))
    seen = rows([contact(ContactPlace.MOUTH, 2.0)], [], count=4)
    assert seen.any(axis=1).tolist() == [True, False, False, False]
