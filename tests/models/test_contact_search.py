"""The compiled search for contacts, beside dense sampling of the exact gap."""

import numpy as np
import pytest

from models.contact_bodies import FLOOR, INNER, INNER_PIECES, OUTER, RIM_PIECES, SIDES, WALLS
from models.exact_geometry import (
    CONTACTS,
    GAP,
    NORMAL,
    REACH,
    RIM,
    ROUND_OFF,
    SURFACE,
    deepest_overlap,
    find_contacts,
    pose_of,
    rotations_of_vectors,
    row_of,
    sample_gaps,
    signs_of_slopes,
)
from models.scenario import Scenario, load_scenario
from models.section import CORNER, NAMES
from tests.models.exact_search import found_minima, lowest_gaps, sampled_minima

ROUND = Scenario().geometry.assembly


@pytest.mark.slow
def test_the_minima_of_the_gap_are_those_of_the_sampled_one():
    rng, n = np.random.default_rng(5), 400
    p = np.column_stack([rng.uniform(-3e-4, 3e-4, (n, 2)), rng.uniform(-0.026, 0.001, n)])
    R = rotations_of_vectors(np.column_stack([rng.uniform(-0.04, 0.04, (n, 2)), np.zeros(n)]))
    gaps, floor = sampled_minima(ROUND.fits[0], p, R)
    for k in range(n):
        found = found_minima(ROUND.bodies, p[k], R[k], REACH)
        rests = found[found[:, SURFACE] == FLOOR]  # three points on which a flat tip rests
        found = found[found[:, SURFACE] != FLOOR]
        np.testing.assert_allclose(np.sort(found[:, GAP]), np.sort(gaps[k][gaps[k] < REACH]), rtol=0, atol=1e-9)
        if floor[k] < REACH:
            assert rests[:, GAP].min() == pytest.approx(floor[k], abs=1e-9)
    assert (gaps < REACH).any(axis=1).mean() > 0.3
    assert (floor < REACH).any()


def poses(seed, n, tilts, turn):
    """Positions (n, 3) near the axis, at all depths, and rotations (n, 3, 3)."""
    rng = np.random.default_rng(seed)
    p = np.column_stack([rng.uniform(-8e-5, 8e-5, (n, 2)), rng.uniform(-0.0252, 0.0005, n)])
    return p, rotations_of_vectors(
        np.column_stack([tilts(p) * rng.uniform(-1.0, 1.0, (n, 2)), rng.uniform(-turn, turn, n)])
    )


@pytest.mark.parametrize("name", ["round", "key"])
@pytest.mark.parametrize(("circle", "curve", "touched"), [(RIM, RIM_PIECES, WALLS), (INNER, INNER_PIECES, SIDES)])
def test_the_signs_of_slopes_are_those_of_the_sampled_gaps(name, circle, curve, touched):
    scenario = Scenario()
    scenario.geometry.section = name
    bodies, known = scenario.geometry.assembly.bodies, 0
    signs, gaps = np.empty((2, bodies.most)), np.empty((2, bodies.most))
    for p, R in zip(*poses(11, 60, lambda p: np.full((len(p), 1), 0.01), 0.002), strict=True):
        for j in range(*bodies.outlines[curve : curve + 2]):
            for k in range(*bodies.outlines[touched : touched + 2]):
                first, end = bodies.first[j : j + 2]
                arguments = (
                    bodies.chamfer,
                    circle,
                    row_of(bodies.pieces, k),
                    bodies.samples,
                    first,
                    end,
                    pose_of(p, R),
                )
                if signs_of_slopes(*arguments, signs):
                    known += 1
                    sample_gaps(*arguments, gaps)
                    multiples, slopes = signs[1, : end - first], gaps[1, : end - first]
                    assert (slopes[multiples > ROUND_OFF] > 0.0).all()
                    assert (slopes[multiples < -ROUND_OFF] < 0.0).all()
    assert known > 20


@pytest.mark.slow
@pytest.mark.parametrize("name", [*NAMES[1:], "two_pin_plug", "stepped_shaft"])
def test_the_lowest_gap_is_the_sampled_one_for_every_section(name):
    n = 100
    if name in NAMES:
        scenario = Scenario()
        scenario.geometry.section = name
        p, R = poses(7, n, lambda p: np.where(p[:, 2:] < -2e-3, 0.001, 0.02), 0.002)
    else:
        scenario = load_scenario(name)
        p, R = poses(8, n, lambda p: 0.006, 0.005)
    assembly = scenario.geometry.assembly
    expected = lowest_gaps(assembly, p, R)
    np.testing.assert_allclose(assembly.gap(p, R), expected, rtol=0, atol=1e-9)
    for k in range(n):
        pose = pose_of(p[k], R[k])
        assert deepest_overlap(assembly.bodies, pose) == pytest.approx(max(0.0, -expected[k]), abs=1e-9)
        count = find_contacts(assembly.bodies, pose, np.empty(CONTACTS))
        assert (count > 0) == (expected[k] < REACH)
    assert 0.1 < (expected < 0.0).mean() < 0.97


def test_a_side_that_lies_flat_on_a_wall_touches_at_its_four_corners_once():
    """The arc beside each corner of the side touches there too."""
    scenario = Scenario()
    scenario.geometry.section = "square"
    g = scenario.geometry
    p, straight = np.array([g.clearance + 1e-6, 0.0, -0.01]), g.peg_radius * (1.0 - CORNER)
    found = found_minima(g.assembly.bodies, p, np.eye(3), REACH)
    np.testing.assert_allclose(found[:, GAP], -1e-6, atol=1e-12)
    np.testing.assert_allclose(found[:, NORMAL], [[-1.0, 0.0, 0.0]] * 4, atol=1e-9)
    corners = [(side * straight, z) for z in (-0.01, -g.chamfer) for side in (-1.0, 1.0)]
    np.testing.assert_allclose(sorted(map(tuple, found[:, 2:4])), sorted(corners), atol=1e-9)


def contacts_at(p, R):
    """Returns gaps, normals and surfaces of the contacts of a pose."""
    contacts = np.empty(CONTACTS)
    found = contacts[: find_contacts(ROUND.bodies, pose_of(p, R), contacts)]
    return found[:, GAP], found[:, NORMAL], found[:, SURFACE]


def test_normals_are_the_slopes_of_gaps_and_do_not_jump_where_bodies_touch():
    """Also where the rim crosses an edge of the chamfer: there the nearest surface jumps at the first overlap."""
    rng = np.random.default_rng(2)
    crossings, errors, turns = 0, [], []
    step = np.array([0.0, 0.0, 2e-7])
    drawn = rng.uniform([-0.04, -0.04, -3e-4, -3e-4], [0.04, 0.04, 3e-4, 3e-4], (300, 4))
    rotations, sides = rotations_of_vectors(np.column_stack([drawn[:, :2], np.zeros(300)])), drawn[:, 2:]
    low, high = np.full(300, -0.02), np.full(300, 0.001)
    for _ in range(60):  # down to the height at which the bodies touch
        middle = 0.5 * (low + high)
        touches = ROUND.gap(np.column_stack([sides, middle]), rotations) < 0.0
        low, high = np.where(touches, middle, low), np.where(touches, high, middle)
    for R, p in zip(rotations, np.column_stack([sides, high]), strict=True):
        (gap, normal, surface), (lower_gap, lower_normal, _) = contacts_at(p + step, R), contacts_at(p - step, R)
        assert len(gap) == len(lower_gap) > 0
        errors.append(np.abs(lower_gap - gap + step[2] * (normal + lower_normal)[:, 2]).max())
        turns.append(np.abs(lower_normal - normal).max())
        crossings += (surface >= OUTER).any()
    assert crossings > 100
    # The rest touches within a micrometre of an edge, where another contact appears.
    assert np.quantile(errors, 0.98) < 5e-9
    assert np.quantile(turns, 0.98) < 0.03
