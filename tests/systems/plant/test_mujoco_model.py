"""The bodies in MuJoCo against hand-worked statics and exact geometry."""

import numpy as np
import pytest

mujoco = pytest.importorskip("mujoco", reason="needs the extra [peers]")


from systems.plant.mujoco_model import MujocoContact, rig_document  # noqa: E402
from tests.systems.plant.engine_bench import hanging_weight  # noqa: E402


@pytest.fixture
def scenario(quick_scenario):
    quick_scenario.rig.pivot_height = 0.0
    return quick_scenario


def test_the_mount_deflects_by_force_over_stiffness_and_the_sensor_measures_the_moment(scenario):
    model = mujoco.MjModel.from_xml_string(rig_document(scenario, MujocoContact()))
    data = mujoco.MjData(model)
    data.qpos[model.joint("feed").qposadr[0]] = scenario.sensor.height + 0.01
    data.ctrl[0] = hanging_weight(scenario)
    force = np.array([12.0, -7.0, 0.0])  # at the peg's centre of mass
    data.xfrc_applied[model.body("peg").id, :3] = force
    mujoco.mj_step(model, data, nstep=1000)
    moved = [data.qpos[model.joint(name).qposadr[0]] for name in ("mount_x", "mount_y")]
    np.testing.assert_allclose(moved, force[:2] / scenario.rig.mount_stiffness, rtol=1e-3)
    lever = np.array([0.0, 0.0, 0.5 * scenario.geometry.peg_length - scenario.sensor.height])
    np.testing.assert_allclose(data.sensordata[:2], -force[:2], rtol=1e-3)
    np.testing.assert_allclose(data.sensordata[3:], -np.cross(lever, force), rtol=1e-3, atol=1e-6)


def test_the_torque_of_an_overloaded_stepper_is_its_holding_torque(scenario):
    model = mujoco.MjModel.from_xml_string(rig_document(scenario, MujocoContact()))
    data = mujoco.MjData(model)
    data.ctrl[1] = 0.5  # rad; 320 N m without the limit
    mujoco.mj_forward(model, data)
    assert data.actuator_force[1] == pytest.approx(scenario.stepper.holding_torque)


def test_an_unresolved_scenario_is_refused(quick_scenario):
    quick_scenario.rig.pivot_height = None
    with pytest.raises(ValueError, match="pivot_height"):
        rig_document(quick_scenario, MujocoContact())
