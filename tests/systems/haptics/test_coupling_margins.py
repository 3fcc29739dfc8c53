"""The stability conditions against closed forms and worked examples."""

import dataclasses
import math

import numpy as np
import pytest

from models.scenario import (
    DEMONSTRATION_STREAM,
    SCENARIO_FOLDER,
    CouplingParameters,
    Scenario,
    load_scenario,
    resolve_scenario,
)
from systems.haptics.coupling_margins import (
    coupling_margins,
    passive_damping,
    require_margins,
)
from systems.haptics.haptic_device import VELOCITY_BANDWIDTH
from systems.virtual_environment import MakeVirtualEnvironment

T = 1e-3


def test_a_plain_spring_damper_needs_the_damping_of_colgate():
    found = passive_damping(stiffness=800.0, damping=5.0, period=T, bandwidth=1e6)
    assert found == pytest.approx(800.0 * T / 2 + 5.0, rel=1e-6)


@pytest.mark.parametrize(("K", "B", "period"), [(800.0, 36.0, 1e-3), (0.0, 3.0, 1e-3), (500.0, 6.0, 2e-3)])
def test_a_filter_that_halves_the_error_in_a_period_needs_a_third_of_the_damping(K, B, period):
    """The condition is strictest at half of the sampling rate: K T/2 + B a/(2 - a), and a = 1/2."""
    bandwidth = math.log(2.0) / (2.0 * math.pi * period)
    found = passive_damping(stiffness=K, damping=B, period=period, bandwidth=bandwidth)
    assert found == pytest.approx(K * period / 2 + B / 3, rel=1e-9)


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


COUPLING = CouplingParameters(
    stiffness=4000.0, damping=200.0, angular_stiffness=100.0, angular_damping=1.5, guide_stiffness=1e5,
    guide_damping=500.0, peg_mass=4.0, peg_inertia=0.02, force_scale=0.2, torque_scale=0.02,
)  # fmt: skip


GUIDED = (0.175, 0.026, 0.188, 0.19, 0.018, 0.199)
"""The lever is 30 mm + 10 mm, so its square is 0.0016 m^2.

Translation: K = 4000 + 100000 = 104000 N/m, B = 200 + 500 = 700 N s/m, on 4 kg.
Rotation: K = 2 * 100 + 160 = 360 N m/rad, B = 2 * 1.5 + 0.8 = 3.8 N m s/rad, on 0.02 kg m^2.
"""
FREE = (0.05, 0.001, 0.0505, 0.075, 0.005, 0.0775)
"""K = 4000 N/m and B = 200 N s/m on 4 kg; 100 N m/rad and 1.5 N m s/rad on 0.02 kg m^2."""


@pytest.mark.parametrize(
    ("fixture", "pivot", "values"),
    [
        ("rig", {"pivot_height": 0.010}, GUIDED),
        ("rig", {"pivot_height": -0.010}, GUIDED),
        ("axial", {"pivot_range": 0.010}, GUIDED),
        ("free", {}, FREE),
    ],
)
def test_the_guide_acts_with_the_lever_of_hole_and_pivot(fixture, pivot, values):
    """For a hole of 30 mm and steps of 1 ms."""
    scenario = Scenario(fixture=fixture, coupling=COUPLING)
    scenario.contact.time_step, scenario.geometry.hole_depth = 1e-3, 0.030
    scenario.rig.pivot_height = pivot.get("pivot_height")
    scenario.rig.pivot_range = pivot.get("pivot_range", 0.003)
    names = ("B dt/m", "K dt^2/m", "B dt/m + K dt^2/2m")
    found = {m.name: (m.value, m.limit) for m in coupling_margins(scenario)[:6]}
    assert list(found) == [*names, *(f"{name}, rotation" for name in names)]
    np.testing.assert_allclose(list(found.values()), np.column_stack([values, [1.0, 4.0, 2.0] * 2]))


def test_the_conditions_of_the_display_are_those_of_a_worked_example():
    """The gains are the scaled ones; the limits follow from the data of the device.

    Force: K = 0.2 * 4000 = 800 N/m, B = 0.2 * 200 = 40 N s/m, 2 b/T = 20 / 1 ms, 2 f_c/Delta = 80 mN / 30 um.
    Torque: K = 0.02 * 100 = 2 N m/rad, B = 0.02 * 1.5 = 0.03 N m s/rad, 0.04 / 1 ms and 2 mN m / 50 urad.
    """
    margins = coupling_margins(Scenario(coupling=COUPLING))[6:]
    found = {m.name: (m.value, m.limit) for m in margins}
    filtered = {"period": T, "bandwidth": VELOCITY_BANDWIDTH}
    assert found == {
        "Colgate and Schenkel, with the filter": (passive_damping(stiffness=800.0, damping=40.0, **filtered), 10.0),
        "Colgate and Schenkel, with the filter, rotation": (
            passive_damping(stiffness=2.0, damping=0.03, **filtered),
            0.02,
        ),
        "Colgate, K T/2 + B unfiltered": pytest.approx((40.4, 10.0)),
        "Abbott-Okamura, K against 2b/T": pytest.approx((800.0, 20e3)),
        "Abbott-Okamura, K against 2 f_c/Delta": pytest.approx((800.0, 0.08 / 3e-5)),
        "device's stiffness": (pytest.approx(800.0), math.inf),
        "device's damping": (pytest.approx(40.0), math.inf),
        "Colgate, K T/2 + B unfiltered, rotation": pytest.approx((0.031, 0.02)),
        "Abbott-Okamura, K against 2b/T, rotation": pytest.approx((2.0, 40.0)),
        "Abbott-Okamura, K against 2 f_c/Delta, rotation": pytest.approx((2.0, 40.0)),
        "device's stiffness, rotation": (pytest.approx(2.0), math.inf),
        "device's damping, rotation": (pytest.approx(0.03), math.inf),
    }
    assert [m.required for m in margins] == [not m.name.startswith("Colgate,") for m in margins]


@pytest.mark.parametrize(
    ("gain", "scale", "name", "limit"),
    [
        ("stiffness", 0.2, "device's stiffness", 800.0),
        ("damping", 0.2, "device's damping", 5.0),
        ("angular_stiffness", 0.02, "device's stiffness, rotation", 0.3),
        ("angular_damping", 0.02, "device's damping, rotation", 0.004),
    ],
)
@pytest.mark.parametrize(("excess", "holds"), [(-1e-10, True), (1e-10, True), (4e-9, False)])
def test_a_gain_may_equal_the_limit_of_the_driver(gain, scale, name, limit, excess, holds):
    """Rounding of a few parts in 10^10 is no violation."""
    coupling = dataclasses.replace(COUPLING, **{gain: limit / scale * (1.0 + excess)})
    scenario = Scenario(coupling=coupling, device="premium_1_5_6dof")
    assert {m.name: m.holds for m in coupling_margins(scenario)}[name] == holds
