"""Trials by the compiled loop of `systems.rollout`, which is the diagram with the exact engine, and much faster."""

from __future__ import annotations

import math

import pandas as pd

from experiments.trial.ended_trial import EndedTrial, Looks
from experiments.trial.force_metrics import force_figures
from experiments.trial.motion_metrics import motion_figures
from models.arm import RIG
from models.scenario import Scenario
from models.validation import copied
from skill.data.outcome import Outcome
from skill.policy.rig_policy import RigPolicy
from skill.skill_step import skill_numbers
from systems.law.back_off import attempts_text
from systems.law.faults import Fault
from systems.law.force_guard import PEAK
from systems.law.watchdog import FAULT
from systems.law.wiring import check_geometry
from systems.rig_diagram import is_same_rig
from systems.rollout import DIVERGED, FAILED, OUTCOMES, RigNumbers, roll_out

_last: list[tuple[Scenario, RigNumbers]] = []
"""The rig that was made last, which takes long, and its scenario."""


def rolled_out(scenario: Scenario, policy: RigPolicy, *, number: int) -> EndedTrial | None:
    """Performs a trial by the compiled loop.

    Args:
        scenario: resolved.
        policy: that acts.
        number: of the trial, for the record.

    Returns:
        The trial; None if only a diagram can perform it: by an arm, in another engine, with a policy that is no skill
        that imitates or does not receive the measured wrench, or because the simulation breaks down, for which the
        diagram gives the reason.

    Raises:
        ValueError: if the policy was made for another peg or hole.
    """
    looped = scenario.carrier == RIG and scenario.contact.engine == "exact" and scenario.start.depth <= 0.0
    looped = looped and scenario.controller.wrench == "true"
    skill = skill_numbers(policy) if looped else None
    if skill is None:
        return None
    check_geometry(scenario, policy)
    rig = _rig(scenario, skill.period)
    record, ending, time, state = roll_out(rig, scenario, skill)
    depth, tally = float(rig.mechanics.sensor - state.q[0]), record.tally[0]
    if ending in (DIVERGED, FAILED) or not math.isfinite(depth):
        return None
    outcome, step = OUTCOMES[ending], scenario.contact.time_step
    peaks = float(tally["peak_contact"]), float(state.guard[PEAK])
    return EndedTrial(
        number=number,
        scenario=scenario,
        outcome=outcome,
        detail=attempts_text(state.control.back_off, policy.state_names()) if outcome is Outcome.JAMMED else "",
        fault=Fault(int(state.dog[FAULT])),
        failure="",
        time=time,
        depth=depth,
        samples=pd.DataFrame(record.rows),
        forces=force_figures(record.wrenches[1:], scenario.geometry.reach, step, *peaks),
        motion=motion_figures(record.tips, step, scenario.geometry.hole_depth),
        penetration=float(tally["penetration"]),
        looks=Looks(record.seen, record.contacts),
    )


def _rig(scenario: Scenario, policy_period: float) -> RigNumbers:
    """Returns the rig of a scenario, from the one before if it differs only in what is drawn."""
    if not (_last and _last[0][1].control.policy_period == policy_period and is_same_rig(_last[0][0], scenario)):
        _last[:] = [(copied(scenario), RigNumbers.of(scenario, policy_period))]
    return _last[0][1].with_draws(scenario)
