"""Computes the stability margins of a virtual coupling from the scenario, before the simulation.

Two loops can become unstable. In the simulation, an explicit spring-damper (K, B) acts on the virtual peg (m) with one
step of delay. Symplectic Euler integration is stable for

    B dt/m + K dt^2/(2 m) < 2,

the limit of a damped oscillator. The coupling and the fixture's guide act on the same peg, so their gains add.

At the device, the rendered force is held for a servo period T while the hand moves. Colgate and Schenkel's condition
for the passivity of a sampled wall H(z) with a hand and device of damping b is

    b > max_w  T/2 / (1 - cos wT) Re[(1 - exp(-jwT)) H(exp(jwT))].

The right-hand side is K T/2 + B for a plain spring-damper, and less with the low-passed velocity of the device. Both
are reported; the exact condition is required. A force that is d periods late has z^-d in its wall, and needs more
damping. Abbott and Okamura's condition is K <= min(2 b/T, 2 f_c/Delta): the friction f_c must dissipate the energy that
an encoder step Delta generates. The stiffest wall that the hand can meet is the coupling with a peg that cannot move.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from models.hardware import DEVICE_PRESETS, HapticDeviceParameters
from models.scenario import FREE_FIXTURE, CouplingParameters, Scenario
from systems.haptics.haptic_device import VELOCITY_BANDWIDTH

STEP_LIMIT = 2.0  # upper limit of B dt/m + K dt^2/(2 m)
RINGING_LIMIT = 1.0  # upper limit of B dt/m; above it the velocity changes sign in each step
FREQUENCIES = 4000  # number of frequencies at which the passivity of the sampled wall is evaluated


@dataclass(frozen=True)
class Margin:
    """One stability condition: ``value`` must be below ``limit``.

    Attributes:
        name: Name of the condition.
        value: Value of the scenario, in ``unit``.
        limit: Upper limit, in ``unit``.
        unit: Unit of both, "" if dimensionless.
        required: Whether a violation is an error; otherwise the condition is only reported.
    """

    name: str
    value: float
    limit: float
    unit: str
    required: bool = True

    @property
    def holds(self) -> bool:
        """Whether the condition is met."""
        return self.value < self.limit

    @property
    def factor(self) -> float:
        """Ratio of limit to value."""
        return self.limit / self.value if self.value > 0 else math.inf


def passive_damping(*, stiffness: float, damping: float, period: float, bandwidth: float, delay: float = 0.0) -> float:
    """Returns the minimum damping of hand and device for a passive sampled spring-damper (see the module).

    Args:
        stiffness: Stiffness of the rendered wall, N/m or N m/rad.
        damping: Damping of the rendered wall, N s/m or N m s/rad.
        period: Servo period, s.
        bandwidth: Bandwidth of the low-pass on the velocity, Hz.
        delay: Delay of the force beyond the hold of a period, s.
    """
    phase = np.linspace(0.0, math.pi, FREQUENCIES + 1)[1:]
    z = np.exp(1j * phase)
    blend = 1.0 - math.exp(-2.0 * math.pi * bandwidth * period)
    velocity = (z - 1.0) / (period * z) * blend * z / (z - (1.0 - blend))
    wall = (stiffness + damping * velocity) * z ** (-delay / period)
    return float(np.max(0.5 * period / (1.0 - np.cos(phase)) * np.real((1.0 - 1.0 / z) * wall)))


def coupling_margins(scenario: Scenario) -> list[Margin]:
    """Returns all conditions of a scenario: first those of the simulation, then those of the device."""
    return [
        *_simulation_margins(scenario),
        *_device_margins(scenario.coupling, DEVICE_PRESETS[scenario.device]),
    ]


def require_margins(scenario: Scenario) -> list[Margin]:
    """Returns all conditions of a scenario, and requires that they hold.

    Raises:
        ValueError: Naming every violated condition with its value and limit.
    """
    return require_hold(scenario, coupling_margins(scenario))


def require_hold(scenario: Scenario, margins: list[Margin]) -> list[Margin]:
    """Returns the conditions of a scenario, and requires that they hold.

    Raises:
        ValueError: Naming every violated condition with its value and limit.
    """
    violated = [m for m in margins if m.required and not m.holds]
    if violated:
        conditions = "; ".join(
            f"{m.name} is {m.value:.3g} {m.unit}, expected below {m.limit:.3g}".strip() for m in violated
        )
        raise ValueError(f"scenario.coupling is not stable with device '{scenario.device}': {conditions}")
    return margins


def _simulation_margins(scenario: Scenario) -> list[Margin]:
    """Returns the conditions of the explicit integration, for translation and rotation."""
    c, dt = scenario.coupling, scenario.contact.time_step
    m, inertia = c.peg_mass, c.peg_inertia
    K, B, K_r, B_r = c.stiffness, c.damping, c.angular_stiffness, c.angular_damping
    if scenario.fixture != FREE_FIXTURE:
        # The guide acts at the mouth or the pivot; the lever is at most the hole's depth plus the pivot's height.
        pivot = scenario.rig.pivot_height if scenario.rig.pivot_height is not None else scenario.rig.pivot_range
        lever = scenario.geometry.hole_depth + abs(pivot)
        K, B = K + c.guide_stiffness, B + c.guide_damping
        K_r, B_r = 2 * K_r + c.guide_stiffness * lever**2, 2 * B_r + c.guide_damping * lever**2
    margins = []
    for suffix, stiffness, damping, mass in (("", K, B, m), (", rotation", K_r, B_r, inertia)):
        number = damping * dt / mass + stiffness * dt**2 / (2.0 * mass)
        margins += [
            Margin(f"B dt/m{suffix}", damping * dt / mass, RINGING_LIMIT, ""),
            Margin(f"K dt^2/m{suffix}", stiffness * dt**2 / mass, 2 * STEP_LIMIT, ""),
            Margin(f"B dt/m + K dt^2/2m{suffix}", number, STEP_LIMIT, ""),
        ]
    return margins


def _device_margins(c: CouplingParameters, device: HapticDeviceParameters) -> list[Margin]:
    """Returns the conditions of the sampled display, for translation and rotation."""
    return [
        *_display_margins(
            "",
            K=c.force_scale * c.stiffness,
            B=c.force_scale * c.damping,
            hand_damping=device.grip_damping,
            friction=device.friction_force,
            resolution=device.position_resolution,
            period=device.servo_period,
            delay=device.delay,
            max_K=device.max_stiffness,
            max_B=device.max_damping,
            units=("N/m", "N s/m"),
        ),
        *_display_margins(
            ", rotation",
            K=c.torque_scale * c.angular_stiffness,
            B=c.torque_scale * c.angular_damping,
            hand_damping=device.grip_angular_damping,
            friction=device.friction_torque,
            resolution=device.angle_resolution,
            period=device.servo_period,
            delay=device.delay,
            max_K=device.max_angular_stiffness,
            max_B=device.max_angular_damping,
            units=("N m/rad", "N m s/rad"),
        ),
    ]


def _display_margins(
    suffix: str,
    *,
    K: float,
    B: float,
    hand_damping: float,
    friction: float,
    resolution: float,
    period: float,
    delay: float,
    max_K: float,
    max_B: float,
    units: tuple[str, str],
) -> list[Margin]:
    """Returns the conditions of a rendered spring-damper (K, B), whose ``units`` are given; names end in ``suffix``."""
    b, T = hand_damping, period
    minimum = passive_damping(stiffness=K, damping=B, period=T, bandwidth=VELOCITY_BANDWIDTH, delay=delay)
    of_K, of_B = units
    return [
        Margin(f"Colgate, K T/2 + B unfiltered{suffix}", K * T / 2 + B, b, of_B, required=False),
        Margin(f"Colgate and Schenkel, with the filter{suffix}", minimum, b, of_B),
        Margin(f"Abbott-Okamura, K against 2b/T{suffix}", K, 2 * b / T, of_K),
        Margin(f"Abbott-Okamura, K against 2 f_c/Delta{suffix}", K, 2 * friction / resolution, of_K),
        Margin(f"device's stiffness{suffix}", K, max_K * (1 + 1e-9), of_K),
        Margin(f"device's damping{suffix}", B, max_B * (1 + 1e-9), of_B),
    ]
