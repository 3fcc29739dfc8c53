import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from scipy.spatial.transform import Rotation

from experiments.demonstration_run import run_demonstration
from models.scenario import DEMONSTRATION_STREAM, resolve_scenario
from systems.recording.demonstration_recorder import DemonstrationRecorder
from systems.rig_diagram import start_angles
from systems.virtual_environment import MakeVirtualEnvironment
from tests.diagrams import unconnected_inputs, unused_plant_inputs


@pytest.fixture
def resolved(quick_scenario):
    """A resolved scenario whose peg touches the mouth within 0.1 s."""
    quick_scenario.start.height = 2e-4
    quick_scenario.start.tilt = [0.04, -0.03]
    quick_scenario.rig.pivot_height = 0.002
    return resolve_scenario(quick_scenario, seed=1, stream=DEMONSTRATION_STREAM)


def make_simulator(environment):
    simulator = Simulator(environment.diagram)
    environment.set_start(simulator.get_mutable_context())
    return simulator


def test_every_used_input_is_connected(resolved):
    assert unconnected_inputs(MakeVirtualEnvironment(resolved).diagram) - unused_plant_inputs("peg", "hole") == set()


def test_scenario_with_ranges_is_an_error(quick_scenario):
    with pytest.raises(ValueError, match="not resolved"):
        MakeVirtualEnvironment(quick_scenario)


def test_a_peg_starts_tilted_about_the_pivot_and_turned_about_its_axis_as_on_the_rig(quick_scenario):
    quick_scenario.geometry.section, quick_scenario.rig.clocking_stage = "square", True
    quick_scenario.rig.pivot_height = 0.002
    resolved = resolve_scenario(quick_scenario, seed=2, stream=DEMONSTRATION_STREAM)
    environment = MakeVirtualEnvironment(resolved)
    X = environment.plant.peg_pose(make_simulator(environment).get_context())
    R = Rotation.from_rotvec([*resolved.start.tilt, 0.0]) * Rotation.from_euler("z", resolved.start.clocking)
    np.testing.assert_allclose(X.rotation().matrix(), R.as_matrix(), atol=1e-12)
    tip = R.apply([0.0, 0.0, resolved.start.height - 0.002])
    np.testing.assert_allclose(X.translation() - tip, [0.0, 0.0, 0.002], atol=1e-15)
    on_rig = Rotation.from_euler("XYZ", start_angles(resolved)).inv()
    assert (R.inv() * on_rig).magnitude() < 1e-2 * resolved.start.clocking_range + 2e-3  # pitch, then yaw
    assert abs(resolved.start.clocking) > 0.01


def test_forces_and_energy_of_the_environment_agree_with_the_log(resolved):
    environment = MakeVirtualEnvironment(resolved)
    simulator = make_simulator(environment)
    simulator.Initialize()
    assert environment.plant.contact_force(simulator.get_context()) is None
    np.testing.assert_allclose(environment.rendered_wrench(simulator.get_context()), 0.0, atol=1e-12)
    simulator.AdvanceTo(0.3)
    context = simulator.get_context()
    last = DemonstrationRecorder.samples(environment.log, context).iloc[-1]
    assert last["time"] == pytest.approx(0.3)
    R_HP = environment.plant.peg_pose(context).rotation()
    point, force = environment.plant.contact_force(context)
    np.testing.assert_allclose(R_HP.inverse().multiply(force), last[["fx", "fy", "fz"]], rtol=1e-6, atol=1e-9)
    assert np.linalg.norm(force) > 0.5
    assert environment.plant.peg_pose(context).translation()[2] - 1e-3 < point[2] < 1e-3  # between tip and mouth
    assert environment.rendered_wrench(context)[3:] @ force > 0.0  # both push the peg out of the contact
    total, minimum = environment.energy_log.FindLog(context).data()[:, -1]
    assert environment.min_energy(context) == minimum <= min(0.0, total)


def test_careful_operators_insert_and_a_slamming_operator_is_rough(demonstrations):
    *good, bad = demonstrations
    assert [(d.outcome, d.good) for d in good] == [("inserted", True)] * 5
    assert bad.outcome != "inserted"
    assert not bad.good
    *gentle, rough = (np.linalg.norm(d.samples[["fx", "fy", "fz"]], axis=1).max() for d in demonstrations)
    assert rough > max(gentle)


@pytest.mark.parametrize(
    ("engine", "section", "overlap"),
    [
        ("exact", "round", 1.0),
        pytest.param("exact", "square", 1.0, marks=pytest.mark.slow),
        pytest.param("drake", "key", 12.5, marks=pytest.mark.slow),
    ],
)
def test_a_demonstration_inserts_a_peg_of_every_section_in_each_engine(quick_scenario, engine, section, overlap):
    quick_scenario.contact.engine, quick_scenario.geometry.section = engine, section
    resolved = resolve_scenario(quick_scenario, seed=0, stream=DEMONSTRATION_STREAM)
    demonstration = run_demonstration(resolved)
    assert demonstration.outcome in ("inserted", "inserted roughly")
    assert demonstration.metadata["penetration_um"] < overlap
    assert demonstration.metadata["geometry"]["section"] == section
    assert demonstration.samples["fz"].max() > 0.5
