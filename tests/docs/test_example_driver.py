"""The example driver, with a stand-in for the maker's package."""

import importlib
import sys
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest
from pydrake.math import RotationMatrix

from systems.operators.person_frame import R_HV
from tests.scripts.commands import ROOT


@pytest.fixture
def dhd(monkeypatch):
    """A device whose handle a test moves; ``calls`` lists what was asked of it."""
    state = SimpleNamespace(position=[0.1, 0.2, 0.3], frame=np.eye(3), calls=[], result=0, opened=5)

    def read(p_out, matrix_out, ID):
        p_out[:] = state.position
        for row, values in zip(matrix_out, np.asarray(state.frame).tolist(), strict=True):
            row[:] = values
        return state.result

    def note(name):
        return lambda *arguments: (state.calls.append((name, *arguments)), state.result)[1]

    state.functions = SimpleNamespace(
        open=lambda: state.opened,
        close=note("close"),
        enableForce=note("enableForce"),
        setForceAndTorque=note("setForceAndTorque"),
        getPositionAndOrientationFrame=read,
        errorGetLastStr=lambda: "no power",
    )
    package = ModuleType("forcedimension_core")
    package.dhd = state.functions
    monkeypatch.setitem(sys.modules, "forcedimension_core", package)
    monkeypatch.syspath_prepend(str(ROOT / "docs" / "drivers"))
    yield state
    sys.modules.pop("force_dimension", None)


@pytest.fixture
def device(dhd):
    return importlib.import_module("force_dimension").ForceDimension()


def test_the_handle_moves_as_the_person_sees_it(dhd, device):
    assert device.read_pose().IsNearlyIdentity(1e-12)
    dhd.position = [0.1, 0.203, 0.3]  # 3 mm to the person's right
    np.testing.assert_allclose(R_HV.inverse() @ device.read_pose().translation(), [0.003, 0, 0], atol=1e-12)
    dhd.position = [0.098, 0.2, 0.3]  # 2 mm away from the person
    np.testing.assert_allclose(R_HV.inverse() @ device.read_pose().translation(), [0, 0.002, 0], atol=1e-12)
    dhd.position, dhd.frame = [0.1, 0.2, 0.3], RotationMatrix.MakeZRotation(0.3).matrix()
    np.testing.assert_allclose(device.read_pose().rotation().matrix(), dhd.frame, atol=1e-12)


def test_the_wrench_has_the_directions_of_the_motion(dhd, device):
    right = R_HV @ np.array([1.0, 0.0, 0.0])
    device.write_wrench(np.concatenate([0.1 * right, 2.0 * right]))
    name, force, torque, number = dhd.calls[-1]
    assert (name, number) == ("setForceAndTorque", 5)
    np.testing.assert_allclose(force, [0.0, 2.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(torque, [0.0, 0.1, 0.0], atol=1e-12)


def test_the_motors_are_off_after_closing(dhd, device):
    assert dhd.calls == [("enableForce", True, 5)]
    device.close()
    assert dhd.calls[1:] == [("enableForce", False, 5), ("close", 5)]


def test_errors_have_the_maker_s_message(dhd, device):
    dhd.result = -1
    for call in (device.read_pose, lambda: device.write_wrench(np.zeros(6))):
        with pytest.raises(OSError, match="no power"):
            call()
    dhd.opened = -1
    with pytest.raises(OSError, match="no Force Dimension device: no power"):
        type(device)()
