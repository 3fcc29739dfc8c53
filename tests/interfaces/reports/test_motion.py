from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from interfaces.reports.motion import motion_of_demonstration, motion_of_run, read_motion
from skill.data.demonstration import write_demonstration
from skill.data.rig_run import write_rig_run
from skill.manipulation_skill import ManipulationSkill
from tests.trajectories import STATE_NAMES, STEP, make_demonstration, make_rig_run


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


def test_an_arm_turns_the_peg_through_the_mouth_of_a_block_at_rest():
    run = make_rig_run(rig={"pivot_height": 0.0})
    rig, found = motion_of_run(run), motion_of_run(replace(run, metadata={**run.metadata, "carrier": "fr3"}))
    np.testing.assert_allclose(found.R_WH.magnitude(), 0.0)
    np.testing.assert_allclose(found.lean, rig.lean, atol=1e-12)
    np.testing.assert_allclose(np.cross(found.R_WP.apply([0.0, 0.0, 1.0]), found.p_WP), 0.0, atol=1e-12)
    np.testing.assert_allclose(found.p_WP[:, 2], run.samples["tip_z"])


class TwoStates:
    def state_names(self):
        return ["near the mouth", "deep"]

    def state_probabilities(self, measured: np.ndarray) -> np.ndarray:
        deep = (measured[:, 6] < -0.01).astype(float)
        return np.column_stack([1 - deep, deep])


@pytest.mark.parametrize("tilt", [0.0, 1e-9, 0.3, 2.0])
def test_norm_of_the_lean_is_the_tilt_for_any_tilt(tilt):
    motion = motion_of_demonstration(make_demonstration())
    lean = replace(motion, R_WP=Rotation.from_rotvec([[0.0, tilt, 0.0]]), R_WH=Rotation.identity(1)).lean
    np.testing.assert_allclose(lean, [[tilt, 0.0]], rtol=1e-12, atol=1e-15)


@pytest.mark.parametrize(
    ("force", "phase"), [(0.49, 0), (0.51, 1), (1.99, 1), (2.01, 2), (7.9, 2), (8.1, 3), (29.9, 3), (30.1, 4)]
)
def test_levels_of_the_force_are_named_by_their_limits(force, phase):
    demonstration = make_demonstration()
    demonstration.samples["fx"], demonstration.samples["fy"] = 0.6 * force, 0.0
    demonstration.samples["fz"] = 0.8 * force
    motion = motion_of_demonstration(demonstration)
    assert np.all(motion.phase == phase)
    assert motion.phases == ["below 0.5 N", "0.5 to 2 N", "2 to 8 N", "8 to 30 N", "above 30 N"]
    assert len(set(motion.colours)) == 5
    assert motion.colouring == "contact force"


def test_time_starts_at_zero_and_depth_counts_downwards():
    for motion_of, make, z in (
        (motion_of_demonstration, make_demonstration, "z"),
        (motion_of_run, make_rig_run, "tip_z"),
    ):
        recording = make()
        recording.samples["time"] += 7.0
        motion = motion_of(recording)
        np.testing.assert_allclose(motion.time, np.arange(len(recording.samples)) * 0.02, atol=1e-9)
        np.testing.assert_array_equal(motion.depth, -recording.samples[z])
        np.testing.assert_array_equal(motion.p_WP[:, 2], recording.samples[z])
        np.testing.assert_array_equal(motion.force, recording.samples[["fx", "fy", "fz"]])
        np.testing.assert_array_equal(motion.moment, recording.samples[["mx", "my", "mz"]])


def test_guard_and_steps_are_those_of_the_run():
    run = make_rig_run()
    motion = motion_of_run(run)
    backing_off = (run.samples["time"] > 0.82) & (run.samples["time"] < 0.92)
    np.testing.assert_array_equal(motion.guard, np.where(backing_off, 2, run.samples["turning"] < 0.0))
    assert set(motion.guard) == {0, 1, 2}
    np.testing.assert_array_equal(motion.steps, run.samples[["pitch_taken", "yaw_taken"]])
    assert motion.steps[-1].min() > 0
    assert motion.force_limit == 50.0
    assert motion.outcome == "inserted"
    assert motion_of_demonstration(make_demonstration()).outcome == "inserted, good"


@pytest.mark.parametrize(
    ("names", "phases"),
    [
        ([*STATE_NAMES, "never seen"], [*STATE_NAMES, "never seen"]),
        (STATE_NAMES, STATE_NAMES),
        (None, ["state 0", "state 1", "state 2", "state 3"]),
    ],
)
def test_every_named_state_has_a_label_and_a_colour(names, phases):
    motion = motion_of_run(make_rig_run(state_names=names))
    assert motion.phases == phases
    assert len(set(motion.colours)) == len(phases)
    np.testing.assert_array_equal(motion.phase, make_rig_run().samples["state"])


def test_fewer_names_than_states_are_an_error():
    with pytest.raises(ValueError, match=r"place: 3 state names .* 4 states"):
        motion_of_run(make_rig_run(state_names=STATE_NAMES[:3]), where="place")


def test_a_file_is_read_as_what_it_holds(tmp_path):
    write_demonstration(make_demonstration(), tmp_path / "a.parquet")
    write_rig_run(make_rig_run(), tmp_path / "b.parquet")
    assert read_motion(tmp_path / "a.parquet").kind == "demonstration"
    assert read_motion(tmp_path / "b.parquet").kind == "rig run"


def test_a_stored_demonstration_is_coloured_by_a_stored_skill(tmp_path, monkeypatch):
    monkeypatch.setattr(ManipulationSkill, "load", lambda path: {tmp_path / "skill.npz": TwoStates()}[path])
    demonstration = make_demonstration()
    write_demonstration(demonstration, tmp_path / "a.parquet")
    motion = read_motion(tmp_path / "a.parquet", tmp_path / "skill.npz")
    assert (motion.phases, motion.colouring) == (["near the mouth", "deep"], "contact state")
    assert np.array_equal(motion.phase == 1, demonstration.samples["z"] < -0.01)


def test_the_contacts_of_a_run_are_ordered_by_place_and_an_idle_arrow_waits_where_it_is_needed():
    run = make_rig_run()
    motion, s = motion_of_run(run), run.samples
    np.testing.assert_array_equal(motion.contact_forces[:, 0, 0], s["contact_mouth_fx"])
    np.testing.assert_array_equal(motion.contact_forces[:, 1, 0], s["contact_tip_fx"])
    assert not motion.contact_forces[:, 2].any()
    first = int(np.argmax(s["contact_tip_fx"] != 0.0))
    assert first > 1
    np.testing.assert_array_equal(motion.contact_points[:first, 1], [motion.contact_points[first, 1]] * first)
    touched = s["contact_tip_fx"].to_numpy() != 0.0
    np.testing.assert_array_equal(motion.contact_points[touched, 1, 2], s["contact_tip_z"].to_numpy()[touched])
