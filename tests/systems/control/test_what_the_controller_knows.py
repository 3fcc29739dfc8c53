"""The controller receives the measured wrench and depth and its own commands: no true pose or angle reaches it."""

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator

from models.scenario import TRIAL_STREAM, resolve_scenario
from skill.data.rig_run import CONTEXT_COLUMNS
from systems import law as law_module
from systems import rig as rig_module
from systems.hardware.depth_encoder import DepthEncoder
from systems.hardware.wrench_sensor import WrenchSensor
from systems.rig import MakeRig

SENSORS = {"wrench_sensor", "depth_encoder"}
COMMANDED = [*CONTEXT_COLUMNS, "target_pitch", "target_yaw", "feed_speed", "back_off", "state", "known", "support"]


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


def replaying(kind, port, readings, period):
    """Returns a sensor class that replays recorded readings, one per period, independent of its inputs."""

    class Replaying(kind):
        pass

    def calc(self, context, output):
        output.SetFromVector(np.atleast_1d(readings[min(int(context.get_time() / period + 0.5), len(readings) - 1)]))

    setattr(Replaying, port, calc)
    return Replaying


@pytest.mark.slow
def test_equal_readings_give_bit_identical_commands_for_different_true_poses(scenario, skill, monkeypatch):
    """Two rigs with opposite tilts and different heights receive the same recorded readings."""
    first = MakeRig(resolved(scenario), skill)
    period = scenario.controller.period

    def run(rig):
        simulator = Simulator(rig.diagram)
        rig.set_start(simulator.get_mutable_context())
        simulator.AdvanceTo(0.4)
        return rig.recorder.samples(simulator.get_context())

    recorded = run(first)
    wrenches, depths = recorded[["fx", "fy", "fz", "mx", "my", "mz"]].to_numpy(), recorded["depth"].to_numpy()
    monkeypatch.setattr(law_module, "WrenchSensor", replaying(WrenchSensor, "_calc_wrench", wrenches, period))
    monkeypatch.setattr(rig_module, "DepthEncoder", replaying(DepthEncoder, "_calc", depths, period))
    runs = []
    for tilt, height in (([0.04, -0.03], 2e-4), ([-0.05, 0.02], 1.2e-3)):
        scenario.start.tilt, scenario.start.height = tilt, height
        runs.append(run(MakeRig(resolved(scenario), skill)))
    one, other = runs
    np.testing.assert_array_equal(one[COMMANDED], other[COMMANDED])
    assert one["target_pitch"].abs().max() > 0
    assert np.abs(one[["pitch", "yaw", "tip_z"]] - other[["pitch", "yaw", "tip_z"]]).to_numpy().min() > 1e-4
