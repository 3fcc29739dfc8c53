"""What a rig cannot know does not reach its control: by ports, constructor arguments or parameters of the Context."""

import copy
import functools
import inspect
from dataclasses import replace

import joblib
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder, EventStatus, PortDataType

from models.scenario import TRIAL_STREAM, resolve_scenario
from systems import rig as rig_module
from systems.law import wiring as law_module
from systems.law.dc_motor import DcMotor
from systems.law.depth_encoder import DepthEncoder
from systems.law.drive_monitor import DriveMonitor
from systems.law.estimator import PolicyEstimator
from systems.law.force_guard import ForceGuard
from systems.law.part import TIME, Part
from systems.law.policy_controller import PolicyController
from systems.law.sensor_monitor import SensorMonitor
from systems.law.stepper_motor import StepperMotor
from systems.law.watchdog import Watchdog
from systems.law.wrench_sensor import WrenchSensor
from systems.plant import contact_plant
from systems.rig import AddEngine, MakeRig, WireRig

SENSORS = {"wrench_sensor", "depth_encoder"}
CONTROL = (SensorMonitor, PolicyEstimator, PolicyController, Watchdog, ForceGuard, DriveMonitor)
MEASURED = (
    (law_module, WrenchSensor, {"wrench": "_calc_wrench"}, ["wrench_sensor"]),
    (rig_module, DepthEncoder, {"depth": "_calc"}, ["depth_encoder"]),
    (rig_module, DcMotor, {"current": None, "travel": None}, ["dc_motor"]),
    (rig_module, StepperMotor, {"shaft": None}, ["pitch_stepper", "yaw_stepper"]),
)
"""What a rig measures: the module that builds it, the kind of system, its ports with their methods, and its names; a
`Part` declares its ports without methods."""


@pytest.fixture
def scenario(quick_scenario):
    quick_scenario.start.height = 2e-4
    quick_scenario.start.tilt = [0.04, -0.03]
    return quick_scenario


def resolved(scenario):
    return resolve_scenario(scenario, seed=1, stream=TRIAL_STREAM)


def upstream(diagram, start, stop=frozenset()):
    """Returns the systems upstream of ``start``, and the connections to them; the search ends at ``stop``."""
    sources = {}
    for (system, _), (source, port) in diagram.connection_map().items():
        sources.setdefault(system.get_name(), set()).add((source.get_name(), source.get_output_port(port).get_name()))
    reached, edges, open_names = set(), set(), list(start)
    while open_names:
        name = open_names.pop()
        for source in sources.get(name, ()):
            edges.add((name, source))
            if source[0] not in reached:
                reached.add(source[0])
                if source[0] not in stop:
                    open_names.append(source[0])
    return reached, edges


def test_every_path_to_the_controller_passes_through_the_two_sensors_or_its_own_commands(scenario, skill):
    rig = MakeRig(resolved(scenario), skill)
    controlling = {"policy_controller", "policy_estimator"}
    own = {"force_guard"}
    reached, edges = upstream(rig.diagram, controlling, stop=SENSORS | own)
    assert reached == SENSORS | own | {"sensor_monitor", "policy_estimator"}
    # The sensors pass on a wrench and a depth, the guard the angles it commands, the estimator its estimate.
    assert {source for _, source in edges} == {
        ("wrench_sensor", "wrench"),
        ("depth_encoder", "depth"),
        ("sensor_monitor", "wrench"),
        ("sensor_monitor", "depth"),
        ("policy_estimator", "estimate"),
        ("force_guard", "target_pitch"),
        ("force_guard", "target_yaw"),
    }
    # The sensors read the reaction forces and the state of the carriage from the plant.
    _, behind = upstream(rig.diagram, SENSORS, stop={"plant"})
    assert {source for _, source in behind} == {("plant", "reaction_forces"), ("plant", "feed_state")}
    # The search works: if it does not end at the sensors, it reaches the motors.
    everything, _ = upstream(rig.diagram, controlling)
    assert {"plant", "dc_motor", "pitch_stepper"} <= everything


def control_systems(rig):
    found = [s for s in rig.diagram.GetSystems() if isinstance(s, CONTROL)]
    assert len(found) == 6
    return found


def outputs(systems, root):
    """Returns the values of all outputs of some systems, by their names; of those that are no vectors, a digest."""
    found = {}
    for system in systems:
        own = system.GetMyContextFromRoot(root)
        for port in (system.get_output_port(k) for k in range(system.num_output_ports())):
            vector, value = port.get_data_type() == PortDataType.kVectorValued, port.Eval(own)
            found[system.get_name(), port.get_name()] = value.tolist() if vector else joblib.hash(value)
    return found


def parameters(systems, root):
    """Returns the parameters of some systems, by their names."""
    found = {}
    for system in systems:
        own = system.GetMyContextFromRoot(root)
        abstract = [own.get_abstract_parameter(k).get_value() for k in range(own.num_abstract_parameters())]
        numeric = [own.get_numeric_parameter(k).value().tolist() for k in range(own.num_numeric_parameter_groups())]
        found[system.get_name()] = numeric, [joblib.hash(value) for value in abstract]
    return found


def run(rig, trial, names):
    """Returns the outputs of the named systems in every period of the sensor, and the parameters of the control."""
    simulator, found = Simulator(rig.diagram), []
    rig.set_trial(simulator.get_mutable_context(), trial)
    systems = [rig.diagram.GetSubsystemByName(name) for name in names]

    def monitor(context):
        if context.get_time() > (len(found) - 0.5) * trial.sensor.period:
            found.append(outputs(systems, context))
        return EventStatus.DidNothing()

    simulator.set_monitor(monitor)
    simulator.AdvanceTo(0.3)
    return found, parameters(control_systems(rig), simulator.get_context())


def replay(readings, period, monkeypatch):
    """Lets the rigs that are built from now on measure what was recorded, whatever happens."""

    def at(time):
        return readings[min(int(time / period + 0.5), len(readings) - 1)]

    def calc(self, context, output, *, port):
        output.SetFromVector(at(context.get_time())[self.get_name(), port])

    def declare_output(self, name, size, calc, *reads, ports):
        if name in ports:
            calc, reads = lambda state, time: at(time)[self.get_name(), name], [TIME]
        Part.declare_output(self, name, size, calc, *reads)

    for module, kind, ports, _ in MEASURED:
        if issubclass(kind, Part):
            replaying = {"declare_output": functools.partialmethod(declare_output, ports=ports)}
        else:
            replaying = {method: functools.partialmethod(calc, port=port) for port, method in ports.items()}
        monkeypatch.setattr(module, kind.__name__, type(kind.__name__, (kind,), replaying))


def hidden(scenario, share):
    """Returns a scenario that differs in all that a trial draws and in the mount."""
    other = resolve_scenario(scenario, seed=20 + round(10 * share), stream=TRIAL_STREAM)
    other.rig.pivot_height, other.contact.friction = 0.003 * share, 0.2 + 0.1 * share
    other.start.tilt = [0.04 - 0.02 * share, -0.03 + 0.02 * share]
    other.rig.mount_stiffness *= 1.0 + 0.3 * share
    other.rig.mount_damping *= 1.0 - 0.3 * share
    return other


def rig_with(scenario, skill, share, monkeypatch):
    """Returns a rig that is built with other masses, friction and clearance than it was designed with."""
    designed = hidden(scenario, share)
    built, g = copy.deepcopy(designed), scenario.geometry
    built.rig.carriage_friction *= 1.0 + 0.4 * share
    built.geometry = replace(
        g, hole_radius=g.hole_radius + 1e-5 * share, block_radius=g.block_radius * (1.0 + 0.02 * share)
    )
    builder = DiagramBuilder()
    with monkeypatch.context() as patch:
        for name in ("STEEL", "ALUMINIUM", "MOUNT_MASS"):
            patch.setattr(contact_plant, name, getattr(contact_plant, name) * (1.0 + 0.02 * share))
        plant = AddEngine(builder, built)
    return WireRig(builder, designed, skill, plant)


@pytest.fixture
def arguments(monkeypatch):
    """The constructor arguments of every system of control that is built from now on, as digests by their places."""
    found = []
    for kind in CONTROL:
        monkeypatch.setattr(kind, "__init__", noting(kind.__init__, found))
    return found


def noting(init, found):
    signature = inspect.signature(init)

    def noted(self, *args, **kwargs):
        given = signature.bind(self, *args, **kwargs).arguments
        found.append({name: joblib.hash(value) for name, value in given.items() if name != "self"})
        init(self, *args, **kwargs)

    return noted


@pytest.mark.parametrize("engine", ["drake", "exact"])
def test_the_control_is_built_from_nothing_that_is_hidden(scenario, skill, engine, arguments, monkeypatch):
    scenario.contact.engine = engine
    known = []
    for share in (-1.0, 0.0, 0.6):
        rig_with(scenario, skill, share, monkeypatch)
        known.append(arguments.copy())
        arguments.clear()
    assert len(known[0]) == 6
    assert known[1:] == known[:1] * 2
    scenario.controller.guard.force_limit += 1.0  # which it knows: the digests can differ
    rig_with(scenario, skill, 0.0, monkeypatch)
    assert arguments != known[0]


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["drake", "exact"])
def test_equal_measurements_give_bit_identical_control_whatever_is_hidden(scenario, skill, engine, monkeypatch):
    """The trials differ from what the diagrams were built of, too."""
    scenario.contact.engine = engine
    first = rig_with(scenario, skill, 0.0, monkeypatch)
    control = [system.get_name() for system in control_systems(first)]
    measured = [name for _, _, _, names in MEASURED for name in names]
    recorded, _ = run(first, first.scenario, measured)
    replay(recorded, scenario.sensor.period, monkeypatch)
    runs, poses = [], []
    for share in (-1.0, 0.6):
        rig = rig_with(scenario, skill, share, monkeypatch)
        trial = copy.deepcopy(rig.scenario)
        trial.rig.pivot_height, trial.contact.friction = -0.8 * trial.rig.pivot_height, 0.25 - 0.1 * share
        runs.append(run(rig, trial, control))
        poses.append(run(rig, trial, ["gimbal_angles"])[0])
    one, other = runs
    assert one == other
    assert max(abs(at["force_guard", "target_pitch"][0]) for at in one[0]) > 0.0
    assert poses[0] != poses[1]
