"""The planar probe in MuJoCo against exact geometry and Whitney's balance."""

import json

import numpy as np
import pytest

mujoco = pytest.importorskip("mujoco", reason="needs the extra [peers]")


from benchmarks.physics.contact_probe import PlanarPose  # noqa: E402
from benchmarks.physics.mujoco_probe import MujocoProbe, main  # noqa: E402
from models.exact_geometry import rotations_of_vectors  # noqa: E402
from models.scenario import Scenario  # noqa: E402


@pytest.mark.slow
@pytest.mark.parametrize(("tilt", "deep"), [(0.0, (-0.004, 5e-5)), (0.04, (-0.004, -0.001))])
def test_the_ring_of_boxes_has_the_gap_of_the_exact_bore(tilt, deep):
    """The overlap of some micrometres is the same by exact geometry and in MuJoCo."""
    scenario = Scenario()
    probe, rng = MujocoProbe(scenario), np.random.default_rng(1)
    p = np.column_stack([rng.uniform(-4e-4, 4e-4, 300), np.zeros(300), rng.uniform(*deep, 300)])
    gaps = scenario.geometry.assembly.gap(p, rotations_of_vectors(np.tile([0.0, tilt, 0.0], (300, 1))))
    overlapping = (gaps > -3e-5) & (gaps < -1e-6)
    assert overlapping.sum() > 3
    for (x, _, z), gap in zip(p[overlapping], gaps[overlapping], strict=True):
        probe.place(PlanarPose(x, z, tilt))
        mujoco.mj_forward(probe.model, probe.data)
        assert min(c.dist for c in probe.data.contact) == pytest.approx(gap, abs=0.02 * abs(gap) + 1e-7)


@pytest.mark.nightly
@pytest.mark.slow
def test_mujoco_agrees_about_a_press_and_slow_slides(tmp_path):
    main(json=tmp_path / "found.json")
    found = json.loads((tmp_path / "found.json").read_text())
    assert 0.0 < found["overlap_um"] < 5.0
    assert all(abs(error) < 0.04 for name, error in found.items() if name.endswith(("mm", "error")))
