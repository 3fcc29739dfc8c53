"""What is believed at a sample, and what carries the belief from sample to sample."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Protocol, Self

import numpy as np
from numpy.typing import ArrayLike

from skill.arrays import Array
from skill.features.measurement import MEASURED
from skill.features.wrench_features import WrenchFeatures
from skill.states.contact_state_filter import ContactStateFilter


@dataclass(frozen=True)
class Estimate:
    """What is believed at one sample, given all samples so far; by default one state, for certain.

    Attributes:
        states: (K,), probabilities of the contact states.
        known: whether the sample is like those of its most probable state.
        memory: (m,), all that the estimator needs at the next sample.
    """

    states: Array = field(default_factory=lambda: np.ones(1))
    known: bool = True
    memory: Array = field(default_factory=lambda: np.zeros(0))

    @classmethod
    def of_phase(cls, phase: int, count: int) -> Self:
        """Returns the estimate of a law that is in one of ``count`` phases, whose number it remembers."""
        return cls(np.eye(count)[phase], memory=np.array([float(phase)]))

    @property
    def state(self) -> int:
        """Number of the most probable contact state."""
        return int(np.argmax(self.states))


class Estimator(Protocol):
    """Estimates from sample to sample. It is immutable: its caller stores the memory of the last estimate."""

    def initial(self) -> Estimate:
        """Returns the estimate before the first sample; it has the shapes of all later ones."""

    def step(self, memory: Array, measured: Array) -> Estimate:
        """Returns the estimate at the next sample.

        Args:
            memory: (m,), of the estimate before.
            measured: (7,), fx fy fz (N) mx my mz (N m) z (m).
        """


class StateEstimator:
    """The estimator of a skill: the filter of its contact states.

    Args:
        contacts: the filter.
        features: of the measurements for it.
    """

    def __init__(self, contacts: ContactStateFilter, features: WrenchFeatures) -> None:
        self.contacts, self._features = contacts, features

    def initial(self) -> Estimate:
        """See `Estimator`."""
        log_belief = self.contacts.initial_log_belief()
        return Estimate(np.exp(log_belief), known=False, memory=log_belief)

    def step(self, memory: ArrayLike, measured: ArrayLike) -> Estimate:
        """See `Estimator`.

        Raises:
            ValueError: if a shape is wrong or a number is not finite.
        """
        row = np.asarray(measured, dtype=float)
        features = self._features.transform(row[None, : len(MEASURED)])[0]
        log_belief, states, known = self.contacts.step(memory, features)
        return Estimate(states, known, log_belief)


def estimates(estimator: Estimator | None, observed: Iterable[Array]) -> Iterator[Estimate]:
    """Yields the estimate at each observation (9,) of one run, in the order of time; None believes nothing."""
    estimate = Estimate() if estimator is None else estimator.initial()
    for observation in observed:
        if estimator is not None:
            estimate = estimator.step(estimate.memory, observation)
        yield estimate
