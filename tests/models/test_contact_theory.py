"""The laws of a rigid peg in a rigid hole agree with each other and with Whitney's for small tilts."""

import math

import numpy as np
import pytest

from models.contact_theory import (
    exact_wedging_tilt,
    jamming_load,
    largest_clocking,
    slenderness,
    two_point_axial_force,
    two_point_depth,
    two_point_push_moment,
    two_point_tilt,
    wedging_tilt,
)

SIZES = {"peg_radius": 0.010, "hole_radius": 0.01005}


def test_two_point_depth_is_that_of_whitney_for_small_tilts():
    assert float(two_point_depth(1e-3, **SIZES)) == pytest.approx(2 * 5e-5 / 1e-3, rel=1e-3)
    assert two_point_tilt(0.012, **SIZES) == pytest.approx(np.radians(0.4774537), rel=1e-6)
    assert float(two_point_depth(two_point_tilt(0.007, **SIZES), **SIZES)) == pytest.approx(0.007)


def test_the_vertices_lie_on_the_edges():
    for friction, depth in ((0.1, 0.02), (0.3, 0.008)):
        lam = float(slenderness(depth, peg_radius=0.01, friction=friction))
        x, m = np.array([(1.0 / friction, -1.0), (-1.0 / friction, 2.0 * lam + 1.0)]).T
        assert jamming_load(x, m, slenderness=lam, friction=friction) == pytest.approx(1.0)


def test_the_force_balance_is_the_two_point_edge_of_the_jamming_diagram():
    friction, depth, r = 0.2, 0.02, 0.01
    lam = float(slenderness(depth, peg_radius=r, friction=friction))
    F_z = float(two_point_axial_force(0.3, 0.01, depth=depth, peg_radius=r, friction=friction))
    load = jamming_load(0.3 / F_z, 0.01 / (r * F_z), slenderness=lam, friction=friction)
    assert load == pytest.approx(1.0)


def test_the_moment_of_a_pushed_peg_is_that_of_whitney_for_small_tilts():
    tilt, force, friction = 0.004, 3.0, 0.3
    moment = two_point_push_moment(force, tilt, friction=friction, **SIZES)
    # F_z = 2 mu M / l; the tilt of the normal at the mouth reduces the force by a part tilt / (2 mu).
    assert -moment == pytest.approx(force * (2 * 5e-5 / tilt) / (2 * friction), rel=1.5 * tilt / (2 * friction))


def test_exact_wedging_needs_more_tilt_than_the_law_and_may_be_impossible():
    for friction in (0.2, 0.3):
        law = wedging_tilt(friction=friction, **SIZES)
        assert law < exact_wedging_tilt(friction=friction, **SIZES) < 1.1 * law
    assert np.isnan(exact_wedging_tilt(friction=0.09, **SIZES))


def test_a_sharp_square_turns_until_its_corner_is_on_the_wall():
    """The corner is sqrt(2) a from the axis: at sqrt(2) a cos(45 deg - phi) = a + C."""
    phi = largest_clocking([[1.0, 1.0]], [[1.0, 0.0]], [0.0], clearance=0.005)
    assert math.sqrt(2.0) * math.cos(math.pi / 4.0 - phi) == pytest.approx(1.005, abs=1e-12)


def test_rounding_the_corner_lets_a_peg_turn_further_and_a_wide_hole_any_way():
    sharp, rounded = (largest_clocking([[1.0 - r, 1.0 - r]], [[0.0, 1.0]], [r], clearance=0.005) for r in (0.0, 0.1))
    assert rounded > sharp
    assert largest_clocking([[1.0, 1.0]], [[1.0, 0.0]], [0.0], clearance=0.5) == math.pi
