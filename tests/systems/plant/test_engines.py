"""The plants of both engines, against hand-worked statics, each other and a whole insertion."""

import math

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator

from models.hardware import STEEL
from skill.data.rig_run import ContactPlace
from systems.plant.contact_plant import ALUMINIUM, NominalBodies
from systems.plant.exact_contact import STEPS
from tests.systems.plant.engine_bench import Bench, G, hanging_weight


@pytest.fixture(params=["exact", "drake"])
def scenario(quick_scenario, request):
    quick_scenario.rig.pivot_height, quick_scenario.contact.engine = 0.0, request.param
    return quick_scenario


def test_in_free_air_nothing_touches_and_the_sensor_reads_the_pegs_weight(scenario):
    g = scenario.geometry
    bench = Bench(scenario, force=hanging_weight(scenario)).start(tip_z=0.01).advance(0.05)
    weight = G * STEEL * math.pi * g.peg_radius**2 * g.peg_length
    assert bench.plant.weight == pytest.approx(weight, rel=1e-4)
    np.testing.assert_allclose(bench.held(), [0, 0, weight, 0, 0, 0], atol=1e-4)
    root = bench.simulator.get_context()
    assert bench.plant.tip_height(root) == pytest.approx(0.01, abs=1e-6)
    assert bench.plant.contacts(root) == []
    assert bench.plant.contact_extent(root) == 0.0


def test_the_hanging_block_turns_a_stepper_by_torque_over_stiffness(scenario):
    g, angle = scenario.geometry, 0.05
    height = g.hole_depth + g.floor
    weight = G * ALUMINIUM * math.pi * g.block_radius**2 * height  # half a height below the axes
    bench = Bench(scenario, force=hanging_weight(scenario), equilibrium=(angle, 0.0)).start(tip_z=0.02, pitch=angle)
    measured = bench.advance(0.3).gimbal()[0]
    expected = -weight * 0.5 * height * math.sin(angle) / scenario.stepper.stiffness
    assert measured - angle == pytest.approx(expected, rel=0.01)


def test_a_stepper_turns_the_block_with_its_holding_torque_at_most(scenario):
    bench = Bench(scenario, force=hanging_weight(scenario), equilibrium=(0.5, 0.0)).start(tip_z=0.02).advance(0.002)
    torque = bench.gimbal()[2] / 0.002 * NominalBodies.of(scenario).turning_inertia
    assert 0.5 * scenario.stepper.stiffness > 5.0 * scenario.stepper.holding_torque
    assert torque == pytest.approx(scenario.stepper.holding_torque, rel=0.02)


def test_a_released_axis_is_driven_by_the_spring_and_the_damper_of_its_stepper(scenario):
    """A step of implicit Euler: (J + h d + h^2 K) v = J v_0 - h K theta, with or without smaller steps."""
    stepper, inertia = scenario.stepper, NominalBodies.of(scenario).turning_inertia
    steps = STEPS if scenario.contact.engine == "exact" else 1
    h, theta, v = scenario.contact.time_step / steps, 1e-3, 0.0
    bench = Bench(scenario, force=hanging_weight(scenario)).start(tip_z=0.02, pitch=theta)
    for _ in range(4 * steps):
        v = (inertia * v - h * stepper.stiffness * theta) / (inertia + h * stepper.damping + h**2 * stepper.stiffness)
        theta += h * v
    found = bench.advance(4 * scenario.contact.time_step).gimbal()
    np.testing.assert_allclose([found[0], found[2]], [theta, v], rtol=0.02)


def test_two_contexts_do_not_disturb_each_other(scenario):
    """The plant computes in a work space of the context."""
    bench = Bench(scenario, force=hanging_weight(scenario) - 5.0)
    alone, first, second = (Simulator(bench.simulator.get_system()) for _ in range(3))
    for simulator, pitch in ((alone, 0.03), (first, 0.03), (second, -0.01)):
        carriage = scenario.sensor.height - 1e-4
        bench.plant.set_start(simulator.get_mutable_context(), carriage=carriage, angles=(pitch, 0.0))
    alone.AdvanceTo(0.1)
    for t in (0.03, 0.06, 0.1):
        first.AdvanceTo(t)
        second.AdvanceTo(t)
    states = [s.get_context().get_discrete_state(0).value() for s in (alone, first, second)]
    np.testing.assert_array_equal(states[0], states[1])
    assert not np.array_equal(states[0], states[2])


def test_contacts_and_sensor_have_the_force_that_presses_the_peg_on_the_floor(scenario):
    push = 8.0
    bench = Bench(scenario, force=hanging_weight(scenario) - push).start(tip_z=-scenario.geometry.hole_depth)
    root = bench.advance(0.3).simulator.get_context()
    pressed = [contact for contact in bench.plant.contacts(root) if contact.force > 0.01]
    assert [contact.place for contact in pressed] == [ContactPlace.FACE]
    assert pressed[0].force == pytest.approx(push, rel=0.01)
    np.testing.assert_allclose(pressed[0].normal, [0.0, 0.0, 1.0], atol=1e-3)
    assert pressed[0].point[2] == pytest.approx(-scenario.geometry.hole_depth, abs=1e-4)
    np.testing.assert_allclose(bench.held()[:3], [0, 0, bench.plant.weight - push], atol=0.02)
    assert 0 < -bench.plant.tip_height(root) - scenario.geometry.hole_depth < 1e-4
    assert bench.plant.contact_extent(root) > 0.0


def test_the_block_that_leans_on_the_peg_has_the_moment_of_its_contacts(scenario):
    """The gimbal turns the block against the upright peg: mouth and wall push it from opposite sides."""
    bench = Bench(scenario, force=hanging_weight(scenario), equilibrium=(0.02, 0.0)).start(tip_z=-0.010)
    root = bench.advance(0.3).simulator.get_context()
    contacts = {contact.place: contact for contact in bench.plant.contacts(root)}
    held, tip = bench.held(), bench.plant.tip_height(root)
    force = sum(contact.force * contact.normal for contact in contacts.values())
    mouth, end = contacts[ContactPlace.MOUTH], contacts[ContactPlace.TIP]
    assert mouth.normal[1] * end.normal[1] < -0.9
    assert mouth.point[2] > end.point[2] > tip - 1e-3
    # The mount balances the contact. What is missing of the lateral force is friction around the peg.
    np.testing.assert_allclose(force[:2], -held[:2], atol=0.1 * mouth.force)
    sensor = np.array([0.0, 0.0, tip + scenario.sensor.height])
    moment = sum(np.cross(c.point - sensor, c.force * c.normal) for c in contacts.values())
    np.testing.assert_allclose(moment[:2], -held[3:5], atol=0.1 * abs(moment[0]))
