"""The six-axis force/torque sensor between the carriage and the peg."""

from __future__ import annotations

import math
from typing import NamedTuple, Self

import numpy as np

from compiled import compiled
from models.hardware import WrenchSensorParameters
from skill.arrays import Array


class Sensor(NamedTuple):
    """A sensor; see `models.hardware.WrenchSensorParameters`. Arrays have its six channels.

    Attributes:
        height: h above the tip, m.
        blend: 1 - e^{-2 pi f_c T}.
        sigma: standard deviations of the noise.
        range: largest readings.
        quantum: of the readings.
        drift: delta sqrt(T).
        delay: number of periods.
    """

    height: float
    blend: float
    sigma: Array
    range: Array
    quantum: Array
    drift: Array
    delay: int

    @classmethod
    def of(cls, p: WrenchSensorParameters) -> Self:
        """Returns the sensor."""
        return cls(
            p.height,
            p.blend,
            np.array([*p.force_noise, *p.torque_noise]),
            np.array([*p.force_range, *p.torque_range]),
            np.repeat([p.force_quantum, p.torque_quantum], 3),
            np.repeat([p.force_drift, p.torque_drift], 3) * math.sqrt(p.period),
            round(p.delay / p.period),
        )

    def initial_state(self) -> Array:
        """Returns the state at the start: filtered wrench (6), drift (6), and the readings of the delay (6 each)."""
        return np.zeros(12 + 6 * (self.delay + 1))


@compiled
def wrench_sensor_step(p: Sensor, state: Array, held: Array, bias: Array, noise: Array) -> Array:
    """Returns the next state; the newest reading comes first, the last one is the output.

    In each channel, with n and w ~ N(0, 1),

        y <- y + (1 - e^{-2 pi f_c T}) (-(F_S - F_tare) - y),
        d <- d + delta sqrt(T) w,
        reading = quantise(clip(y + bias + d + sigma n)).

    Args:
        p: the sensor.
        state: after the last period; see `Sensor.initial_state`.
        held: (6,), F_S - F_tare, of the carriage on the peg, about the mount, N and N m.
        bias: (6,).
        noise: (12,), n, then w.
    """
    found = np.empty_like(state)
    for i in range(6):
        found[i] = state[i] - p.blend * (held[i] + state[i])
        found[6 + i] = state[6 + i] + p.drift[i] * noise[6 + i]
        noisy = found[i] + bias[i] + found[6 + i] + p.sigma[i] * noise[i]
        clipped = min(max(noisy, -p.range[i]), p.range[i])
        found[12 + i] = np.rint(clipped / p.quantum[i]) * p.quantum[i]
    found[18:] = state[12:-6]
    return found


@compiled
def wrench_at_tip(wrench: Array, height: float) -> Array:
    """Returns a wrench about the tip.

    Args:
        wrench: Force (N), then moment (N m), about the mount (6,).
        height: Height of the mount above the tip, m.
    """
    moved = wrench.copy()
    moved[3] -= height * wrench[1]
    moved[4] += height * wrench[0]
    return moved
