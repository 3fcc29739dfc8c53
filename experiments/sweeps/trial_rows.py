"""The rows of a sweep: one trial each, with all that decides it and all that was measured."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache
from typing import Any

from threadpoolctl import threadpool_limits

from experiments.provenance import versions
from experiments.sweeps.code_digest import code_digest, modules_of, values_digest
from experiments.sweeps.trial_files import MEASURED_NUMBERS
from experiments.trial.run_trial import perform_trial
from experiments.trial.trial_result import COUNTS, TrialResult
from experiments.trial.trial_set import TrialSet, trial_scenario
from models.scenario import Scenario, dump_scenario
from skill.policy import RigPolicy

Row = dict[str, Any]


@dataclass(frozen=True)
class TrialSource:
    """All that decides the trials of a cell but their number.

    Attributes:
        scenario: unresolved, of the cell.
        trial_set: which trials.
        policy: digest of the policy that acts.
        name: of the policy.
        factors: of the cell, as JSON.
    """

    scenario: Scenario
    trial_set: TrialSet
    policy: str
    name: str
    factors: str

    @property
    def engine(self) -> str:
        """The engine that simulates."""
        return self.scenario.contact.engine

    def digest(self) -> str:
        """Returns the digest of what decides the trials, the code and the versions of the packages included."""
        known = {
            **{"scenario": self.scenario, "trial_set": self.trial_set.value},
            **{"policy": self.policy, "name": self.name, "factors": self.factors, "code": trial_code()},
            "versions": versions(),
        }
        return values_digest(known)


def row_key(source_digest: str, number: int) -> str:
    """Returns the key of a trial, given the digest of its source and its number."""
    return hashlib.sha256(f"{source_digest} {number}".encode()).hexdigest()[:32]


@cache
def trial_code() -> str:
    """Returns the digest of the code that simulates trials and makes policies, as this process found it first."""
    return code_digest(trial_modules())


@cache
def trial_modules() -> tuple[str, ...]:
    """Returns the names of the modules that `trial_code` reads."""
    return tuple(sorted(modules_of([__name__, "experiments.sweeps.policies", "experiments.demonstration_set"])))


def perform(source: TrialSource, policy: RigPolicy, number: int, known: Mapping[str, Any]) -> Row:
    """Performs one trial and returns its row.

    Args:
        source: of the trial.
        policy: that acts.
        number: of the trial.
        known: further columns, the same for all trials of the policy.

    Raises:
        ValueError: if the scenario has no such trial, or the policy is made for another peg or hole.
    """
    began, cpu = datetime.now(UTC), time.process_time()
    with threadpool_limits(1):
        scenario = trial_scenario(source.scenario, number=number, trial_set=source.trial_set)
        result = perform_trial(scenario, policy, number=number, cell=source).result
    return {
        **result_columns(result),
        **scenario_columns(scenario),
        **known,
        "factors": source.factors,
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
