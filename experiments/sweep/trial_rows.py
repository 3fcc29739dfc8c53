"""The rows of a sweep: one trial each, with all that decides it and all that was measured."""

from __future__ import annotations

import time
from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any

from threadpoolctl import threadpool_limits

from experiments.sweep.blocks import Row
from experiments.sweep.trial_files import MEASURED_NUMBERS
from experiments.trial.run_trial import perform_trial
from experiments.trial.trial_result import COUNTS, TrialResult
from experiments.trial.trial_set import TrialSet, trial_scenario
from models.scenario import Scenario, dump_scenario
from skill.policy.rig_policy import RigPolicy


def perform(
    scenario: Scenario, trial_set: TrialSet, policy: RigPolicy, number: int, known: Mapping[str, Any], *, cell: str
) -> Row:
    """Performs one trial and returns its row.

    Args:
        scenario: unresolved.
        trial_set: which trials.
        policy: that acts.
        number: of the trial.
        known: further columns, the same for all trials of the cell.
        cell: digest of the cell, whose trials may share a rig.

    Raises:
        ValueError: if the scenario has no such trial, or the policy is made for another peg or hole.
    """
    began, cpu = datetime.now(UTC), time.process_time()
    with threadpool_limits(1):
        resolved = trial_scenario(scenario, number=number, trial_set=trial_set)
        result = perform_trial(resolved, policy, number=number, cell=cell).result
    return {
        **result_columns(result),
        **scenario_columns(resolved),
        **known,
        "states": len(policy.state_names()),
        "cpu_s": time.process_time() - cpu,
        "began": began.isoformat(timespec="seconds"),
    }


def result_columns(result: TrialResult) -> Row:
    """Returns the columns of a result: rounded, in mm, um and degrees, as in ``results.json``."""
    record = result.record()
    pitch, yaw = record["tilt_deg"]
    return {
        **{"trial": result.seed, "inserted": result.inserted, "outcome": result.outcome.value},
        **{"fault": result.fault.name.lower() if result.fault else "", "reason": result.reason},
        **{"trusted": result.trusted, "tilt_x_deg": pitch, "tilt_y_deg": yaw},
        **{name: record[name] for name in (*MEASURED_NUMBERS, *COUNTS) if name in record},
    }


def scenario_columns(scenario: Scenario) -> Row:
    """Returns the columns of a resolved scenario."""
    g, pivot = scenario.geometry, scenario.rig.pivot_height
    return {
        **{"friction": scenario.contact.friction, "pivot_mm": None if pivot is None else 1e3 * pivot},
        **{"peg_radius_mm": 1e3 * g.peg_radius, "hole_radius_mm": 1e3 * g.hole_radius},
        **{"clearance": g.clearance / g.peg_radius, "force_limit_n": scenario.controller.guard.force_limit},
        **{"time_limit_s": scenario.trial.time_limit, "scenario": dump_scenario(scenario)},
    }
