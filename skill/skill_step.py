"""A skill that imitates, as numbers and one compiled step: from a measurement to the action, without Python between.

`ManipulationSkill` calls the same parts one after the other.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from skill.arrays import Array
from skill.compiled import compiled
from skill.features.canonical_frame import canonical_angle, turned
from skill.features.contact_features import ContactFeatures, contact_features
from skill.features.wrench_features import MEASURED, CanonicalFeatures, canonical_features
from skill.manipulation_skill import ManipulationSkill
from skill.planning.imitation import FEED, SPIN, ImitationNumbers, imitate
from skill.policy import CarriedOver
from skill.practice.exploration import PerturbedPolicy, factors_at
from skill.regression.locally_weighted_regression import LWRegressor
from skill.states.contact_state_filter import FilterNumbers, contact_filter_step
from skill.states.context_filter import ContextNumbers, context_filter_step, observation_before

N_MEASURED = len(MEASURED)


class SkillNumbers(NamedTuple):
    """A skill for compiled functions.

    Attributes:
        features: peg_radius, force_floor and depth_floor of `CanonicalFeatures`.
        state_features: peg_radius, force_floor and force_share of `ContactFeatures`.
        states: filter of the contact states.
        contexts: filter of the contexts; it is not used if there is a single one.
        imitation: of the actions.
        factors: depths (m) and logarithms of factors on turn and feed, see `skill.practice.exploration.Perturbation`.
        memory: (m,), at the start.
        period: T_s, duration of an action, s.
    """

    features: tuple[float, float, float]
    state_features: tuple[float, float, float]
    states: FilterNumbers
    contexts: ContextNumbers
    imitation: ImitationNumbers
    factors: tuple[Array, Array, Array]
    memory: Array
    period: float


class SkillAnswer(NamedTuple):
    """What a skill believes and does at one measurement.

    Attributes:
        memory: (m,), for the next measurement.
        turn: (2,), of the peg relative to the hole within one period, about x and y of P, rad.
        spin: the same about z, 0 of a skill that does not turn there.
        feed: along its axis within one period, m.
        support: of the action, 0 to 1.
        state: number of the most probable contact state.
        known: whether it is recognised.
        context: number of the most probable context.
        context_probability: its probability.
        context_evidence: what the measurement says for it, less that for the next one.
    """

    memory: Array
    turn: Array
    spin: float
    feed: float
    support: float
    state: int
    known: bool
    context: int
    context_probability: float
    context_evidence: float


def skill_numbers(policy: object) -> SkillNumbers | None:
    """Returns a skill that imitates with the parts of this package, or a perturbed one; None for other policies."""
    if isinstance(policy, CarriedOver):
        policy = policy.policy
    if isinstance(policy, PerturbedPolicy):
        numbers, p = skill_numbers(policy.policy), policy.perturbation
        return None if numbers is None else numbers._replace(factors=(p.depths, p.turn, p.feed))
    if type(policy) is not ManipulationSkill or policy.planning_ is not None:
        return None
    f, s = policy.features_, policy.state_features_
    if (type(f), type(s), type(policy.regressor_)) != (CanonicalFeatures, ContactFeatures, LWRegressor):
        return None
    estimator = policy.estimator()
    return SkillNumbers(
        features=(f.peg_radius, f.force_floor, f.depth_floor),
        state_features=(s.peg_radius, s.force_floor, s.force_share),
        states=estimator.contacts.numbers,
        contexts=NO_CONTEXTS if estimator.contexts is None else estimator.contexts.numbers,
        imitation=policy.imitation().numbers,
        factors=(np.zeros(1), np.zeros(1), np.zeros(1)),
        memory=estimator.initial().memory,
        period=policy.period_,
    )


NO_CONTEXTS = ContextNumbers(
    log_weights=np.zeros(1),
    rows=1,
    peg_radius=1.0,
    X=np.zeros((0, 1)),
    moments=np.zeros((0, 1)),
    memberships=np.zeros((0, 1)),
    bandwidth=1.0,
    feature_scale=np.ones(1),
    input_scale=np.ones(1),
    output_scale=np.ones(1),
    centre=np.ones(1),
    correlation_times=np.ones(1),
)
"""Stands for the contexts of a skill without them."""


@compiled
def skill_step(p: SkillNumbers, memory: Array, measured: Array, pitch: float, yaw: float) -> SkillAnswer:
    """Returns what a skill believes and does at one measurement.

    Args:
        p: the skill.
        memory: (m,), of the measurement before.
        measured: (7,), fx fy fz (N) mx my mz (N m) z (m).
        pitch: commanded angle of the hole, rad, relative to the start.
        yaw: likewise.
    """
    rows, K, C = measured.reshape((1, N_MEASURED)), len(p.states.constants), len(p.contexts.log_weights)
    found = memory.copy()
    radius, floor, share = p.state_features
    seen = contact_features(rows, radius, floor, share)[0, :3].copy()
    found[:K], states, known = contact_filter_step(p.states, memory[:K].copy(), seen)
    radius, floor, depth_floor = p.features
    contexts, evidence = np.ones(1), np.zeros(1)
    if C > 1:
        own = memory[K:].copy()
        before = observation_before(p.contexts, own)
        observation = np.empty(N_MEASURED + 2)
        observation[:N_MEASURED] = measured
        observation[N_MEASURED], observation[N_MEASURED + 1] = -pitch, -yaw
        features = canonical_features(before[:N_MEASURED].copy().reshape((1, N_MEASURED)), radius, floor, depth_floor)
        angle = canonical_angle(before, radius, floor)
        found[K:], contexts, evidence = context_filter_step(p.contexts, own, observation, features[0], angle)
    x = canonical_features(rows, radius, floor, depth_floor)[0]
    done = imitate(p.imitation, x, states, contexts)
    turn, (turn_factor, feed_factor) = np.empty(2), factors_at(-measured[6], *p.factors)
    turn[0], turn[1] = turned(done.action[0], done.action[1], canonical_angle(measured, radius, floor))
    turn *= turn_factor
    first = int(np.argmax(contexts))
    second = first
    for k in range(C):
        if k != first and (second == first or contexts[k] > contexts[second]):
            second = k
    return SkillAnswer(
        found,
        turn,
        done.action[SPIN] if len(done.action) > SPIN else 0.0,
        feed_factor * done.action[FEED],
        done.support,
        int(np.argmax(states)),
        known,
        first,
        contexts[first],
        evidence[first] - evidence[second],
    )
