"""The margins of the multi-rate loop: against the closed form of a known wall, and of the shipped scenarios."""

import numpy as np
import pytest

from models.scenario import LIVE_STREAM, load_scenario, resolve_scenario
from systems.haptics.coupling_margins import coupling_margins, passive_damping
from systems.haptics.haptic_device import VELOCITY_BANDWIDTH
from systems.servo import multirate_margins as dut
from systems.servo.served_environment import MakeServedEnvironment

H = 1e-3
C = load_scenario("device").coupling
ROTATION = {"stiffness": C.angular_stiffness, "damping": C.angular_damping, "inertia": C.peg_inertia}
TRANSLATION = {"stiffness": C.stiffness, "damping": C.damping, "inertia": C.peg_mass}


@pytest.mark.parametrize("coupling", [ROTATION, TRANSLATION])
@pytest.mark.parametrize("delay", [0, 1, 3])
def test_a_wall_that_is_known_at_once_needs_what_colgate_and_schenkel_say(coupling, delay):
    known = {"stiffness": coupling["stiffness"], "damping": coupling["damping"]}
    expected = passive_damping(**known, period=H, bandwidth=VELOCITY_BANDWIDTH, delay=delay * H)
    found = dut.multirate_damping(**coupling, period=H, step=1, correction=1, delay=delay)
    assert found == pytest.approx(expected, rel=0.1)


def test_the_delay_of_a_device_counts_in_its_margins():
    """Half of the force that the scenario `device` renders leaves a factor of 1.5; 0.16 of it is too much."""
    scenario = resolve_scenario(load_scenario("inverse3"), seed=0, stream=LIVE_STREAM)
    found = {margin.name: margin for margin in dut.require_multirate_margins(scenario)}
    assert found["Colgate and Schenkel, with the filter"].factor == pytest.approx(1.53, abs=0.02)
    assert found["wall that only the simulation knows"].factor == pytest.approx(1.53, abs=0.02)
    scenario.coupling.force_scale = 0.16
    with pytest.raises(ValueError, match=r"with the filter is 10\.4 N s/m, expected below 10; wall that only"):
        dut.require_multirate_margins(scenario)


@pytest.mark.parametrize(
    ("coupling", "step", "correction", "needed"),
    [(ROTATION, 2, 12, 0.55216222), (TRANSLATION, 2, 12, 36.3520537), (TRANSLATION, 4, 4, 36.3523700)],
)
def test_a_wall_that_only_the_simulation_knows_needs_a_little_more(coupling, step, correction, needed):
    """By the scales 0.02 and 0.2 the values of docs/haptics.md: 0.011 N m s/rad and 7.3 N s/m."""
    found = dut.multirate_damping(**coupling, period=H, step=step, correction=correction)
    assert found == pytest.approx(needed, rel=1e-7)


def test_a_gain_just_outside_is_refused():
    """A known wall would allow 0.28 of the coupling at the device, a wall that only the simulation knows 0.275."""
    scenario = resolve_scenario(load_scenario("device"), seed=0, stream=LIVE_STREAM)
    scenario.coupling.force_scale = 0.274
    assert dut.require_multirate_margins(scenario)[-2].factor < 1.01
    scenario.coupling.force_scale = 0.278
    assert all(margin.holds for margin in coupling_margins(scenario) if margin.required)
    with pytest.raises(ValueError, match=r"wall that only the simulation knows is 10\.1 N s/m, expected below 10$"):
        MakeServedEnvironment(scenario)


def test_a_contact_step_as_long_as_the_hold_is_refused():
    scenario = load_scenario("device")
    scenario.contact.time_step = 0.010
    scenario = resolve_scenario(scenario, seed=0, stream=LIVE_STREAM)
    with pytest.raises(ValueError, match=r"contact step, twice, against the hold of its model is 0\.02 s"):
        MakeServedEnvironment(scenario)


def test_a_coupling_that_diverges_by_itself_needs_infinite_damping():
    """A spring so stiff that the local peg swings more and more whatever the probe does."""
    stiff = {"stiffness": 1e9, "damping": 36.0, "inertia": 2.0, "period": 1e-3, "step": 2, "correction": 12}
    assert dut.multirate_damping(**stiff) == np.inf
