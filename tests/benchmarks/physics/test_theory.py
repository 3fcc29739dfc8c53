"""The simulated contact obeys the theory; the full measurement is benchmarks/physics/theory.py."""

import numpy as np
import pytest

from benchmarks.physics.contact_measurements import (
    PegTheory,
    force_balance,
    jamming_trials,
    measured_entry_tilt,
    measured_two_point_depth,
)
from benchmarks.physics.contact_probe import ContactProbe, PlanarPose
from models.contact_theory import (
    exact_wedging_tilt,
    jamming_load,
    jamming_vertices,
    largest_entry_tilt,
    slenderness,
    two_point_axial_force,
    two_point_depth,
    two_point_push_moment,
    two_point_tilt,
    wedging_tilt,
)
from models.scenario import Scenario

SIZES = {"peg_radius": 0.010, "hole_radius": 0.01005}


@pytest.fixture(scope="module")
def probe():
    return ContactProbe(Scenario())


@pytest.mark.parametrize("degrees", [0.3, 1.0, 2.6])
def test_meshes_touch_twice_at_the_exact_depth(probe, degrees):
    measured = measured_two_point_depth(probe, PegTheory.of(Scenario()), np.radians(degrees))
    assert measured == pytest.approx(float(two_point_depth(np.radians(degrees), **SIZES)), rel=2e-3)


def test_largest_tilt_enters(probe):
    measured = measured_entry_tilt(probe, PegTheory.of(Scenario()))
    assert measured == pytest.approx(largest_entry_tilt(**SIZES), rel=0.01)


def test_loads_slide_inside_and_stick_outside():
    trials = jamming_trials(Scenario(), 0.2, depth=0.020, count=12, seed=1)
    assert trials.agreement() == 1.0
    assert 0 < trials.slid.sum() < 12


def test_force_of_sliding():
    predicted, measured = force_balance(Scenario(), 0.2, depth=0.020, shares=[0.0, 0.6])
    assert measured == pytest.approx(predicted, rel=0.05)


def test_a_held_axis_does_not_move(probe):
    probe.place(PlanarPose(0.0, -0.01, 0.0))
    probe.load(0.0, -1.0, 0.0)
    probe.hold("z")
    probe.step(5)
    assert probe.pose().z == pytest.approx(-0.01, abs=1e-12)
    probe.hold()
    probe.step(5)
    assert probe.pose().z < -0.01


# ------------------------------------------------------------------ the laws themselves


def test_two_point_depth_is_whitneys_for_small_tilts():
    assert float(two_point_depth(1e-3, **SIZES)) == pytest.approx(2 * 5e-5 / 1e-3, rel=1e-3)
    assert two_point_tilt(0.012, **SIZES) == pytest.approx(np.radians(0.4774537), rel=1e-6)
    assert float(two_point_depth(two_point_tilt(0.007, **SIZES), **SIZES)) == pytest.approx(0.007)


def test_the_vertices_lie_on_the_edges():
    for friction, depth in ((0.1, 0.02), (0.3, 0.008)):
        lam = float(slenderness(depth, peg_radius=0.01, friction=friction))
        x, m = jamming_vertices(slenderness=lam, friction=friction).T
        assert jamming_load(x, m, slenderness=lam, friction=friction) == pytest.approx(1.0)


def test_the_force_balance_is_the_diagrams_two_point_edge():
    friction, depth, r = 0.2, 0.02, 0.01
    lam = float(slenderness(depth, peg_radius=r, friction=friction))
    F_z = float(two_point_axial_force(0.3, 0.01, depth=depth, peg_radius=r, friction=friction))
    load = jamming_load(0.3 / F_z, 0.01 / (r * F_z), slenderness=lam, friction=friction)
    assert load == pytest.approx(1.0)


def test_a_pushed_peg_is_squeezed_as_whitney_says_where_the_tilt_is_small():
    tilt, force, friction = 0.004, 3.0, 0.3
    moment = two_point_push_moment(force, tilt, friction=friction, **SIZES)
    # F_z = 2 mu M / l; the tilt of the normal at the mouth takes a part tilt / (2 mu) of the force.
    assert -moment == pytest.approx(force * (2 * 5e-5 / tilt) / (2 * friction), rel=1.5 * tilt / (2 * friction))


def test_exact_wedging_needs_more_tilt_than_whitney_and_may_be_impossible():
    for friction in (0.2, 0.3):
        law = wedging_tilt(friction=friction, **SIZES)
        assert law < exact_wedging_tilt(friction=friction, **SIZES) < 1.1 * law
    assert np.isnan(exact_wedging_tilt(friction=0.09, **SIZES))
