import numpy as np
import pytest
from pydrake.math import RigidTransform

from systems.haptics.passivity_observer import PassivityObserver
from systems.math.rotation import from_rotation_vector
from tests.stepping import fixed_context, update_unrestricted

T = 1e-3


def observed(poses, wrenches):
    """Energy and minimum energy after each of a sequence of probe poses and rendered wrenches."""
    dut = PassivityObserver(period=T, X_HD_start=poses[0])
    context = fixed_context(dut, probe_pose=poses[0], rendered_wrench=wrenches[0])
    found = []
    for X, wrench in zip(poses, wrenches, strict=True):
        dut.GetInputPort("probe_pose").FixValue(context, X)
        dut.GetInputPort("rendered_wrench").FixValue(context, wrench)
        update_unrestricted(dut, context, period=T)
        found.append(dut.GetOutputPort("energy").Eval(context).copy())
    return np.array(found)


def test_the_held_force_of_a_spring_generates_the_energy_of_its_lag():
    """Moving n steps of d into a sampled spring and out again generates the energy K d^2 n."""
    K, d, n = 500.0, 1e-4, 50
    depths = d * np.concatenate([np.arange(n + 1), np.arange(n - 1, -1, -1)])
    poses = [RigidTransform([0.0, 0.0, -z]) for z in depths]
    found = observed(poses, [[0, 0, 0, 0, 0, K * z] for z in depths])
    assert found[n, 0] == pytest.approx(0.5 * K * (n * d) ** 2 * (1 - 1 / n))
    assert found[-1, 0] == pytest.approx(-K * d**2 * n)
    assert found[-1, 1] == found[:, 0].min()


def test_rotation_against_a_moment_adds_energy():
    poses = [RigidTransform(from_rotation_vector(np.array([0.0, 0.01 * k, 0.0])), [0, 0, 0]) for k in range(11)]
    found = observed(poses, [[0, -0.2, 0, 0, 0, 0]] * 11)
    assert found[-1, 0] == pytest.approx(0.2 * 0.1)
