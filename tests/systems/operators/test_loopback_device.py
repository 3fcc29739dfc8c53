"""The loopback device: a hand on a spring, with friction, against hand-worked formulas."""

import numpy as np
import pytest

from systems.math.rotation import rotation_vector
from systems.operators.loopback_device import MAX_STEP, LoopbackDevice, insertion

H = 1e-3
STILL = np.zeros(6)


def after(path=lambda t: STILL, *, wrench=STILL, seconds=2.0, step=H):
    """A device after some time with a constant wrench [torque; force], and its pose."""
    now = [5.0]
    device = LoopbackDevice(path, clock=lambda: now[0])
    device.write_wrench(np.asarray(wrench, dtype=float))
    for _ in range(round(seconds / step)):
        now[0] += step
        X = device.read_pose()
    return device, X


@pytest.mark.parametrize(("step", "simulated"), [(H, H), (60.0, MAX_STEP)])
def test_the_first_step_is_that_of_a_damped_mass_and_a_late_one_is_not_simulated_whole(step, simulated):
    """0.3 kg; at rest the damping is 10 N s/m and 0.04 N over 1 mm/s; the spring has 400 N/m."""
    _, X = after(wrench=[0, 0, 0, 0, 0, 3.0], seconds=step, step=step)
    held = 0.3 + simulated * 50.0 + simulated**2 * 400.0
    assert X.translation()[2] == pytest.approx(simulated**2 * 3.0 / held)


def test_the_hand_yields_to_the_force_as_its_spring_does():
    _, X = after(wrench=[0.02, 0, 0, 0, 2.0, 0])
    assert X.translation() == pytest.approx([0, 2.0 / 400.0, 0], abs=1e-6)
    assert rotation_vector(X.rotation()) == pytest.approx([0.02 / 1.0, 0, 0], abs=1e-5)


def test_the_hand_begins_where_it_is_and_follows_the_path():
    start = np.array([0.5, 0.0, 0.0, 0.1, 0.0, 0.0])
    _, X = after(lambda t: start + np.array([0, 0, -0.01 * min(t, 1.0), 0, 0, 0]), seconds=3.0)
    assert X.translation() == pytest.approx([0.0, 0.0, -0.01], abs=1e-4)
    assert insertion(10.0)[2] == -0.04


def test_what_the_force_does_is_stored_or_dissipated():
    """A constant force moves the hand to rest: half of its work is in the spring, the rest has been dissipated."""
    force = 2.0
    device, X = after(wrench=[0, 0, 0, 0, 0, force], step=2e-5)
    work = force * X.translation()[2]
    assert device.dissipated == pytest.approx(0.5 * work, rel=0.03)
