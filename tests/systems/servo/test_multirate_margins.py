"""The margins of the multi-rate loop: against the known wall, and by hands just inside and outside."""

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


def loop(coupling, *, step, correction, damping, masses, springs, seconds=1.0):
    """Whether hands of these masses (n,) and springs (n,) swing more and more against an unknown wall."""
    K, B, inertia = coupling["stiffness"], coupling["damping"], coupling["inertia"]
    blend = 1.0 - np.exp(-2.0 * np.pi * VELOCITY_BANDWIDTH * H)
    n, fine = len(masses), 10
    x, v, old, speed, peg, peg_speed, drawn, drawn_speed = np.zeros((8, n))
    v[:] = 0.01
    sizes = []
    for k in range(round(seconds / H)):
        speed = speed + blend * ((x - old) / H - speed)
        old = x
        pull = K * (x - peg) + B * (speed - peg_speed)
        peg_speed = peg_speed + H * pull / inertia
        peg = peg + H * peg_speed
        if k % step == 0:
            drawn, drawn_speed = -peg / correction, -peg_speed / correction
        if k % step < correction:
            peg, peg_speed = peg + drawn, peg_speed + drawn_speed
        for _ in range(fine):  # the hand moves between the ticks, the force is held
            v = (v + H / fine * (-pull - springs * x) / masses) / (1.0 + H / fine * damping / masses)
            x = x + H / fine * v
        sizes.append(np.abs(x))
    sizes = np.array(sizes)
    half = len(sizes) // 2
    return sizes[half:].max(axis=0) > 2.0 * sizes[half // 2 : half].max(axis=0) + 1e-9


def hands(coupling):
    """Masses and springs of 625 hands; the light ones, whose frequency is near half the servo's rate, are sensitive."""
    masses = coupling["inertia"] * np.geomspace(2e-4, 1.0, 25)
    springs = coupling["stiffness"] * np.geomspace(1e-3, 100.0, 25)
    grid = np.array(np.meshgrid(masses, springs)).reshape(2, -1)
    return {"masses": grid[0], "springs": grid[1]}


@pytest.mark.parametrize(("step", "correction"), [(2, 12), (4, 12), (4, 4)])
@pytest.mark.parametrize("coupling", [ROTATION, TRANSLATION], ids=["rotation", "translation"])
def test_no_hand_with_the_damping_swings_more_and_more(coupling, step, correction):
    needed = dut.multirate_damping(**coupling, period=H, step=step, correction=correction)
    loop_of = {"step": step, "correction": correction, **hands(coupling)}
    assert not loop(coupling, damping=1.02 * needed, **loop_of).any()


@pytest.mark.parametrize("coupling", [ROTATION, TRANSLATION], ids=["rotation", "translation"])
def test_some_hand_with_less_damping_does(coupling):
    needed = dut.multirate_damping(**coupling, period=H, step=2, correction=12)
    assert loop(coupling, damping=0.9 * needed, step=2, correction=12, **hands(coupling)).any()


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
