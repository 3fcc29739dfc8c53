import math

import numpy as np
import pytest
from pydrake.geometry import HydroelasticContactRepresentation
from pydrake.math import RigidTransform
from pydrake.multibody.plant import ContactModel
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from experiments.trial.trial_set import trial_scenario
from models.scenario import Geometry, Scenario
from systems.plant.contact_plant import (
    ALUMINIUM,
    MOUNT_MASS,
    STEEL,
    AddRigPlant,
    AddVirtualPlant,
    NominalBodies,
    peg_shape,
)
from tests.systems.plant.engine_bench import Bench, hanging_weight


@pytest.fixture
def scenario(quick_scenario):
    quick_scenario.rig.pivot_height = 0.0
    return quick_scenario


# rig


def bench_of(scenario):
    """A bench whose feed holds all that the screw carries, its plant, and the context of the plant."""
    scenario.contact.engine = "drake"
    bench = Bench(scenario, force=hanging_weight(scenario)).start(tip_z=0.02)
    plant = bench.plant.plant
    return bench, plant, plant.GetMyMutableContextFromRoot(bench.simulator.get_mutable_context())


def test_the_block_is_an_aluminium_cylinder_from_below_the_floor_to_the_mouth(scenario):
    """12 mm of hole and 10 mm of floor, 30 mm in radius, 2700 kg/m^3: 0.16795 kg, and its centre is 11 mm deep.

    About the mouth: m r^2/2 = 7.558e-5 kg m^2 along z, m (r^2/4 + h^2/3) = 6.488e-5 kg m^2 across.
    The peg has 40 mm of steel, 10 mm in radius: 0.09865 kg.
    """
    rig = AddRigPlant(DiagramBuilder(), scenario)
    inertia = rig.block.default_spatial_inertia()
    assert inertia.get_mass() == pytest.approx(0.16795, rel=1e-4)
    np.testing.assert_allclose(inertia.get_com(), [0.0, 0.0, -0.011], atol=1e-15)
    moments = inertia.CalcRotationalInertia().get_moments()
    np.testing.assert_allclose(moments, [6.488e-5, 6.488e-5, 7.558e-5], rtol=1e-3)
    assert rig.peg.default_mass() == pytest.approx(0.09865, rel=1e-4)
    np.testing.assert_allclose(rig.peg.default_com(), [0.0, 0.0, 0.020], atol=1e-15)


@pytest.mark.parametrize(("axis", "name", "force"), [(0, "mount_x", -30.0), (1, "mount_y", 100.0)])
def test_a_lateral_force_deflects_the_mount_by_5_micrometres_per_newton(scenario, axis, name, force):
    """The default mount has 200 N/mm."""
    bench, plant, own = bench_of(scenario)
    loads = np.zeros(plant.num_velocities())
    loads[plant.GetJointByName(name).velocity_start()] = force
    plant.get_applied_generalized_force_input_port().FixValue(own, loads)
    bench.advance(0.3)
    assert bench.plant.peg.EvalPoseInWorld(own).translation()[axis] == pytest.approx(5e-6 * force, rel=1e-3)


def test_a_released_mount_vibrates_at_its_frequency_and_decays_with_its_damping(scenario):
    """m x'' + B x' + K x = 0 with m the slide and the peg: exp(-B t/2m) (cos w_d t + B/(2 m w_d) sin w_d t)."""
    scenario.contact.time_step = 1e-5
    bench, plant, own = bench_of(scenario)
    joint = plant.GetJointByName("mount_y")
    joint.set_translation(own, 1e-4)
    mass = MOUNT_MASS + plant.GetBodyByName("peg").default_mass()
    decay = 100.0 / (2.0 * mass)  # in units of 1/s; the default damping is 100 N s/m
    w = math.sqrt(2.0e5 / mass - decay**2)
    for t in np.arange(1, 9) * 0.5e-3:
        bench.advance(0.5e-3)
        expected = 1e-4 * math.exp(-decay * t) * (math.cos(w * t) + decay / w * math.sin(w * t))
        assert joint.get_translation(own) == pytest.approx(expected, abs=2e-6)


def test_a_coasting_carriage_slows_down_by_its_viscous_friction(scenario):
    """(m + I N^2) v' = -b v: with b = 5 N s/m and 2.58 kg, the speed falls to 1/e in 0.52 s."""
    bench, plant, own = bench_of(scenario)
    joint = plant.GetJointByName("feed")
    joint.set_translation_rate(own, 0.05)
    bench.advance(0.5)
    assert joint.get_translation_rate(own) == pytest.approx(0.05 * math.exp(-5.0 * 0.5 / 2.58), rel=5e-3)


# virtual environment


def virtual(scenario):
    builder = DiagramBuilder()
    contact = AddVirtualPlant(builder, scenario)
    contact.plant.get_applied_spatial_force_input_port()
    simulator = Simulator(builder.Build())
    own = contact.plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    return contact, simulator, own


def test_a_virtual_peg_has_the_mass_and_inertia_of_the_coupling(scenario):
    contact, _, own = virtual(scenario)
    inertia = contact.peg.CalcSpatialInertiaInBodyFrame(own)
    assert inertia.get_mass() == pytest.approx(scenario.coupling.peg_mass)
    np.testing.assert_array_equal(inertia.get_com(), np.zeros(3))
    np.testing.assert_allclose(
        inertia.CalcRotationalInertia().CopyToFullMatrix3(), scenario.coupling.peg_inertia * np.eye(3), rtol=1e-9
    )


@pytest.mark.parametrize("add", [AddVirtualPlant, AddRigPlant])
def test_peg_and_bore_have_the_facets_and_the_material_of_the_scenario(add, scenario):
    contact = add(DiagramBuilder(), scenario)
    assert contact.plant.get_contact_model() == ContactModel.kHydroelastic
    g = scenario.geometry
    inspector = contact.scene_graph.model_inspector()
    peg = inspector.GetProximityProperties(contact.plant.GetCollisionGeometriesForBody(contact.peg)[0])
    hint = peg.GetProperty("hydroelastic", "resolution_hint")
    assert math.ceil(2 * math.pi * g.peg_radius / hint) == g.facets
    assert peg.GetProperty("hydroelastic", "hydroelastic_modulus") == scenario.contact.modulus
    for body in (contact.peg, contact.block):
        properties = inspector.GetProximityProperties(contact.plant.GetCollisionGeometriesForBody(body)[0])
        assert properties.GetProperty("material", "coulomb_friction").dynamic_friction() == scenario.contact.friction


@pytest.mark.parametrize(("fixture", "touches"), [("free", True), ("rig", False)])
def test_only_a_peg_with_six_freedoms_can_touch_the_outer_side_of_the_block(quick_scenario, fixture, touches):
    """The contact mesh of the block is closed where the peg may leave the axis of the hole."""
    quick_scenario.fixture = fixture
    g = quick_scenario.geometry
    builder = DiagramBuilder()
    contact = AddVirtualPlant(builder, quick_scenario)
    diagram = builder.Build()
    root = diagram.CreateDefaultContext()
    below_the_top = -g.peg_length - 2e-3
    beside = RigidTransform([g.block_radius + g.peg_radius - 5e-4, 0.0, below_the_top])
    contact.plant.SetFreeBodyPose(contact.plant.GetMyMutableContextFromRoot(root), contact.peg, beside)
    port = contact.scene_graph.get_query_output_port()
    query = port.Eval(contact.scene_graph.GetMyContextFromRoot(root))
    surfaces = query.ComputeContactSurfaces(HydroelasticContactRepresentation.kPolygon)
    assert bool(surfaces) == touches


def test_the_feed_moves_carriage_mount_and_peg_and_the_steppers_turn_rings_block_and_rotor():
    """By hand: rig.sdf gives 0.8 kg, and 3e-4 and 2e-4 kg m^2 of the rings about x; nobody knows the true pivot."""
    scenario = trial_scenario(Scenario(), number=0)
    scenario.rig.pivot_height = 0.001
    g = scenario.geometry
    known = NominalBodies.of(scenario)
    peg = STEEL * np.pi * g.peg_radius**2 * g.peg_length
    assert known.mass == pytest.approx(0.8 + 0.1 + peg)
    assert known.peg_weight == pytest.approx(9.81 * peg)
    height = g.hole_depth + g.floor
    block = ALUMINIUM * np.pi * g.block_radius**2 * height
    about_pivot = block * (g.block_radius**2 / 4.0 + height**2 / 12.0 + (0.5 * height) ** 2)
    expected = 3e-4 + 2e-4 + about_pivot + scenario.stepper.reflected_inertia
    assert known.turning_inertia == pytest.approx(expected, rel=1e-6)


def test_a_scaled_picture_of_a_square_peg_has_the_same_centre():
    geometry = Geometry(section="square")
    X_PC, shape = peg_shape(geometry, 0.98)
    text = shape.source().in_memory().mesh_file.contents().decode()
    vertices = np.array([[float(x) for x in line.split()[1:]] for line in text.splitlines() if line.startswith("v ")])
    points = vertices + X_PC.translation()
    np.testing.assert_allclose(points.max(axis=0)[:2], 0.98 * geometry.peg_radius, rtol=1e-6)
    ends = (0.01 * geometry.peg_length, 0.99 * geometry.peg_length)
    assert (points[:, 2].min(), points[:, 2].max()) == pytest.approx(ends)


def test_the_square_peg_of_the_rig_weighs_what_its_prism_does():
    scenario = Scenario()
    scenario.geometry.section, scenario.rig.pivot_height = "square", 0.0
    area = (2.0 * 0.010) ** 2 - (4.0 - math.pi) * 0.0005**2
    plant = AddRigPlant(DiagramBuilder(), scenario)
    assert plant.peg.default_mass() == pytest.approx(STEEL * area * scenario.geometry.peg_length)
