"""How far a virtual coupling is from instability, computed from the scenario before anything moves.

Two loops can go unstable. Inside the simulation an explicit spring-damper (K, B) acts on the virtual peg (m) with one
step of delay: symplectic Euler with these gains is stable while

    B dt/m + K dt^2/(2 m) < 2,

which is the limit of a damped oscillator; the coupling and the fixture's guide act on the same peg, so their gains add.
Outside, the device holds the rendered force for a servo period T while the hand moves: Colgate and Schenkel's condition
for a sampled wall H(z) to be passive in a hand and device of damping b,

    b > max_w  T/2 / (1 - cos wT) Re[(1 - exp(-jwT)) H(exp(jwT))],

is K T/2 + B for a bare spring-damper, and less for the low-passed velocity that the device gives; both are reported and
the exact one is required. Abbott and Okamura: K <= min(2 b/T, 2 f_c/Delta), so that friction f_c swallows the energy
that an encoder step Delta leaks. The coupling with a peg that is held is the hardest wall that the hand can meet.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from models.hardware import DEVICE_PRESETS, HapticDeviceParameters
from models.scenario import CouplingParameters, Scenario
from systems.haptics.haptic_device import VELOCITY_BANDWIDTH

STEP_LIMIT = 2.0  # of B dt/m + K dt^2/(2 m)
RINGING_LIMIT = 1.0  # of B dt/m: above it the damper overshoots, from one step to the next
FREQUENCIES = 4000  # at which the passivity of the sampled wall is evaluated


@dataclass(frozen=True)
class Margin:
    """One condition: ``value`` must stay below ``limit``."""

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
        """How many times the value would fit into the limit."""
        return self.limit / self.value if self.value > 0 else math.inf


def step_number(*, stiffness: float, damping: float, inertia: float, time_step: float) -> float:
    """B dt/m + K dt^2/(2 m) of an explicit spring-damper on a mass."""
    return damping * time_step / inertia + stiffness * time_step**2 / (2.0 * inertia)


def passive_damping(*, stiffness: float, damping: float, period: float, bandwidth: float) -> float:
    """Damping that a hand and device need to stay passive against a sampled spring-damper (see the module).

    Args:
        stiffness: of the rendered wall, N/m or N m/rad.
        damping: of the rendered wall, N s/m or N m s/rad.
        period: of the servo, s.
        bandwidth: of the low-pass on the velocity, Hz.
    """
    phase = np.linspace(0.0, math.pi, FREQUENCIES + 1)[1:]
    z = np.exp(1j * phase)
    blend = 1.0 - math.exp(-2.0 * math.pi * bandwidth * period)
    velocity = (z - 1.0) / (period * z) * blend * z / (z - (1.0 - blend))
    wall = stiffness + damping * velocity
    return float(np.max(0.5 * period / (1.0 - np.cos(phase)) * np.real((1.0 - 1.0 / z) * wall)))


def coupling_margins(scenario: Scenario) -> list[Margin]:
    """Every condition of a scenario, the simulation's first."""
    return [
        *_simulation_margins(scenario),
        *_device_margins(scenario.coupling, DEVICE_PRESETS[scenario.device]),
    ]


def require_margins(scenario: Scenario) -> list[Margin]:
    """The margins of a scenario that has them.

    Raises:
        ValueError: naming every condition that is violated, with its figures.
    """
    margins = coupling_margins(scenario)
    broken = [m for m in margins if m.required and not m.holds]
    if broken:
        said = "; ".join(f"{m.name} is {m.value:.3g} {m.unit}, expected below {m.limit:.3g}".strip() for m in broken)
        raise ValueError(f"scenario.coupling is not stable with device '{scenario.device}': {said}")
    return margins


def _simulation_margins(scenario: Scenario) -> list[Margin]:
    c, dt = scenario.coupling, scenario.contact.time_step
    m, inertia = c.peg_mass, c.peg_inertia
    K, B, K_r, B_r = c.stiffness, c.damping, c.angular_stiffness, c.angular_damping
    if scenario.fixture != "free":
        # The guide acts at the mouth or the pivot, on a lever of at most the hole's depth and the pivot's height.
        pivot = scenario.rig.pivot_height if scenario.rig.pivot_height is not None else scenario.rig.pivot_range
        lever = scenario.geometry.hole_depth + abs(pivot)
        K, B = K + c.guide_stiffness, B + c.guide_damping
        K_r, B_r = 2 * K_r + c.guide_stiffness * lever**2, 2 * B_r + c.guide_damping * lever**2
    margins = []
    for turning, stiffness, damping, mass in (("", K, B, m), (", turning", K_r, B_r, inertia)):
        number = step_number(stiffness=stiffness, damping=damping, inertia=mass, time_step=dt)
        margins += [
            Margin(f"B dt/m{turning}", damping * dt / mass, RINGING_LIMIT, ""),
            Margin(f"K dt^2/m{turning}", stiffness * dt**2 / mass, 2 * STEP_LIMIT, ""),
            Margin(f"B dt/m + K dt^2/2m{turning}", number, STEP_LIMIT, ""),
        ]
    return margins


def _device_margins(c: CouplingParameters, device: HapticDeviceParameters) -> list[Margin]:
    margins = []
    for turning, K, B, b, friction, resolution, most_K, most_B, units in (
        (
            *("", c.force_scale * c.stiffness, c.force_scale * c.damping, device.grip_damping, device.friction_force),
            *(device.position_resolution, device.max_stiffness, device.max_damping, ("N/m", "N s/m")),
        ),
        (
            *(", turning", c.torque_scale * c.angular_stiffness, c.torque_scale * c.angular_damping),
            *(device.grip_angular_damping, device.friction_torque, device.angle_resolution),
            *(device.max_angular_stiffness, device.max_angular_damping, ("N m/rad", "N m s/rad")),
        ),
    ):
        T = device.servo_period
        needed = passive_damping(stiffness=K, damping=B, period=T, bandwidth=VELOCITY_BANDWIDTH)
        margins += [
            Margin(f"Colgate, K T/2 + B unfiltered{turning}", K * T / 2 + B, b, units[1], required=False),
            Margin(f"Colgate and Schenkel, with the filter{turning}", needed, b, units[1]),
            Margin(f"Abbott-Okamura, K against 2b/T{turning}", K, 2 * b / T, units[0]),
            Margin(f"Abbott-Okamura, K against 2 f_c/Delta{turning}", K, 2 * friction / resolution, units[0]),
            Margin(f"device's stiffness{turning}", K, most_K * (1 + 1e-9), units[0]),
            Margin(f"device's damping{turning}", B, most_B * (1 + 1e-9), units[1]),
        ]
    return margins
