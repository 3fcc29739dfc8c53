"""What a policy is asked, and what it answers, in the frame of the features."""

from __future__ import annotations

from typing import NamedTuple

from skill.arrays import Array
from skill.regression.local_model import LocalSamples


class Query(NamedTuple):
    """One measurement, and what is believed at that time.

    Attributes:
        row: (1, 7), the measurement: fx fy fz (N) mx my mz (N m) z (m).
        X: (1, d), its features.
        P: (1, K), probabilities of the contact states.
        Q: (1, C), probabilities of the contexts.
    """

    row: Array
    X: Array
    P: Array
    Q: Array


class DesiredState(NamedTuple):
    """The desired next state; the loads are those of `skill.features.responses.LOADS`.

    Attributes:
        state: its number; K for the insertion itself.
        share: the share of the votes for it, 0 to 1.
        change: (5,), change of the loads until it begins, N.
        time: time until then, s.
    """

    state: int
    share: float
    change: Array
    time: float


class Plan(NamedTuple):
    """What a planner expects of its action.

    Attributes:
        desired: the desired next state.
        loads: (5,), the present loads, N.
        expected: (5,), the loads that the forward model expects one horizon later, N.
        beyond: (5,), how far they are expected outside the bounds of the state, N; zero inside.
    """

    desired: DesiredState
    loads: Array
    expected: Array
    beyond: Array


class Prediction(NamedTuple):
    """The action at one query.

    Attributes:
        action: (3,), turn about x and y (rad) and feed (m) in the frame of the features, over one sample period.
        support: see `skill.policy.Action`.
        contexts: (1, C), the probabilities of the contexts as far as they matter.
        relevance: how far the context matters, 0 to 1.
        limited: whether a turn was limited to what the neighbours did.
        samples: the demonstrated samples nearby; None for a regressor that does not tell them.
        plan: what a planner expects; None for an imitation.
    """

    action: Array
    support: float
    contexts: Array
    relevance: float
    limited: bool
    samples: LocalSamples | None = None
    plan: Plan | None = None
