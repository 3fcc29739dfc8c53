"""What the servo tells the simulation of the probe after each tick."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform

from skill.arrays import Array
from systems.math.rotation import from_rotation_vector, rotation_vector


@dataclass(frozen=True)
class Probe:
    """The probe after a tick, and what it has cost.

    Attributes:
        time: of the servo, s.
        X_HD: pose of the probe.
        V_HD: (6,), [angular velocity; velocity] of the probe in H, rad/s and m/s.
        wrench: (6,), [torque; force] that the device renders, N m and N.
        load: ratio of the commanded wrench to the present limit of the device.
        energy: that the hand has put in so far, J.
        min_energy: minimum of it so far, J.
        gain: of the wrench; below 1 if the model of the contact is old.
        age: of the model of the contact, s.
        ticks: number of ticks before this one, without the first, which is slow.
        late: number of them that ended late.
        stalls: how often the servo stood still for so long that its force was taken away.
    """

    time: float
    X_HD: RigidTransform
    V_HD: Array
    wrench: Array
    load: float
    energy: float
    min_energy: float
    gain: float
    age: float
    ticks: int = 0
    late: int = 0
    stalls: int = 0

    SIZE = 27
    """Length of `as_vector`."""

    def as_vector(self) -> Array:
        """Returns (SIZE,), the numbers of the probe; `from_vector` inverts it."""
        pose = [*self.X_HD.translation(), *rotation_vector(self.X_HD.rotation())]
        numbers = [self.load, self.energy, self.min_energy, self.gain, self.age]
        counts = [self.ticks, self.late, self.stalls]
        return np.array([self.time, *pose, *self.V_HD, *self.wrench, *numbers, *counts])

    @classmethod
    def from_vector(cls, v: Array) -> Probe:
        """Returns the probe of a vector that `as_vector` has returned."""
        X_HD = RigidTransform(from_rotation_vector(v[4:7]), v[1:4])
        counts = (int(value) for value in v[24:27])
        return cls(float(v[0]), X_HD, v[7:13].copy(), v[13:19].copy(), *v[19:24].tolist(), *counts)
