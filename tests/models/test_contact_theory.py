"""The laws of a rigid peg in a rigid hole agree with each other and with Whitney's for small tilts."""

import numpy as np
import pytest

from models.contact_theory import (
    exact_wedging_tilt,
    jamming_load,
    slenderness,
    two_point_axial_force,
    two_point_depth,
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


def test_exact_wedging_needs_more_tilt_than_the_law_and_may_be_impossible():
    for friction in (0.2, 0.3):
        law = wedging_tilt(friction=friction, **SIZES)
        assert law < exact_wedging_tilt(friction=friction, **SIZES) < 1.1 * law
    assert np.isnan(exact_wedging_tilt(friction=0.09, **SIZES))
