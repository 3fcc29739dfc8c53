"""The single contacts: their places, hand-worked wedges, and the sum of their forces against the net force."""

import numpy as np
import pytest
from pydrake.math import RigidTransform, RotationMatrix

from benchmarks.physics.contact_measurements import PegTheory
from benchmarks.physics.contact_probe import AXES, ContactProbe, PlanarPose
from skill.data.rig_run import ContactPlace
from systems.plant.contact_forces import NormalForces, hydroelastic_forces, single_contacts

CHAMFER = 3e-4


def contacts_of(points, normals, forces, *, X_WH=None, tip=-0.012):
    """The contacts of parts that are given in H, for a tip at this height in the hole."""
    X_WH = RigidTransform() if X_WH is None else X_WH
    points, normals = np.atleast_2d(points), np.atleast_2d(normals)
    R = X_WH.rotation().matrix()
    parts = NormalForces(points @ R.T + X_WH.translation(), normals @ R.T, np.array(forces, dtype=float))
    return single_contacts(parts, X_WH, RigidTransform([0.0, 0.0, tip]), chamfer=CHAMFER)


@pytest.mark.parametrize("X_WH", [None, RigidTransform(RotationMatrix.MakeXRotation(0.06), [0.001, 0.002, -0.003])])
def test_every_part_of_the_bore_has_its_place(X_WH):
    slope = np.sqrt(0.5)
    for point, normal, place in (
        ([0.02, 0.0, 0.0], [0.0, 0.0, 1.0], ContactPlace.FACE),
        ([0.003, 0.0, -0.025], [0.0, 0.0, 1.0], ContactPlace.FACE),
        ([0.0101, 0.0, -0.0001], [-slope, 0.0, slope], ContactPlace.MOUTH),
        ([0.01, 0.0, -0.0004], [-1.0, 0.0, 0.0], ContactPlace.MOUTH),
        ([0.01, 0.0, -0.0060], [-1.0, 0.0, 0.0], ContactPlace.MOUTH),  # the middle is 6.15 mm deep
        ([0.01, 0.0, -0.0063], [-1.0, 0.0, 0.0], ContactPlace.TIP),
        ([0.0, 0.01, -0.0121], [0.0, -1.0, 0.0], ContactPlace.TIP),
    ):
        (contact,) = contacts_of(point, normal, [3.0], X_WH=X_WH)
        assert (contact.place, contact.force) == (place, pytest.approx(3.0))


def test_a_tip_on_the_chamfer_touches_the_mouth():
    for height in (-1e-5, -1e-4, -2.9e-4):
        (contact,) = contacts_of([0.0101, 0.0, height], [-np.sqrt(0.5), 0.0, np.sqrt(0.5)], [1.0], tip=-1e-4)
        assert contact.place is ContactPlace.MOUTH


def test_parts_of_one_contact_are_joined_and_opposite_sides_are_two():
    """Two forces of 3 and 4 N at a right angle have a sum of 5 N; the 2 N from the other side are another contact."""
    points = [[0.01, 0.0, -0.0004], [0.0, 0.01, -0.0008], [-0.01, 0.0, -0.0004], [0.0, 0.0, -0.0003]]
    normals = [[-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]
    strong, weak = contacts_of(points, normals, [4.0, 3.0, 2.0, 0.0])
    assert (strong.place, weak.place) == (ContactPlace.MOUTH, ContactPlace.MOUTH)
    assert strong.force == pytest.approx(5.0)
    np.testing.assert_allclose(strong.normal, [-0.8, -0.6, 0.0], atol=1e-12)
    np.testing.assert_allclose(strong.point, [0.04 / 7, 0.03 / 7, -(4 * 0.0004 + 3 * 0.0008) / 7], atol=1e-12)
    assert weak.force == pytest.approx(2.0)


def test_nothing_touches_without_a_force():
    assert contacts_of([0.01, 0.0, -0.001], [-1.0, 0.0, 0.0], [0.0]) == []
    assert contacts_of(np.zeros((0, 3)), np.zeros((0, 3)), []) == []


class Probed:
    """A planar probe, and the normal forces of its last step."""

    def __init__(self, scenario, **parameters):
        self.scenario, self.probe = scenario, ContactProbe(scenario, **parameters)
        plant = self.probe.plant
        self.peg, self.block = plant.GetBodyByName("peg"), plant.GetBodyByName("block")
        self.context = plant.GetMyContextFromRoot(self.probe._simulator.get_context())

    def parts(self):
        return hydroelastic_forces(
            self.probe.plant,
            self.context,
            peg=self.peg,
            block=self.block,
            dissipation=self.scenario.contact.dissipation,
        )

    def net_force(self):
        """Force of the contact on the peg in W, N, as Drake reports it."""
        results = self.probe.plant.get_contact_results_output_port().Eval(self.context)
        if not results.num_hydroelastic_contacts():
            return np.zeros(3)
        info = results.hydroelastic_contact_info(0)
        assert not info.contact_surface().HasGradE_M()  # the compliant peg is N, and the force is the one on M
        return -info.F_Ac_W().translational()


@pytest.fixture
def stiff(quick_scenario):
    quick_scenario.contact.modulus, quick_scenario.contact.time_step = 1e11, 5e-4
    quick_scenario.contact.friction = 1e-9
    return quick_scenario


@pytest.mark.parametrize("approximation", ["lagged", "similar"])
@pytest.mark.parametrize("free", [("x",), ("x", "tilt")])
def test_the_normal_forces_sum_to_the_net_force_in_every_step_of_an_impact(stiff, approximation, free):
    """Without friction there is no other force."""
    stiff.contact.approximation, stiff.contact.time_step = approximation, 2e-3
    probed = Probed(stiff, mass=0.15, inertia=3e-4, damping=(10.0, 0.0, 0.01))
    probed.probe.place(PlanarPose(0.0, PegTheory.of(stiff).mouth - 0.008, 0.004))
    probed.probe.hold(*(name for name in AXES if name not in free))
    probed.probe.load(8.0, 0.0, 0.0)
    net, errors = [], []
    for _ in range(25):
        probed.probe.step()
        parts = probed.parts()
        net.append(np.linalg.norm(probed.net_force()))
        errors.append(np.linalg.norm(parts.forces @ parts.normals - probed.net_force()))
    assert max(net) > 8.0
    assert max(errors) < 0.01 * max(net)
