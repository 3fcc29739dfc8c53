"""The port block in the docstring of every LeafSystem matches the declared ports."""

import importlib
import inspect
import pkgutil

import numpy as np
import pytest
import yaml
from pydrake.math import RigidTransform
from pydrake.multibody.tree import BodyIndex
from pydrake.systems.framework import LeafSystem

import systems
from models.hardware import DEVICE_PRESETS
from models.scenario import TRIAL_STREAM, Scenario, load_scenario, resolve_scenario
from systems.arm.kinematics import ArmKinematics
from systems.law.drive_monitor import DriveLimits
from systems.law.force_guard import GuardLimits, StoppingModel
from systems.law.part import Part
from systems.law.policy_controller import ControllerLimits
from systems.law.sensor_monitor import SensorLimits
from systems.law.watchdog import COMMANDS, RetractLimits

S = Scenario()
X = RigidTransform()

TRIAL = resolve_scenario(S, seed=0, stream=TRIAL_STREAM)
ARM = resolve_scenario(load_scenario("fr3"), seed=0, stream=TRIAL_STREAM)
ARGUMENTS = {
    "HeldPeg": lambda skill: {"scenario": ARM, "period": 1e-3},
    "TipServo": lambda skill: {"scenario": ARM, "kinematics": ArmKinematics(ARM), "held_weight": 3.0},
    "TipMotion": lambda skill: {
        "scenario": ARM,
        "kinematics": ArmKinematics(ARM),
        "flange": BodyIndex(8),
        "p_FP": np.zeros(3),
    },
    "BodyPose": lambda skill: {"body": BodyIndex(1)},
    "DcMotor": lambda skill: {"parameters": S.feed, "period": 1e-3},
    "DemonstrationRecorder": lambda skill: {"period": 0.02, "X_HP_start": X},
    "DepthEncoder": lambda skill: {"home": 0.08, "resolution": 5e-6},
    "DeviceOperator": lambda skill: {"device": None, "period": 1e-3, "X_HD_start": X},
    "LocalPeg": lambda skill: {"scenario": S, "period": 1e-3, "X_HP_start": X},
    "ServedProbe": lambda skill: {"X_HD_start": X},
    "StaleContactFade": lambda skill: {"period": 1e-3},
    "PolicyEstimator": lambda skill: {"estimator": skill.estimator(), "period": 0.02},
    "HapticDevice": lambda skill: {"parameters": DEVICE_PRESETS["paper"], "X_HD_start": X},
    "HapticProxy": lambda skill: {
        "coupling": S.coupling,
        "fixture": lambda X_HP: None,
        "peg": BodyIndex(1),
    },
    "PolicyController": lambda skill: {
        "policy": skill,
        "limits": ControllerLimits.of(S, 0.02),
    },
    "ForceGuard": lambda skill: {
        "limits": GuardLimits.of(S),
        "stopping": StoppingModel(period=1e-3, delay=7e-3, deceleration=9.0, feed_impact=1600.0, turn_impact=340.0),
    },
    "DriveMonitor": lambda skill: {"limits": DriveLimits.of(S)},
    "SensorMonitor": lambda skill: {"limits": SensorLimits.of(S), "period": 1e-3},
    "ExactPeg": lambda skill: {"scenario": S},
    "ExactPlant": lambda skill: {"scenario": TRIAL},
    "PassivityObserver": lambda skill: {"period": 1e-3, "X_HD_start": X},
    "SimulatedOperator": lambda skill: {
        "operator": S.operator,
        "seed": 0,
        "start_height": 0.003,
        "tilt": [0.0, 0.0],
        "offset": [0.0, 0.0],
    },
    "StepperMotor": lambda skill: {"parameters": S.stepper, "period": 1e-3, "start_angle": 0.0},
    "Watchdog": lambda skill: {"limits": RetractLimits.of(S)},
    "WrenchSensor": lambda skill: {"parameters": S.sensor, "seed": 0, "weld": 0, "tare": np.zeros(6)},
}


def leaf_systems():
    """Yields every subclass of LeafSystem that a module of systems/ defines."""
    for module in pkgutil.walk_packages(systems.__path__, "systems."):
        loaded = importlib.import_module(module.name)
        for _, kind in inspect.getmembers(loaded, inspect.isclass):
            if issubclass(kind, LeafSystem) and kind.__module__ == loaded.__name__ and kind is not Part:
                yield kind


KINDS = sorted(leaf_systems(), key=lambda kind: kind.__name__)


def port_block(kind):
    """Returns the parsed ``.. pydrake_system::`` block of the docstring."""
    lines = inspect.cleandoc(kind.__doc__).splitlines()
    assert lines[0] == ".. pydrake_system::", f"{kind.__name__}: the docstring does not begin with the port block"
    block = []
    for line in lines[1:]:
        if line and not line.startswith(" "):
            break
        block.append(line)
    return yaml.safe_load("\n".join(block))


def test_the_table_names_every_leaf_system():
    assert [kind.__name__ for kind in KINDS] == sorted(ARGUMENTS)


@pytest.fixture(params=KINDS, ids=lambda kind: kind.__name__)
def kind(request):
    return request.param


@pytest.fixture
def dut(kind, skill):
    return kind(**ARGUMENTS[kind.__name__](skill))


def test_the_port_block_matches_the_declared_ports(kind, dut):
    block = port_block(kind)
    assert set(block) <= {"name", "input_ports", "output_ports"}
    assert block["name"] == kind.__name__
    inputs = [dut.get_input_port(k).get_name() for k in range(dut.num_input_ports())]
    outputs = [dut.get_output_port(k).get_name() for k in range(dut.num_output_ports())]
    assert block.get("input_ports", []) == inputs
    assert block.get("output_ports", []) == outputs


def test_only_the_listed_outputs_have_direct_feedthrough(dut, kind):
    """An output without declared prerequisites has feedthrough from every input; unlisted systems intend this."""
    feedthrough = {
        "DcMotor": {("carriage_state", "carriage_force"), ("carriage_state", "travel")},
        "DeviceOperator": set(),
        "ForceGuard": set(),
        "DriveMonitor": set(),
        "ExactPeg": set(),
        "ExactPlant": set(),
        "HapticDevice": {("virtual_wrench", "rendered_wrench")},
        "HeldPeg": set(),
        "TipServo": {("joint_state", "torques")},
        "TipMotion": {("joint_state", "anchor"), ("joint_state", "depth"), ("held_wrench", "forces")},
        "LocalPeg": set(),
        "StaleContactFade": {("virtual_wrench", "faded_wrench")},
        "PolicyController": set(),
        "SensorMonitor": {("raw_wrench", "wrench"), ("raw_depth", "depth")},
        "PassivityObserver": set(),
        "SimulatedOperator": set(),
        "StepperMotor": {("measured_angle", "shaft")},
        "Watchdog": {(name, name) for name in COMMANDS},
        "WrenchSensor": set(),
    }
    pairs = {
        (dut.get_input_port(i).get_name(), dut.get_output_port(o).get_name()): dut.HasDirectFeedthrough(i, o)
        for i in range(dut.num_input_ports())
        for o in range(dut.num_output_ports())
    }
    assert {pair for pair, found in pairs.items() if found} == feedthrough.get(kind.__name__, set(pairs))
