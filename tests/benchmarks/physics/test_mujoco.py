"""The bodies in MuJoCo against hand-worked statics, exact geometry and a whole insertion."""

import math

import numpy as np
import pytest

mujoco = pytest.importorskip("mujoco", reason="needs the extra [peers]")

from pydrake.systems.analysis import Simulator  # noqa: E402
from pydrake.systems.framework import DiagramBuilder  # noqa: E402
from pydrake.systems.primitives import ConstantVectorSource  # noqa: E402

from benchmarks.physics.contact_measurements import CRAWLING, PegTheory, crawl  # noqa: E402
from benchmarks.physics.contact_probe import PlanarPose  # noqa: E402
from benchmarks.physics.mujoco_model import MujocoContact, MujocoProbe, rig_document  # noqa: E402
from benchmarks.physics.mujoco_plant import MujocoPlant  # noqa: E402
from models.contact_geometry import PegInHole, axes_of_rotation_vectors  # noqa: E402
from models.scenario import Scenario  # noqa: E402
from systems.plant.contact_plant import ALUMINIUM, STEEL, AddRigPlant  # noqa: E402
from systems.rig import WireRig  # noqa: E402
from systems.runs.trial import run_rig, trial_scenario  # noqa: E402
from tests.diagrams import unconnected_inputs  # noqa: E402

G = 9.81


@pytest.fixture
def scenario(quick_scenario):
    quick_scenario.rig.pivot_height = 0.0
    return quick_scenario


class Bench:
    """MuJoCo's plant alone, with a constant force on the carriage and a constant equilibrium of the gimbal."""

    def __init__(self, scenario, *, force=0.0, equilibrium=(0.0, 0.0)):
        builder = DiagramBuilder()
        self.scenario = scenario
        self.plant = MujocoPlant.AddToBuilder(builder, scenario, MujocoContact())
        for value, port in (
            ([force], self.plant.carriage_force),
            ([*equilibrium, 0, 0], self.plant.gimbal_equilibrium),
        ):
            builder.Connect(builder.AddSystem(ConstantVectorSource(value)).get_output_port(), port)
        self.simulator = Simulator(builder.Build())

    def start(self, *, tip_z, pitch=0.0, yaw=0.0):
        carriage = self.scenario.sensor.height + tip_z
        self.plant.set_start(self.simulator.get_mutable_context(), carriage=carriage, pitch=pitch, yaw=yaw)
        return self

    def advance(self, seconds):
        self.simulator.AdvanceTo(self.simulator.get_context().get_time() + seconds)
        return self

    def held(self):
        own = self.plant.GetMyContextFromRoot(self.simulator.get_context())
        felt = self.plant.reaction_forces.Eval(own)[self.plant.sensor]
        return np.concatenate([felt.translational(), felt.rotational()])

    def gimbal(self):
        return self.plant.gimbal_state.Eval(self.plant.GetMyContextFromRoot(self.simulator.get_context()))


def hanging(scenario):
    """Weight of all that hangs on the screw, N, as Drake's plant has it."""
    plant = AddRigPlant(DiagramBuilder(), scenario).plant
    names = ("carriage", "mount_x", "mount_y", "peg")
    return G * sum(plant.GetBodyByName(name).default_mass() for name in names)


def test_the_sensor_reads_the_pegs_weight_in_free_air(scenario):
    g = scenario.geometry
    bench = Bench(scenario, force=hanging(scenario)).start(tip_z=0.01).advance(0.05)
    weight = G * STEEL * math.pi * g.peg_radius**2 * g.peg_length
    assert bench.plant.weight == pytest.approx(weight, rel=1e-4)
    np.testing.assert_allclose(bench.held(), [0, 0, weight, 0, 0, 0], atol=1e-4)
    assert bench.plant.tip_height(bench.simulator.get_context()) == pytest.approx(0.01, abs=1e-6)


def test_a_peg_pressed_on_the_floor_of_the_hole_reads_the_force_it_is_pressed_with(scenario):
    push = 8.0
    bench = Bench(scenario, force=hanging(scenario) - push).start(tip_z=-scenario.geometry.hole_depth).advance(0.3)
    np.testing.assert_allclose(bench.held()[:3], [0, 0, bench.plant.weight - push], atol=0.02)
    sunk = -bench.plant.tip_height(bench.simulator.get_context()) - scenario.geometry.hole_depth
    assert 0 < sunk < 1e-4


def test_the_mount_yields_by_force_over_stiffness_and_the_sensor_feels_the_lever(scenario):
    model = mujoco.MjModel.from_xml_string(rig_document(scenario, MujocoContact()))
    data = mujoco.MjData(model)
    data.qpos[model.joint("feed").qposadr[0]] = scenario.sensor.height + 0.01
    data.ctrl[0] = hanging(scenario)
    force = np.array([12.0, -7.0, 0.0])  # at the peg's centre of mass
    data.xfrc_applied[model.body("peg").id, :3] = force
    mujoco.mj_step(model, data, nstep=200)
    moved = [data.qpos[model.joint(name).qposadr[0]] for name in ("mount_x", "mount_y")]
    np.testing.assert_allclose(moved, force[:2] / scenario.rig.mount_stiffness, rtol=1e-3)
    lever = np.array([0.0, 0.0, 0.5 * scenario.geometry.peg_length - scenario.sensor.height])
    np.testing.assert_allclose(data.sensordata[:2], -force[:2], rtol=1e-3)
    np.testing.assert_allclose(data.sensordata[3:], -np.cross(lever, force), rtol=1e-3, atol=1e-6)


def test_the_hanging_block_turns_a_stepper_by_torque_over_stiffness(scenario):
    g, angle = scenario.geometry, 0.05
    height = g.hole_depth + g.floor
    weight = G * ALUMINIUM * math.pi * g.block_radius**2 * height  # half a height below the axes
    bench = Bench(scenario, force=hanging(scenario), equilibrium=(angle, 0.0)).start(tip_z=0.02, pitch=angle)
    measured = bench.advance(0.3).gimbal()[0]
    expected = -weight * 0.5 * height * math.sin(angle) / scenario.stepper.stiffness
    assert measured - angle == pytest.approx(expected, rel=0.01)


def test_an_overloaded_stepper_gives_its_holding_torque_and_no_more(scenario):
    model = mujoco.MjModel.from_xml_string(rig_document(scenario, MujocoContact()))
    data = mujoco.MjData(model)
    data.ctrl[1] = 0.5  # rad: 320 N m, were it not limited
    mujoco.mj_forward(model, data)
    assert data.actuator_force[1] == pytest.approx(scenario.stepper.holding_torque)


@pytest.mark.parametrize(("tilt", "deep"), [(0.0, (-0.004, 5e-5)), (0.01, (-0.012, 5e-5)), (0.04, (-0.004, -0.001))])
def test_the_ring_of_boxes_is_the_exact_bore(tilt, deep):
    """A peg that overlaps by some micrometres, by exact geometry and as MuJoCo sees it."""
    scenario = Scenario()
    g = scenario.geometry
    bodies = PegInHole(g.peg_radius, g.hole_radius, g.hole_depth, g.chamfer)
    probe = MujocoProbe(scenario, MujocoContact())
    axis = axes_of_rotation_vectors([[0.0, tilt, 0.0]])
    rng = np.random.default_rng(1)
    compared = 0
    for x, z in zip(rng.uniform(-4e-4, 4e-4, 300), rng.uniform(*deep, 300), strict=True):
        gap = bodies.gap([[x, 0.0, z]], axis)[0]
        if not -3e-5 < gap < -1e-6:
            continue
        probe.place(PlanarPose(x, z, tilt))
        mujoco.mj_forward(probe.model, probe.data)
        assert min(c.dist for c in probe.data.contact) == pytest.approx(gap, abs=0.02 * abs(gap) + 1e-7)
        compared += 1
    assert compared > 3


def test_a_slowly_sliding_peg_is_resisted_as_whitneys_balance_says():
    scenario = Scenario()
    probe = MujocoProbe(scenario, MujocoContact(), **CRAWLING)
    sizes, friction = PegTheory.of(scenario), scenario.contact.friction
    predicted, measured = crawl(probe, sizes, friction, lateral=0.0, moment=0.2, depth=0.020)
    assert measured.mean() == pytest.approx(predicted, rel=0.08)


def test_a_held_axis_does_not_move():
    probe = MujocoProbe(Scenario(), MujocoContact())
    probe.place(PlanarPose(0.0, 0.01, 0.02))
    probe.load(1.0, -1.0, 0.1)
    probe.hold("tilt")
    probe.step(10)
    assert probe.pose().tilt == pytest.approx(0.02, abs=1e-9)
    assert probe.pose().x == pytest.approx(0.5 * 1.0 / 0.5 * (10 * probe.time_step) ** 2, rel=0.2)
    probe.hold()
    probe.step(10)
    assert probe.pose().tilt > 0.021


def test_both_engines_start_with_the_peg_in_the_same_place(scenario):
    scenario.rig.pivot_height = 0.002
    poses = []
    for add in (AddRigPlant, lambda builder, scenario: MujocoPlant.AddToBuilder(builder, scenario, MujocoContact())):
        builder = DiagramBuilder()
        plant = add(builder, scenario)
        context = builder.Build().CreateDefaultContext()
        plant.set_start(context, carriage=0.081, pitch=0.04, yaw=-0.03)
        poses.append(plant.peg_in_hole(context).GetAsMatrix34())
    np.testing.assert_allclose(poses[0], poses[1], atol=1e-12)


def test_two_contexts_do_not_disturb_each_other(scenario):
    """The plant computes in a place that belongs to the context."""
    bench = Bench(scenario, force=hanging(scenario) - 5.0)
    alone, first, second = (Simulator(bench.simulator.get_system()) for _ in range(3))
    for simulator, pitch in ((alone, 0.03), (first, 0.03), (second, -0.01)):
        bench.plant.set_start(
            simulator.get_mutable_context(), carriage=scenario.sensor.height - 1e-4, pitch=pitch, yaw=0.0
        )
    alone.AdvanceTo(0.1)
    for t in (0.03, 0.06, 0.1):
        first.AdvanceTo(t)
        second.AdvanceTo(t)
    states = [s.get_context().get_discrete_state(0).value() for s in (alone, first, second)]
    np.testing.assert_array_equal(states[0], states[1])
    assert not np.array_equal(states[0], states[2])


def test_a_step_that_does_not_fill_the_period_is_refused(scenario):
    with pytest.raises(ValueError, match=r"MuJoCo's time step is 0.0007 s, expected a part of contact.time_step"):
        MujocoPlant(scenario, MujocoContact(time_step=7e-4))


def test_the_skill_inserts_in_the_other_engine_too(quick_scenario, skill):
    quick_scenario.start.tilt = [0.04, -0.035]
    quick_scenario.trial.time_limit = 8.0
    resolved = trial_scenario(quick_scenario, number=1000)
    builder = DiagramBuilder()
    rig = WireRig(builder, resolved, skill, MujocoPlant.AddToBuilder(builder, resolved, MujocoContact()))
    assert unconnected_inputs(rig.diagram) == set()
    result, run = run_rig(rig, resolved, skill, seed=1000)
    assert result.reason == "inserted"
    assert result.depth_mm == pytest.approx(1e3 * resolved.full_depth, abs=0.1)
    assert result.steps > 0
    assert np.isfinite(run.samples.to_numpy()).all()
