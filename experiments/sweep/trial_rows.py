"""The rows of a sweep: one trial each, with all that decides it and all that was measured."""

from __future__ import annotations

import json
import time
from datetime import UTC, datetime

from threadpoolctl import threadpool_limits

from experiments.provenance import versions
from experiments.sweep.cell_files import Row
from experiments.sweep.cells import Cell
from experiments.sweep.code_digest import code_digest
from experiments.sweep.policies import MadePolicy
from experiments.sweep.trial_files import MEASURED_NUMBERS
from experiments.trial.run_trial import perform_trial
from experiments.trial.trial_result import COUNTS, TrialResult
from models.scenario import Scenario, dump_scenario


def perform(cell: Cell, made: MadePolicy, number: int) -> Row:
    """Performs one trial of a cell and returns its row; the trials of a cell may share a rig.

    Raises:
        ValueError: if the scenario has no such trial, or the policy is made for another peg or hole.
    """
    began, cpu, taught_by = datetime.now(UTC), time.process_time(), cell.recipe.demonstrations
    with threadpool_limits(1):
        drawn, result = perform_trial(
            cell.scenario, made.policy, number=number, trial_set=cell.trial_set, cell=cell.digest
        )
    return {
        **result_columns(result),
        **scenario_columns(drawn),
        **{"factors": cell.factors, "skill": cell.recipe.digest, "states": len(made.policy.state_names())},
        **{"demonstrations": made.demonstrations, "demonstration_set": None if taught_by is None else taught_by.seed},
        **{"train_s": made.train_s, "query_ms": made.query_ms, "cpu_s": time.process_time() - cpu},
        **{"code": code_digest(), "versions": json.dumps(versions()), "began": began.isoformat(timespec="seconds")},
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
