import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from experiments.trial.penetration import deepest_overlap
from models.scenario import Geometry

G = Geometry()
UPRIGHT = np.eye(3)


def test_a_peg_pressed_sideways_overlaps_by_its_offset_beyond_the_clearance():
    aside = G.clearance + 7e-6
    poses = [[0.0, 0.0, -0.010], [0.0, aside, -0.010], [0.5 * aside, 0.0, -0.012]]
    assert deepest_overlap(G, poses, [UPRIGHT] * 3) == pytest.approx(7e-6, abs=1e-9)


def test_a_peg_on_the_floor_overlaps_by_its_depth_beyond_the_hole():
    assert deepest_overlap(G, [[0.0, 0.0, -G.hole_depth - 3e-6]], [UPRIGHT]) == pytest.approx(3e-6, abs=1e-9)


def test_the_overlap_of_separate_bodies_is_zero():
    assert deepest_overlap(G, [[0.0, 0.0, 0.003]], [UPRIGHT]) == 0.0


def test_invalid_poses_are_ignored():
    poses = [[np.nan, 0.0, 0.0], [0.0, 0.0, -0.010], [0.0, 0.0, -0.010]]
    assert deepest_overlap(G, poses, [UPRIGHT, UPRIGHT, Rotation.from_rotvec([0.0, np.pi / 2, 0.0]).as_matrix()]) == 0.0
    assert deepest_overlap(G, np.empty((0, 3)), np.empty((0, 3, 3))) == 0.0


@pytest.mark.parametrize("degrees", [44.0, -44.0, 45.0, 46.0, 89.0])
def test_a_tilt_up_to_almost_45_degrees_is_evaluated(degrees):
    """The rim of the tip is r sin(tilt) lower than its centre, which is far from the wall of the bore."""
    tilt = np.radians(degrees)
    R_HP = Rotation.from_rotvec([0.0, tilt, 0.0]).as_matrix()
    overlap = deepest_overlap(G, [[0.0, 0.0, -G.hole_depth - 1e-3]], [R_HP])
    assert (overlap > 1e-3) == (abs(degrees) < 45.0)
