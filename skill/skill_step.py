"""A skill that imitates, as numbers and one compiled step: from a measurement to the action, without Python between.

`ManipulationSkill` calls the same parts one after the other.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from compiled import compiled
from skill.arrays import Array
from skill.features.canonical_frame import canonical_angle, turned
from skill.features.contact_features import ContactFeatures, contact_features
from skill.features.measurement import MEASURED
from skill.features.wrench_features import CanonicalFeatures, canonical_features
from skill.manipulation_skill import ManipulationSkill
from skill.policy.imitation import FEED, SPIN, ImitationNumbers, imitate
from skill.policy.rig_policy import CarriedOver
from skill.practice import PerturbedPolicy, factors_at
from skill.regression.locally_weighted_regression import LWRegressor
from skill.states.contact_state_filter import FilterNumbers, contact_filter_step

N_MEASURED = len(MEASURED)


class SkillNumbers(NamedTuple):
    """A skill for compiled functions.

    Attributes:
        features: peg_radius, force_floor and depth_floor of `CanonicalFeatures`.
        state_features: peg_radius, force_floor and force_share of `ContactFeatures`.
        states: filter of the contact states.
        imitation: of the actions.
        factors: depths (m) and logarithms of factors on turn and feed, see `skill.practice.Perturbation`.
        memory: (m,), at the start.
        period: T_s, duration of an action, s.
    """

    features: tuple[float, float, float]
    state_features: tuple[float, float, float]
    states: FilterNumbers
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
    """

    memory: Array
    turn: Array
    spin: float
    feed: float
    support: float
    state: int
    known: bool


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
        imitation=policy.imitation().numbers,
        factors=(np.zeros(1), np.zeros(1), np.zeros(1)),
        memory=estimator.contacts.initial_log_belief(),
        period=policy.period_,
    )


@compiled
def skill_step(p: SkillNumbers, memory: Array, measured: Array) -> SkillAnswer:
    """Returns what a skill believes and does at one measurement.

    Args:
        p: the skill.
        memory: (m,), of the measurement before.
        measured: (7,), fx fy fz (N) mx my mz (N m) z (m).
    """
    rows = measured.reshape((1, N_MEASURED))
    radius, floor, share = p.state_features
    seen = contact_features(rows, radius, floor, share)[0, :3].copy()
    belief, states, known = contact_filter_step(p.states, memory.copy(), seen)
    radius, floor, depth_floor = p.features
    done = imitate(p.imitation, canonical_features(rows, radius, floor, depth_floor)[0], states)
    turn, (turn_factor, feed_factor) = np.empty(2), factors_at(-measured[6], *p.factors)
    turn[0], turn[1] = turned(done.action[0], done.action[1], canonical_angle(measured, radius, floor))
    turn *= turn_factor
    return SkillAnswer(
        belief,
        turn,
        done.action[SPIN] if len(done.action) > SPIN else 0.0,
        feed_factor * done.action[FEED],
        done.support,
        int(np.argmax(states)),
        known,
    )
