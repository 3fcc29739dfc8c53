"""The stage that turns the block about its axis, in both engines that have one, against hand-worked mechanics."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from models.section import CORNER
from systems.plant.contact_plant import ALUMINIUM
from systems.plant.exact_contact import STEPS
from tests.systems.plant.engine_bench import Bench, hanging_weight


@pytest.fixture(params=["drake", "exact"])
def scenario(request, quick_scenario):
    quick_scenario.geometry.section, quick_scenario.rig.clocking_stage = "square", True
    quick_scenario.rig.pivot_height, quick_scenario.contact.engine = 0.0, request.param
    return quick_scenario


def bench_at(scenario, tip_z, angles, equilibrium):
    bench = Bench(scenario, force=hanging_weight(scenario), equilibrium=equilibrium)
    carriage = scenario.sensor.height + tip_z
    bench.plant.set_start(bench.simulator.get_mutable_context(), carriage=carriage, angles=angles)
    return bench


def test_the_stage_turns_the_block_about_its_own_axis_after_pitch_and_yaw(scenario):
    scenario.rig.pivot_height = 0.002
    bench = bench_at(scenario, 0.01, (0.05, -0.08, 0.03), (0.0, 0.0, 0.0))
    X_HP = bench.plant.peg_in_hole(bench.simulator.get_context())
    R_WH = Rotation.from_euler("XYZ", [0.05, -0.08, 0.03])
    np.testing.assert_allclose(X_HP.rotation().matrix(), R_WH.inv().as_matrix(), atol=1e-12)
    pivot = np.array([0.0, 0.0, 0.002])
    p_WH = pivot - R_WH.apply(pivot)
    np.testing.assert_allclose(X_HP.translation(), R_WH.inv().apply([0.0, 0.0, 0.01] - p_WH), atol=1e-12)


def test_its_stepper_accelerates_block_and_rotor_with_the_holding_torque_at_most(scenario):
    g = scenario.geometry
    mass = ALUMINIUM * math.pi * g.block_radius**2 * (g.hole_depth + g.floor)
    inertia = 0.5 * mass * g.block_radius**2 + scenario.stepper.reflected_inertia
    bench = bench_at(scenario, 0.02, (0.0, 0.0, 0.0), (0.0, 0.0, 0.5)).advance(0.002)
    assert bench.gimbal()[5] / 0.002 * inertia == pytest.approx(scenario.stepper.holding_torque, rel=0.02)


def test_beyond_the_play_the_peg_carries_the_torque_of_the_stepper(scenario):
    g = scenario.geometry
    inner = g.peg_radius * (1.0 - CORNER)  # a corner turns at sqrt(2) inner from the axis until it touches a side
    play = math.pi / 4.0 - math.acos((inner + g.clearance) / (math.sqrt(2.0) * inner))
    turn = play + math.radians(0.05)
    bench = bench_at(scenario, -0.015, (0.0, 0.0, 0.0), (0.0, 0.0, turn)).advance(0.3)
    angle = bench.gimbal()[2]
    assert angle == pytest.approx(play, rel=0.1)
    torque = scenario.stepper.stiffness * (turn - angle)
    assert -bench.held()[5] == pytest.approx(torque, rel=0.01)
    assert torque > 0.1


def test_both_engines_turn_three_axes_at_once_alike(quick_scenario):
    """The exact engine leaves a product of inertia out; a yaw of 8 degrees is the largest one. Equal steps."""
    quick_scenario.geometry.section, quick_scenario.rig.clocking_stage = "square", True
    quick_scenario.rig.pivot_height = 0.0
    found = {}
    for engine, step in (("exact", 2e-3), ("drake", 2e-3 / STEPS)):
        quick_scenario.contact.engine, quick_scenario.contact.time_step = engine, step
        bench = bench_at(quick_scenario, 0.02, (0.0, 0.14, 0.0), (0.01, 0.14, 0.01))
        found[engine] = [bench.advance(0.004).gimbal().copy() for _ in range(2)]
    np.testing.assert_allclose(found["exact"], found["drake"], rtol=0.02, atol=2e-4)
    assert found["exact"][0][5] > 1.0
