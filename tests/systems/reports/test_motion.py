import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from skill.features.measurement import contact_load
from systems.reports.motion import motion_of_demonstration, motion_of_run
from systems.reports.scene import arrow_scale
from tests.trajectories import STEP, make_demonstration, make_rig_run


def test_lean_in_a_demonstration_follows_the_rotation_of_the_peg():
    tilt, direction = np.radians(2.5), 0.9
    motion = motion_of_demonstration(make_demonstration(tilt=tilt, direction=direction))
    np.testing.assert_allclose(motion.lean[0], tilt * np.array([np.cos(direction), np.sin(direction)]), atol=1e-9)
    np.testing.assert_allclose(motion.p_WH, 0.0)


def test_hole_of_the_rig_turns_by_pitch_then_yaw_about_the_pivot():
    height = -0.016
    run = make_rig_run(rig={"pivot_height": height})
    motion = motion_of_run(run)
    k = 20
    pitch, yaw = run.samples.loc[k, ["pitch", "yaw"]]
    R = Rotation.from_rotvec([pitch, 0, 0]) * Rotation.from_rotvec([0, yaw, 0])
    np.testing.assert_allclose(motion.R_WH[k].as_matrix(), R.as_matrix(), atol=1e-12)
    # The pivot does not move.
    np.testing.assert_allclose(motion.p_WH[k] + R.apply([0, 0, height]), [0, 0, height], atol=1e-12)
    # For small angles the lean in the hole is -yaw along x and +pitch along y.
    np.testing.assert_allclose(motion.lean[k], [-yaw, pitch], atol=1e-3 * STEP + 1e-4)
    assert np.linalg.norm(motion.lean[k]) == pytest.approx(np.arccos(np.cos(pitch) * np.cos(yaw)), abs=1e-9)


def test_demonstration_without_a_skill_is_coloured_by_its_force():
    motion = motion_of_demonstration(make_demonstration())
    force = np.linalg.norm(motion.force, axis=1)
    assert motion.colouring == "contact force"
    assert motion.phases[0] == "below 0.5 N"
    assert np.array_equal(motion.phase == 0, force < 0.5)


class TwoStates:
    def state_names(self):
        return ["near the mouth", "deep"]

    def state_probabilities(self, measured: np.ndarray) -> np.ndarray:
        deep = (measured[:, 6] < -0.01).astype(float)
        return np.column_stack([1 - deep, deep])


def test_demonstration_with_a_skill_is_coloured_by_its_states():
    demonstration = make_demonstration()
    motion = motion_of_demonstration(demonstration, TwoStates())
    assert motion.colouring == "contact state"
    assert np.array_equal(motion.phase == 1, demonstration.samples["z"] < -0.01)
    assert motion.phases == ["near the mouth", "deep"]


def test_largest_arrow_fits_the_scene_at_a_round_scale():
    motion = motion_of_run(make_rig_run())
    scale = arrow_scale(motion)
    assert np.linalg.norm(motion.force, axis=1).max() / scale.force <= 0.035
    assert f"{0.01 * scale.force:g}".strip("0.") in ("1", "2", "5")


def test_load_is_the_load_that_the_force_guard_monitors():
    motion = motion_of_run(make_rig_run())
    wrenches = np.hstack([motion.force, motion.moment])
    expected = [contact_load(wrench, motion.geometry.peg_radius) for wrench in wrenches]
    np.testing.assert_allclose(motion.load, expected, rtol=1e-15)
    assert np.any(motion.load > 1.2 * np.linalg.norm(motion.force, axis=1))  # so the moment counts
