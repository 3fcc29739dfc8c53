"""The planar probe in MuJoCo against exact geometry and hand-worked statics."""

import numpy as np
import pytest

mujoco = pytest.importorskip("mujoco", reason="needs the extra [peers]")


from benchmarks.physics.contact_probe import PlanarPose  # noqa: E402
from benchmarks.physics.mujoco_probe import MujocoContact, MujocoProbe  # noqa: E402
from models.exact_geometry import rotations_of_vectors  # noqa: E402
from models.scenario import Scenario  # noqa: E402


@pytest.mark.slow
@pytest.mark.parametrize(("tilt", "deep"), [(0.0, (-0.004, 5e-5)), (0.01, (-0.012, 5e-5)), (0.04, (-0.004, -0.001))])
def test_the_ring_of_boxes_has_the_gap_of_the_exact_bore(tilt, deep):
    """The overlap of some micrometres is the same by exact geometry and in MuJoCo."""
    scenario = Scenario()
    g = scenario.geometry
    probe = MujocoProbe(scenario, MujocoContact())
    rng = np.random.default_rng(1)
    p = np.column_stack([rng.uniform(-4e-4, 4e-4, 300), np.zeros(300), rng.uniform(*deep, 300)])
    gaps = g.assembly.gap(p, rotations_of_vectors(np.tile([0.0, tilt, 0.0], (300, 1))))
    overlapping = (gaps > -3e-5) & (gaps < -1e-6)
    assert overlapping.sum() > 3
    for (x, _, z), gap in zip(p[overlapping], gaps[overlapping], strict=True):
        probe.place(PlanarPose(x, z, tilt))
        mujoco.mj_forward(probe.model, probe.data)
        assert min(c.dist for c in probe.data.contact) == pytest.approx(gap, abs=0.02 * abs(gap) + 1e-7)


def test_a_held_axis_does_not_move():
    probe = MujocoProbe(Scenario(), MujocoContact())
    probe.place(PlanarPose(0.0, 0.01, 0.02))
    probe.load(1.0, -1.0, 0.1)
    probe.hold("tilt")
    probe.step(50)
    assert probe.pose().tilt == pytest.approx(0.02, abs=1e-9)
    assert probe.pose().x == pytest.approx(0.5 * 1.0 / 0.5 * (50 * probe.time_step) ** 2, rel=0.2)
    probe.hold()
    probe.step(50)
    assert probe.pose().tilt > 0.021
