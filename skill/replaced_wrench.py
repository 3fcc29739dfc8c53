"""A policy that receives another wrench than the measured one, to see whether it uses force."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from skill.arrays import Array
from skill.features.measurement import contact_load
from skill.policy.rig_policy import Action, RigPolicy, WrappedPolicy
from skill.states.estimate import Estimate, Estimator

TOUCH_LOAD = 3.0
"""Load from which a frozen wrench stays as it is, N: the first touch. The reading before it is almost zero."""

READINGS = {"frozen": 1, "shuffled": 500}
"""How many readings are kept, at most; those of a shuffled wrench are of 10 s."""


@dataclass(frozen=True)
class ReplacedEstimate(Estimate):
    """An estimate, and the measurement (7,) that it was made of and the policy acts on."""

    measured: Array = field(default_factory=lambda: np.zeros(7))


@dataclass(frozen=True)
class ReplacedWrench(WrappedPolicy[RigPolicy]):
    """A policy that receives, instead of the measured wrench (N, N m),

    * ``zero``: nothing;
    * ``frozen``: as measured until the first touch, and from then on as it was there;
    * ``shuffled``: any of the readings so far, each with the same probability, so that they are distributed as the
      measured ones and say nothing about the present;
    * else the measured one times a factor.

    Attributes:
        use: name of what it receives.
        factor: see above.
        lever: of the moments in a load, m.
    """

    use: str
    factor: float
    lever: float

    def estimator(self) -> Estimator:
        """Returns the estimator of the policy, behind the memory of the readings."""
        return _ReplacingEstimator(self)

    def act(self, measured: ArrayLike, estimate: Estimate) -> Action:
        """Returns the action of the policy at the measurement that its estimate was made of."""
        assert isinstance(estimate, ReplacedEstimate)
        return self.policy.act(estimate.measured, estimate)

    def received(self, kept: Array, wrench: Array) -> Array:
        """Returns the wrench (6,) that the policy receives for a measured one.

        Args:
            kept: number of readings so far, then the readings (n, 6) that are kept.
            wrench: (6,), measured.
        """
        if self.use == "zero":
            return np.zeros(6)
        if self.use not in READINGS:
            return self.factor * wrench
        number = min(int(kept[0]), READINGS[self.use])
        return kept[1:].reshape(-1, 6)[int(_chances(kept, wrench)[0] * number)].copy() if number else wrench.copy()

    def remembered(self, kept: Array, wrench: Array) -> Array:
        """Returns what is kept after a reading; see `received`.

        If all places for a shuffled wrench are taken, reading n replaces one of them with the probability places / n,
        so that each reading so far is as likely to be kept (Vitter, "Random sampling with a reservoir", 1985).
        """
        found = kept.copy()
        number, places = int(kept[0]), READINGS.get(self.use, 0)
        if self.use == "frozen" and (number > 0 or contact_load(wrench, self.lever) < TOUCH_LOAD):
            return found
        found[0] += 1.0
        place = number if number < places else int(_chances(kept, wrench)[1] * (number + 1))
        if place < places:
            found[1:].reshape(-1, 6)[place] = wrench
        return found


def _chances(kept: Array, wrench: Array) -> Array:
    """Two numbers, uniform in [0, 1), that the noise of a reading decides."""
    return np.random.default_rng([int(kept[0]), *wrench.view(np.uint64).tolist()]).uniform(size=2)


class _ReplacingEstimator:
    """The estimator of a `ReplacedWrench`: its memory is what is kept of the readings, then that of the policy's."""

    def __init__(self, replaced: ReplacedWrench) -> None:
        self._replaced, self._own = replaced, replaced.policy.estimator()
        self._size = 1 + 6 * READINGS.get(replaced.use, 0)

    def initial(self) -> Estimate:
        """See `Estimator`."""
        first = Estimate() if self._own is None else self._own.initial()
        return self._joined(first, np.zeros(self._size), np.zeros(7))

    def step(self, memory: Array, measured: Array) -> Estimate:
        """See `Estimator`."""
        kept, wrench = memory[: self._size], np.array(measured[:6])
        received = np.append(self._replaced.received(kept, wrench), measured[6])
        found = Estimate() if self._own is None else self._own.step(memory[self._size :], received)
        return self._joined(found, self._replaced.remembered(kept, wrench), received)

    def _joined(self, found: Estimate, kept: Array, measured: Array) -> ReplacedEstimate:
        memory = np.concatenate([kept, found.memory])
        return ReplacedEstimate(found.states, found.known, memory=memory, measured=measured)
