"""Stability margins of the multi-rate loop of servo and simulation, beside those of `coupling_margins`.

At the device the servo renders the coupling to its local peg. A wall that the local model of the contact holds is the
sampled wall of Colgate and Schenkel, as before. The worst case is a wall that only the simulation knows: the local peg
follows the probe, and is drawn back to the wall a part at a time, when models arrive. No closed form is known for this
loop, which changes with the period of the contact. Its probe is therefore moved at single frequencies w: with the power
P that goes into the display on average, and the mean square of the speed v of the probe,

    b > max_w  -P / v^2

is the damping of hand and device that absorbs what the display generates. For a wall that is known this is Colgate and
Schenkel's condition.
"""

from __future__ import annotations

from collections import deque
from functools import lru_cache

import numpy as np

from models.hardware import DEVICE_PRESETS
from models.scenario import Scenario
from systems.haptics.coupling_margins import Margin, coupling_margins, require_hold
from systems.haptics.haptic_device import VELOCITY_BANDWIDTH
from systems.servo.local_peg import CORRECTION
from systems.servo.stale_contact_fade import HOLD

LOWEST, HIGHEST, NUMBER = 0.5, 0.49, 80
"""Frequencies at which the display is moved: from LOWEST, Hz, to HIGHEST of the servo's rate; how many."""

DURATION = 4.0  # in units of s; whole cycles of the second half count


@lru_cache(maxsize=64)
@np.errstate(over="ignore", invalid="ignore")  # of a coupling that is not stable at all
def multirate_damping(
    *, stiffness: float, damping: float, inertia: float, period: float, step: int, correction: int, delay: int = 0
) -> float:
    """Returns the damping of hand and device, per unit of the scale, that a wall needs which only the simulation knows.

    It is infinite if the loop diverges whatever the probe does.

    Args:
        stiffness: of the coupling, N/m or N m/rad.
        damping: of the coupling, N s/m or N m s/rad.
        inertia: of the peg, kg or kg m^2.
        period: of the servo, s.
        step: of the contact, in ticks.
        correction: ticks over which a difference from the simulation is removed.
        delay: ticks of the force beyond the hold of one.
    """
    omega = 2.0 * np.pi * np.geomspace(LOWEST, HIGHEST / period, NUMBER)
    blend = 1.0 - np.exp(-2.0 * np.pi * VELOCITY_BANDWIDTH * period)
    ticks = round(DURATION / period)
    cycles = np.floor(0.5 * DURATION * omega / (2.0 * np.pi))  # whole ones: the stored energy is then the same again
    first = ticks - np.rint(2.0 * np.pi * cycles / (omega * period))
    probe, speed, peg, peg_speed, energy, squares = np.zeros((6, NUMBER))
    forces = deque([np.zeros(NUMBER)] * (delay + 1))  # the first one acts now
    drawn, drawn_speed = np.zeros((2, NUMBER))
    for k in range(ticks):
        moved = np.sin(omega * (k * period)) - probe
        counts = k >= first
        energy -= counts * forces.popleft() * moved
        squares += counts * moved**2 / period
        probe = probe + moved
        speed = speed + blend * (moved / period - speed)
        pull = stiffness * (probe - peg) + damping * (speed - peg_speed)
        forces.append(-pull)
        peg_speed = peg_speed + period * pull / inertia
        peg = peg + period * peg_speed
        if k % step == 0:  # the simulated peg is at the wall, at rest
            drawn, drawn_speed = -peg / correction, -peg_speed / correction
        if k % step < correction:
            peg, peg_speed = peg + drawn, peg_speed + drawn_speed
    found = float(np.max(-energy / squares))
    return found if np.isfinite(found) else float("inf")


def multirate_margins(scenario: Scenario) -> list[Margin]:
    """Returns the conditions of a scenario whose device is served, beside those of `coupling_margins`."""
    c, device = scenario.coupling, DEVICE_PRESETS[scenario.device]
    period = device.servo_period
    step = max(1, round(scenario.contact.time_step / period))
    found = [Margin("contact step, twice, against the hold of its model", 2.0 * scenario.contact.time_step, HOLD, "s")]
    for suffix, K, B, inertia, scale, hand, unit in (
        ("", c.stiffness, c.damping, c.peg_mass, c.force_scale, device.grip_damping, "N s/m"),
        (
            *(", rotation", c.angular_stiffness, c.angular_damping, c.peg_inertia, c.torque_scale),
            *(device.grip_angular_damping, "N m s/rad"),
        ),
    ):
        needed = scale * multirate_damping(
            **{"stiffness": K, "damping": B, "inertia": inertia, "period": period, "step": step},
            **{"correction": round(CORRECTION / period), "delay": round(device.delay / period)},
        )
        found.append(Margin(f"wall that only the simulation knows{suffix}", needed, hand, unit))
    return found


def require_multirate_margins(scenario: Scenario) -> list[Margin]:
    """Returns all conditions of a served scenario, and requires that they hold.

    Raises:
        ValueError: naming every violated condition with its value and limit.
    """
    return require_hold(scenario, [*coupling_margins(scenario), *multirate_margins(scenario)])
