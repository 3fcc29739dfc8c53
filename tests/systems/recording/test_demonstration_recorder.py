import math

import numpy as np
import pytest
from pydrake.common.eigen_geometry import Quaternion
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder, LeafSystem
from pydrake.systems.primitives import LogVectorOutput
from scipy.spatial.transform import Rotation

from skill.data.demonstration import ACTIONS, CHANNELS, COLUMNS, validate_samples
from systems.math.rotation import from_rotation_vector
from systems.recording.demonstration_recorder import DemonstrationRecorder, demonstration_sample

PERIOD = 0.02
NAMES = (*CHANNELS, *ACTIONS)


def pose(turn, position):
    return RigidTransform(from_rotation_vector(np.asarray(turn, dtype=float)), position)


def peg_state(X):
    q = X.rotation().ToQuaternion()
    return np.array([q.w(), q.x(), q.y(), q.z(), *X.translation(), *np.zeros(6)])


def named(row):
    return dict(zip(NAMES, row, strict=True))


def test_a_general_row_agrees_with_scipy():
    rng = np.random.default_rng(2)
    R_HP, R_old, R_HD, R_HD_old = (Rotation.from_rotvec(rng.uniform(-0.5, 0.5, 3)) for _ in range(4))
    p_HP, p_HD, p_HD_old, torque, force = rng.uniform(-1, 1, (5, 3))
    row = demonstration_sample(
        X_HP=pose(R_HP.as_rotvec(), p_HP),
        contact_wrench_W=np.concatenate([torque, force]),
        X_HD=pose(R_HD.as_rotvec(), p_HD),
        R_HP_previous=from_rotation_vector(R_old.as_rotvec()),
        X_HD_previous=pose(R_HD_old.as_rotvec(), p_HD_old),
    )
    turn = R_HP.as_rotvec()
    expected = [
        *p_HP,
        *R_HP.inv().apply(force),
        *R_HP.inv().apply(torque),
        *(turn / np.linalg.norm(turn)),
        np.linalg.norm(turn),
        (R_old.inv() * R_HP).magnitude(),
        *R_HP.inv().apply(p_HD - p_HD_old),
        *R_HP.inv().apply((R_HD * R_HD_old.inv()).as_rotvec()),
    ]
    np.testing.assert_allclose(row, expected, atol=1e-9)


@pytest.mark.parametrize("turn", [1e-11, 1e-13, 1e-155, 3e-162, 1e-310, 0.0])
def test_the_axis_of_a_peg_that_is_all_but_upright_has_unit_length(turn):
    """A person who levels the peg comes as near to zero as the numbers reach; the row must not spoil the recording."""
    X_HP = RigidTransform(Quaternion([1.0, 0.6 * turn, -0.7 * turn, 0.2 * turn]), [0.0, 0.0, -0.01])
    still = RigidTransform()
    row = demonstration_sample(
        X_HP=X_HP,
        contact_wrench_W=np.zeros(6),
        X_HD=still,
        R_HP_previous=X_HP.rotation(),
        X_HD_previous=still,
    )
    assert np.linalg.norm(row[9:12]) == pytest.approx(1.0, abs=1e-9)
    assert row[12] == pytest.approx(2.0 * turn * math.sqrt(0.89) if turn > 1e-12 else 0.0)


class Hand(LeafSystem):
    """A probe and a peg that turn about x and move down at constant speed, the probe 50 ms ahead."""

    SPEED, RATE = -0.02, 0.3

    def __init__(self):
        super().__init__()
        self.DeclareAbstractOutputPort("probe", Value[RigidTransform], lambda c, y: y.set_value(self.at(c.get_time())))
        self.DeclareVectorOutputPort("peg", 13, lambda c, y: y.SetFromVector(peg_state(self.at(c.get_time() - 0.05))))
        self.DeclareVectorOutputPort("wrench", 6, lambda c, y: y.SetFromVector(np.arange(6) * c.get_time()))

    def at(self, time):
        return pose([self.RATE * time, 0, 0], [0, 0, self.SPEED * time])


def test_the_log_of_a_simulation_holds_one_row_per_period_with_the_motion_since_the_last():
    builder = DiagramBuilder()
    hand = builder.AddSystem(Hand())
    dut = builder.AddSystem(DemonstrationRecorder(period=PERIOD, X_HP_start=hand.at(0.0)))
    log = LogVectorOutput(dut.GetOutputPort("sample"), builder, PERIOD)
    builder.Connect(hand.GetOutputPort("probe"), dut.GetInputPort("probe_pose"))
    builder.Connect(hand.GetOutputPort("peg"), dut.GetInputPort("peg_state"))
    builder.Connect(hand.GetOutputPort("wrench"), dut.GetInputPort("contact_wrench"))
    simulator = Simulator(builder.Build())
    simulator.AdvanceTo(0.4)
    samples = DemonstrationRecorder.samples(log, simulator.get_context())
    assert tuple(samples.columns) == COLUMNS
    validate_samples(samples, "test")
    np.testing.assert_allclose(samples["time"], PERIOD * np.arange(21), atol=1e-12)
    later = samples.iloc[1:]
    np.testing.assert_allclose(later["rx"], Hand.RATE * PERIOD, rtol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(later[["ux", "uy", "uz"]], axis=1), -Hand.SPEED * PERIOD, rtol=1e-6)
    np.testing.assert_allclose(later["dangle"].iloc[1:], Hand.RATE * PERIOD, rtol=1e-6)
    np.testing.assert_allclose(samples["z"], Hand.SPEED * (samples["time"] - 0.05), atol=1e-12)
    np.testing.assert_allclose(samples["fx"], 3 * samples["time"], atol=1e-12)
    # The first row has no previous sample, so its motion is zero.
    assert (samples.iloc[0][["ux", "uy", "uz", "rx", "ry", "rz"]] == 0).all()
