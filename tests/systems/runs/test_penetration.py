import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from models.scenario import Geometry
from systems.runs.exact_states import exact_bodies
from systems.runs.penetration import deepest_overlap

G = Geometry()
UPRIGHT = [0.0, 0.0, 1.0]


def test_a_peg_pressed_sideways_overlaps_by_what_passes_the_clearance():
    aside = G.clearance + 7e-6
    poses = [[0.0, 0.0, -0.010], [0.0, aside, -0.010], [0.5 * aside, 0.0, -0.012]]
    assert deepest_overlap(G, poses, [UPRIGHT] * 3) == pytest.approx(7e-6, abs=1e-9)


def test_a_peg_on_the_floor_overlaps_by_what_passes_the_depth():
    assert deepest_overlap(G, [[0.0, 0.0, -G.hole_depth - 3e-6]], [UPRIGHT]) == pytest.approx(3e-6, abs=1e-9)


def test_bodies_that_never_touch_overlap_by_nothing():
    assert deepest_overlap(G, [[0.0, 0.0, 0.003]], [UPRIGHT]) == 0.0


def test_a_pose_that_is_none_does_not_count():
    poses = [[np.nan, 0.0, 0.0], [0.0, 0.0, -0.010], [0.0, 0.0, -0.010]]
    assert deepest_overlap(G, poses, [UPRIGHT, UPRIGHT, [1.0, 0.0, 0.0]]) == 0.0
    assert deepest_overlap(G, np.empty((0, 3)), np.empty((0, 3))) == 0.0


def test_a_demonstration_reports_its_overlap(demonstrations):
    for shown in demonstrations:
        s = shown.samples
        axis = Rotation.from_rotvec(s[["ax", "ay", "az"]].to_numpy() * s[["angle"]].to_numpy()).apply([0.0, 0.0, 1.0])
        overlap = -exact_bodies(shown).gap(s[["x", "y", "z"]].to_numpy(), axis).min()
        assert overlap > 0.0  # all of them touch
        assert shown.metadata["penetration_um"] == pytest.approx(1e6 * overlap, abs=0.051)
