"""Compares the stability conditions with simulated loops on both sides of the limit."""

import dataclasses
import math

import numpy as np
import pytest
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.multibody.tree import SpatialInertia, UnitInertia
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantValueSource, ConstantVectorSource
from scipy.linalg import expm

from models.hardware import DEVICE_PRESETS
from models.scenario import (
    DEMONSTRATION_STREAM,
    SCENARIO_FOLDER,
    CouplingParameters,
    Scenario,
    load_scenario,
    resolve_scenario,
)
from systems.haptics.coupling_margins import (
    STEP_LIMIT,
    coupling_margins,
    passive_damping,
    require_margins,
    step_number,
)
from systems.haptics.haptic_device import VELOCITY_BANDWIDTH
from systems.haptics.haptic_proxy import HapticProxy
from systems.haptics.virtual_fixture import FreeFixture
from systems.virtual_environment import MakeVirtualEnvironment

T = 1e-3


def max_distance(coupling, *, rotating):
    """Maximum distance (m or rad) of a free peg from a fixed probe in the last tenth of a second."""
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, time_step=T)
    radius = math.sqrt(2.5 * coupling.peg_inertia / coupling.peg_mass)
    inertia = SpatialInertia(coupling.peg_mass, np.zeros(3), UnitInertia.SolidSphere(radius))
    peg = plant.AddRigidBody("peg", inertia)
    plant.mutable_gravity_field().set_gravity_vector(np.zeros(3))
    plant.Finalize()
    proxy = builder.AddSystem(HapticProxy(coupling=coupling, fixture=FreeFixture(), peg=peg.index()))
    fixed = builder.AddSystem(ConstantValueSource(Value(RigidTransform())))
    still = builder.AddSystem(ConstantVectorSource(np.zeros(6)))
    builder.Connect(fixed.get_output_port(), proxy.GetInputPort("probe_pose"))
    builder.Connect(still.get_output_port(), proxy.GetInputPort("probe_velocity"))
    builder.Connect(plant.get_state_output_port(), proxy.GetInputPort("peg_state"))
    builder.Connect(proxy.GetOutputPort("peg_forces"), plant.get_applied_spatial_force_input_port())
    simulator = Simulator(builder.Build())
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    start = RigidTransform([0.0, 0.0, 0.0 if rotating else 1e-4])
    plant.SetFreeBodyPose(context, peg, start)
    if rotating:
        velocity = plant.GetVelocities(context)
        velocity[0] = 1e-2
        plant.SetVelocities(context, velocity)
    distance = 0.0
    for k in range(400):
        simulator.AdvanceTo((k + 1) * T)
        q = plant.GetPositions(context)
        if k >= 300:
            distance = max(distance, 2 * np.abs(q[1:4]).max() if rotating else np.abs(q[4:7]).max())
        if not np.isfinite(distance) or distance > 1e-2:
            return math.inf
    return distance


@pytest.mark.parametrize("rotating", [False, True])
@pytest.mark.parametrize(("beta", "kappa"), [(0.05, 3.9), (1.0, 2.0), (1.9, 0.2)])
@pytest.mark.parametrize(("share", "stable"), [(0.97, True), (1.03, False)])
def test_the_peg_converges_below_the_step_limit_and_diverges_above(rotating, beta, kappa, share, stable):
    scale = share * STEP_LIMIT / (beta + kappa / 2)
    c = CouplingParameters()
    mass = c.peg_inertia if rotating else c.peg_mass
    B, K = scale * beta * mass / T, scale * kappa * mass / T**2
    assert step_number(stiffness=K, damping=B, inertia=mass, time_step=T) == pytest.approx(share * STEP_LIMIT)
    names = ("angular_stiffness", "angular_damping") if rotating else ("stiffness", "damping")
    found = max_distance(dataclasses.replace(c, **dict(zip(names, (K, B), strict=True))), rotating=rotating)
    assert (found < 2e-5) == stable


def radius_of_loop(*, mass, b, spring, K, B, bandwidth):
    """Spectral radius of a hand and device (mass, damping b, spring) at the sampled wall; stable below 1."""
    A = np.array([[0.0, 1.0], [-spring / mass, -b / mass]])
    joint = expm(T * np.block([[A, np.array([[0.0], [1.0 / mass]])], [np.zeros((1, 3))]]))
    Ad, Bd = joint[:2, :2], joint[:2, 2:]
    blend = 1.0 - math.exp(-2 * math.pi * bandwidth * T)
    # The state is [x, v, last x, low-passed velocity]. The wall reads x, updates, and holds its force.
    read = np.array([1.0, 0.0, 0.0, 0.0])
    filtered = blend / T * (read - np.array([0, 0, 1.0, 0])) + (1 - blend) * np.array([0, 0, 0, 1.0])
    force = -(K * read + B * filtered)
    step = np.zeros((4, 4))
    step[:2, :2] = Ad
    step[:2] += Bd @ force[None, :]
    step[2], step[3] = read, filtered
    return np.abs(np.linalg.eigvals(step)).max()


@pytest.mark.parametrize(("K", "B", "bandwidth"), [(800.0, 0.0, 60.0), (800.0, 36.0, 60.0), (300.0, 9.0, 200.0)])
def test_the_passive_damping_stabilises_every_hand_and_a_lower_one_does_not(K, B, bandwidth):
    minimum = passive_damping(stiffness=K, damping=B, period=T, bandwidth=bandwidth)
    hands = [(m, k) for m in np.geomspace(1e-5, 10.0, 60) for k in (0.0, *np.geomspace(1.0, 1e6, 40))]

    def max_radius(b):
        return max(radius_of_loop(mass=m, b=b, spring=k, K=K, B=B, bandwidth=bandwidth) for m, k in hands)

    assert max_radius(1.01 * minimum) < 1.0
    assert max_radius(0.85 * minimum) > 1.0


def test_a_plain_spring_damper_needs_the_damping_of_colgate():
    found = passive_damping(stiffness=800.0, damping=5.0, period=T, bandwidth=1e6)
    assert found == pytest.approx(800.0 * T / 2 + 5.0, rel=1e-6)


@pytest.mark.parametrize("path", sorted(SCENARIO_FOLDER.glob("*.yaml")), ids=lambda p: p.stem)
def test_every_scenario_satisfies_its_conditions(path):
    margins = require_margins(load_scenario(path))
    assert len({m.name for m in margins}) == len(margins) >= 12
    assert all(m.factor >= 1.0 for m in margins if m.required)


VIOLATIONS = {
    "too much damping for the mass of the peg": ({"damping": 4.5e3, "force_scale": 1e-3}, "B dt/m is"),
    "too much stiffness for the mass of the peg": ({"stiffness": 2e7, "force_scale": 1e-6}, "K dt.2/m is"),
    "too much damping of the guide": ({"guide_damping": 4e3}, "B dt/m is"),
    "too much rendered damping for the hand": ({"force_scale": 1.0}, "Colgate and Schenkel"),
    "too much rendered stiffness for the encoder": (
        {"stiffness": 1.4e4, "damping": 10.0},
        "2 f_c/Delta is 2.8e.03 N/m",
    ),
    "too much rendered angular damping for the hand": ({"torque_scale": 0.1}, "filter, rotation"),
}


@pytest.mark.parametrize("name", sorted(VIOLATIONS))
def test_the_error_names_the_violated_condition(name):
    changes, message = VIOLATIONS[name]
    scenario = resolve_scenario(Scenario(), seed=0, stream=DEMONSTRATION_STREAM)
    scenario.coupling = dataclasses.replace(scenario.coupling, **changes)
    with pytest.raises(ValueError, match=message):
        MakeVirtualEnvironment(scenario)


def test_the_gains_of_the_default_coupling_exceed_the_limits_of_the_premiums_driver():
    scenario = Scenario(device="premium_1_5_6dof")
    with pytest.raises(ValueError, match="device's damping is 36 N s/m, expected below 5"):
        require_margins(scenario)


def test_the_conditions_with_and_without_the_filter_are_both_reported():
    found = {m.name: m for m in coupling_margins(Scenario())}
    plain, exact = found["Colgate, K T/2 + B unfiltered"], found["Colgate and Schenkel, with the filter"]
    assert plain.value == pytest.approx(0.2 * 4000 * T / 2 + 0.2 * 180)
    assert not plain.required
    assert exact.value < plain.value
    assert exact.value == pytest.approx(
        passive_damping(stiffness=800.0, damping=36.0, period=T, bandwidth=VELOCITY_BANDWIDTH)
    )
    assert exact.limit == DEVICE_PRESETS["paper"].grip_damping
