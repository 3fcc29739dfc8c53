"""A peg on a compliance, against hand-worked statics and dynamics."""

import math

import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.systems.analysis import Simulator

from models.scenario import TRIAL_STREAM, load_scenario, resolve_scenario
from systems.plant.held_peg import HeldPeg, held_wrench


@pytest.fixture
def scenario():
    return resolve_scenario(load_scenario("fr3"), seed=0, stream=TRIAL_STREAM)


class Bench:
    """A peg whose anchor is fixed."""

    def __init__(self, scenario, X_WA):
        self.dut = HeldPeg(scenario, period=1e-3)
        self.simulator = Simulator(self.dut)
        self.context = self.simulator.get_mutable_context()
        pose = [*X_WA.rotation().ToQuaternion().wxyz(), *X_WA.translation()]
        self.dut.GetInputPort("anchor").FixValue(self.context, [*pose, *np.zeros(6)])
        self.dut.set_start(self.context, X_WA)

    def settle(self, seconds=0.3):
        self.simulator.AdvanceTo(self.context.get_time() + seconds)
        return self

    @property
    def tip(self):
        return self.dut.pose(self.context).translation()

    def held(self):
        return np.array(self.dut.GetOutputPort("held_wrench").Eval(self.context))


def test_in_free_air_the_peg_sags_by_its_weight_over_the_stiffness(scenario):
    bench = Bench(scenario, RigidTransform([0.0, 0.0, 0.02])).settle()
    c = bench.dut.compliance
    assert 0.02 - bench.tip[2] == pytest.approx(c.weight / scenario.arm.axial_stiffness, rel=1e-3)
    np.testing.assert_allclose(bench.held(), [0, 0, 0, 0, 0, c.weight], atol=1e-6)
    assert bench.dut.contacts(bench.context) == []
    reaction = bench.dut.GetOutputPort("reaction_forces").Eval(bench.context)[0]
    np.testing.assert_allclose(reaction.translational(), [0, 0, c.weight], atol=1e-6)


def test_the_compliance_acts_along_the_axes_of_the_anchor(scenario):
    R = RollPitchYaw(0.3, -0.2, 0.1).ToRotationMatrix()
    c = Bench(scenario, RigidTransform()).dut.compliance
    anchor = np.array([*R.ToQuaternion().wxyz(), *np.zeros(9)])
    q = np.array([*R.ToQuaternion().wxyz(), *(R @ np.array([1e-4, 0.0, -1e-5]))])
    arm, rate, speed = scenario.arm, np.array([0.0, 0.0, 0.3]), np.array([0.0, 0.02, 0.0])
    found = held_wrench(c, q, np.concatenate([R @ rate, R @ speed]), anchor)
    lateral, axial = -1e-4 * arm.lateral_stiffness, 1e-5 * arm.axial_stiffness
    damped = -0.02 * 2.0 * arm.damping_ratio * math.sqrt(arm.lateral_stiffness * c.inertia[3])
    twist = -0.3 * 2.0 * arm.damping_ratio * math.sqrt(arm.torsional_stiffness * arm.held_inertia)
    np.testing.assert_allclose(found, [*(R @ [0, 0, twist]), *(R @ [lateral, damped, axial])], atol=1e-9)


def test_a_hole_beside_where_one_believes_it_meets_the_peg_there(scenario):
    scenario.arm.hole_offset = [3e-4, -2e-4]
    bench = Bench(scenario, RigidTransform([0.0, 0.0, 0.003]))
    np.testing.assert_allclose(bench.dut.peg_in_hole(bench.context).translation(), [-3e-4, 2e-4, 0.003], atol=1e-12)


def test_its_angles_are_those_of_a_rig_with_the_same_orientation(scenario):
    R_WH = (
        RollPitchYaw(0.05, 0, 0).ToRotationMatrix()
        @ RollPitchYaw(0, -0.03, 0).ToRotationMatrix()
        @ RollPitchYaw(0, 0, 0.02).ToRotationMatrix()
    )
    bench = Bench(scenario, RigidTransform(R_WH.inverse(), [0.0, 0.0, 0.004]))
    found = bench.dut.GetOutputPort("as_on_rig").Eval(bench.context)
    np.testing.assert_allclose(found, [0.004, 0.05, -0.03, 0.02], atol=1e-12)


def test_a_press_on_the_floor_of_a_tilted_hole_is_along_its_axis(scenario):
    bench = Bench(scenario, RigidTransform())
    X_WH = RigidTransform(RollPitchYaw(0.3, -0.2, 0.1), [0.01, 0.02, 0.03])
    depth, c = scenario.geometry.hole_depth, bench.dut.compliance
    anchor = X_WH @ RigidTransform([0.0, 0.0, -depth - 5e-5])
    bench.dut.GetInputPort("anchor").FixValue(
        bench.context, [*anchor.rotation().ToQuaternion().wxyz(), *anchor.translation(), *np.zeros(6)]
    )
    bench.dut.set_hole(bench.context, X_WH)
    bench.dut.set_start(bench.context, X_WH @ RigidTransform([0.0, 0.0, -depth + 1e-4]))
    bench.settle()
    np.testing.assert_allclose(bench.dut.peg_in_hole(bench.context).translation()[2], -depth, atol=1e-6)
    axis = X_WH.rotation().matrix()[:, 2]
    assert bench.held()[3:] @ axis == pytest.approx(-5e-5 * scenario.arm.axial_stiffness, rel=0.02)
    contacts = bench.dut.contacts(bench.context)
    assert sum(contact.force for contact in contacts) == pytest.approx(
        c.weight * axis[2] - bench.held()[3:] @ axis, rel=0.02
    )
    np.testing.assert_allclose(
        [contact.normal for contact in contacts], np.tile([0, 0, 1], (len(contacts), 1)), atol=1e-6
    )
