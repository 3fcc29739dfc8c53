"""What is believed at a sample, and what carries the belief from sample to sample."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Protocol, Self

import numpy as np
from numpy.typing import ArrayLike

from skill.arrays import Array
from skill.features.wrench_features import MEASURED, WrenchFeatures
from skill.states.contact_state_filter import ContactStateFilter
from skill.states.context_filter import ContextFilter


@dataclass(frozen=True)
class Estimate:
    """What is believed at one sample, given all samples so far; by default one state and one context, for certain.

    Attributes:
        states: (K,), probabilities of the contact states.
        contexts: (C,), probabilities of the contexts.
        known: whether the sample is like those of its most probable state.
        evidence: (C,), what this sample added to the logarithms of the contexts, with mean zero.
        memory: (m,), all that the estimator needs at the next sample.
    """

    states: Array = field(default_factory=lambda: np.ones(1))
    contexts: Array = field(default_factory=lambda: np.ones(1))
    known: bool = True
    evidence: Array = field(default_factory=lambda: np.zeros(1))
    memory: Array = field(default_factory=lambda: np.zeros(0))

    @classmethod
    def of_phase(cls, phase: int, count: int) -> Self:
        """Returns the estimate of a law that is in one of ``count`` phases, whose number it remembers."""
        return cls(np.eye(count)[phase], memory=np.array([float(phase)]))

    @property
    def state(self) -> int:
        """Number of the most probable contact state."""
        return int(np.argmax(self.states))

    @property
    def context(self) -> int:
        """Number of the most probable context."""
        return int(np.argmax(self.contexts))

    @property
    def context_evidence(self) -> float:
        """What the sample says for the most probable context, less that for the next one; 0 for a single context."""
        order = np.argsort(-self.contexts, kind="stable")[:2]
        return float(self.evidence[order[0]] - self.evidence[order[-1]])


class Estimator(Protocol):
    """Estimates from sample to sample. It is immutable: its caller stores the memory of the last estimate."""

    def initial(self) -> Estimate:
        """Returns the estimate before the first sample; it has the shapes of all later ones."""

    def step(self, memory: Array, observation: Array) -> Estimate:
        """Returns the estimate at the next sample.

        Args:
            memory: (m,), of the estimate before.
            observation: (9,), the measurement (fx fy fz in N, mx my mz in N m, z in m), and the own turn since the
                start (rad, about x and y of P); see `skill.features.responses`.
        """


class PairEstimator:
    """The estimator of a skill: the filter over pairs of contact state and context, which is a product of two.

    Args:
        contacts: filter of the contact states.
        features: of the measurements for ``contacts``.
        contexts: filter of the contexts; None for a single context.
    """

    def __init__(self, contacts: ContactStateFilter, features: WrenchFeatures, contexts: ContextFilter | None) -> None:
        self.contacts, self._features, self.contexts = contacts, features, contexts

    def initial(self) -> Estimate:
        """See `Estimator`."""
        log_belief = self.contacts.initial_log_belief()
        if self.contexts is None:
            return Estimate(np.exp(log_belief), known=False, memory=log_belief)
        number, memory = self.contexts.n_contexts, self.contexts.initial_memory()
        contexts, evidence = np.full(number, 1.0 / number), np.zeros(number)
        return Estimate(np.exp(log_belief), contexts, False, evidence, np.concatenate([log_belief, memory]))

    def step(self, memory: ArrayLike, observation: ArrayLike) -> Estimate:
        """See `Estimator`.

        Raises:
            ValueError: if a shape is wrong or a number is not finite.
        """
        stored, row = np.asarray(memory, dtype=float), np.asarray(observation, dtype=float)
        K = self.contacts.n_states
        features = self._features.transform(row[None, : len(MEASURED)])[0]
        log_belief, states, known = self.contacts.step(stored[:K], features)
        if self.contexts is None:
            return Estimate(states, known=known, memory=log_belief)
        context = self.contexts.step(stored[K:], row)
        memory = np.concatenate([log_belief, context.memory])
        return Estimate(states, context.probabilities, known, context.evidence, memory)


def estimates(estimator: Estimator | None, observed: Iterable[Array]) -> Iterator[Estimate]:
    """Yields the estimate at each observation (9,) of one run, in the order of time; None believes nothing."""
    estimate = Estimate() if estimator is None else estimator.initial()
    for observation in observed:
        if estimator is not None:
            estimate = estimator.step(estimate.memory, observation)
        yield estimate
