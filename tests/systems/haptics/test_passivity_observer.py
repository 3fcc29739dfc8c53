import itertools

import numpy as np
import pytest
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder, LeafSystem
from pydrake.systems.primitives import LogVectorOutput

from models.hardware import DEVICE_PRESETS
from models.scenario import DEMONSTRATION_STREAM, FREE_FACETS, resolve_scenario
from systems.haptics.haptic_device import HapticDevice
from systems.haptics.haptic_proxy import HapticProxy
from systems.haptics.passivity_observer import PassivityObserver
from systems.haptics.virtual_fixture import MakeFixture
from systems.math.rotation import from_rotation_vector, rotation_vector
from systems.plant.contact_plant import AddVirtualPlant
from systems.virtual_environment import start_pose
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


class RandomHand(LeafSystem):
    """A hand that moves as a sum of sines about a start, and downwards on average."""

    def __init__(self, *, seed, X_HD, push, reach, angle):
        super().__init__()
        rng = np.random.default_rng(seed)
        self._f, self._phase = rng.uniform(0.3, 3.0, (6, 3)), rng.uniform(0, 2 * np.pi, (6, 3))
        self._X, self._push, self._size = X_HD, push, np.repeat([angle, reach], 3) / 3.0
        self.DeclareAbstractOutputPort("hand_pose", Value[RigidTransform], self._calc, {self.time_ticket()})

    def _calc(self, context, output):
        output.set_value(self.pose(context.get_time()))

    def pose(self, t):
        wave = self._size * (np.sin(2 * np.pi * self._f * t + self._phase) - np.sin(self._phase)).sum(axis=1)
        down = np.array([0.0, 0.0, -self._push * min(t, 0.5)])
        return RigidTransform(
            from_rotation_vector(wave[:3]) @ self._X.rotation(), self._X.translation() + wave[3:] + down
        )

    def dissipated(self, parameters, times):
        """Energy dissipated by the damping of the grip and the friction of the device, up to each time, J."""
        poses = [self.pose(t) for t in np.arange(0.0, times[-1] + T / 2, T)]
        steps = np.array(
            [
                [
                    np.linalg.norm(rotation_vector(b.rotation() @ a.rotation().inverse())),
                    np.linalg.norm(b.translation() - a.translation()),
                ]
                for a, b in itertools.pairwise(poses)
            ]
        )
        p = parameters
        damping, friction = [p.grip_angular_damping, p.grip_damping], [p.friction_torque, p.friction_force]
        dissipated = np.cumsum(steps**2 / T @ damping + steps @ friction)
        return np.interp(times, T * np.arange(len(poses)), [0.0, *dissipated])


def random_motion(scenario, *, seed, push, reach, angle, duration):
    """Energy over time, the same with the dissipation of grip and device, and the maximum contact force."""
    builder = DiagramBuilder()
    contact = AddVirtualPlant(builder, scenario)
    X = start_pose(scenario)
    parameters = DEVICE_PRESETS[scenario.device]
    hand = builder.AddSystem(RandomHand(seed=seed, X_HD=X, push=push, reach=reach, angle=angle))
    device = builder.AddSystem(HapticDevice(parameters=parameters, X_HD_start=X))
    proxy = builder.AddSystem(
        HapticProxy(
            coupling=scenario.coupling,
            fixture=MakeFixture(scenario.fixture, pivot_height=0.0),
            peg=contact.peg.index(),
        )
    )
    observer = builder.AddSystem(PassivityObserver(period=T, X_HD_start=X))
    log = LogVectorOutput(observer.GetOutputPort("energy"), builder, 0.01)
    peg_state = contact.plant.get_state_output_port(contact.peg.model_instance())
    builder.Connect(hand.get_output_port(), device.GetInputPort("hand_pose"))
    builder.Connect(proxy.GetOutputPort("probe_wrench"), device.GetInputPort("virtual_wrench"))
    builder.Connect(device.GetOutputPort("probe_pose"), proxy.GetInputPort("probe_pose"))
    builder.Connect(device.GetOutputPort("probe_velocity"), proxy.GetInputPort("probe_velocity"))
    builder.Connect(peg_state, proxy.GetInputPort("peg_state"))
    builder.Connect(proxy.GetOutputPort("peg_forces"), contact.plant.get_applied_spatial_force_input_port())
    builder.Connect(device.GetOutputPort("probe_pose"), observer.GetInputPort("probe_pose"))
    builder.Connect(device.GetOutputPort("rendered_wrench"), observer.GetInputPort("rendered_wrench"))
    simulator = Simulator(builder.Build())
    root = simulator.get_mutable_context()
    contact.plant.SetFreeBodyPose(contact.plant.GetMyMutableContextFromRoot(root), contact.peg, X)
    touch = 0.0
    for k in range(round(duration / 0.01)):
        simulator.AdvanceTo((k + 1) * 0.01)
        port = contact.plant.get_generalized_contact_forces_output_port(contact.peg.model_instance())
        touch = max(touch, np.linalg.norm(port.Eval(contact.plant.GetMyContextFromRoot(root))[3:]))
    kept = log.FindLog(root)
    energy = kept.data()[0]
    return energy, energy + hand.dissipated(parameters, kept.sample_times()), touch


@pytest.mark.slow
@pytest.mark.parametrize("fixture", ["free", "rig"])
def test_free_motion_generates_no_energy(quick_scenario, fixture):
    quick_scenario.fixture = fixture
    quick_scenario.geometry.facets = FREE_FACETS
    quick_scenario.start.height = 0.02
    scenario = resolve_scenario(quick_scenario, seed=0, stream=DEMONSTRATION_STREAM)
    energy, total, touch = random_motion(scenario, seed=0, push=0.0, reach=0.004, angle=0.02, duration=1.5)
    assert touch == 0.0
    assert energy.max() > 1e-5  # the hand has done work
    assert total.min() > -1e-9


@pytest.mark.slow
@pytest.mark.parametrize(("fixture", "seed"), [("free", 0), ("rig", 1)])
def test_contact_generates_no_energy(quick_scenario, fixture, seed):
    quick_scenario.fixture = fixture
    quick_scenario.geometry.facets = FREE_FACETS
    quick_scenario.start.height = 1e-4
    scenario = resolve_scenario(quick_scenario, seed=seed, stream=DEMONSTRATION_STREAM)
    energy, total, touch = random_motion(scenario, seed=seed, push=0.012, reach=0.002, angle=0.02, duration=1.0)
    assert touch > 2.0
    assert energy.max() > 1e-5
    assert total.min() > -1e-9
