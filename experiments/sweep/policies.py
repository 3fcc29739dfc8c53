"""Makes the policies of a sweep: learns or tunes them; each has a digest of what it is made from."""

from __future__ import annotations

import importlib
import inspect
import re
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import packages_distributions
from pathlib import Path
from typing import Any

import numpy as np
from joblib.externals.loky.backend.reduction import dumps
from threadpoolctl import threadpool_limits

from experiments.provenance import version_of
from experiments.sweep.code_digest import Requirements, own_packages
from experiments.sweep.specification import PolicyPlan
from experiments.trial.trial_set import TrialSet
from models.scenario import Scenario
from skill.data.demonstration import Demonstration, read_demonstration
from skill.features.measurement import MEASURED, observations
from skill.manipulation_skill import ManipulationSkill
from skill.policy.rig_policy import CarriedOver, RigPolicy
from skill.states.estimate import estimates
from systems.law.faults import error_summary

IMPORT_PATH = re.compile(r"[A-Za-z_][\w.]*:\w+")
"""What names something in a module."""

QUERIES = 300
"""Decisions over which the query time is measured."""


@dataclass(frozen=True)
class TrainingContext:
    """What a policy is made from.

    Attributes:
        scenario: unresolved, of the cell in which the policy will act.
        trial_set: which trials it will perform; None for all (``for_all_trial_sets``).
        demonstrations: of one set; empty for a policy that learns nothing.
        seed: of the set of demonstrations.
    """

    scenario: Scenario
    trial_set: TrialSet | None
    demonstrations: list[Demonstration]
    seed: int


@dataclass(frozen=True)
class MadePolicy:
    """A policy and what making it cost.

    Attributes:
        policy: that acts.
        train_s: CPU time of the making, s; None for a skill that was loaded.
        query_ms: median time of a decision over measurements of demonstrations, ms; None without any.
        demonstrations: number that it learnt from; None if it learnt from none or does not say.
    """

    policy: RigPolicy
    train_s: float | None
    query_ms: float | None
    demonstrations: int | None


def imported(path: str) -> Any:
    """Returns what an import path ``package.module:name`` names.

    Raises:
        ValueError: if there is no such module or name. The message says why.
    """
    module, _, name = path.partition(":")
    try:
        return getattr(importlib.import_module(module), name)
    except Exception as error:  # whatever a module raises
        raise ValueError(f"{path}: cannot be imported ({error_summary(error)})") from error


def learn(
    training_context: TrainingContext, *, skill: str = "skill.manipulation_skill:ManipulationSkill", **options: Any
) -> RigPolicy:
    """Learns a skill from the demonstrations of a training context.

    Args:
        training_context: with demonstrations.
        skill: import path of its class.
        **options: arguments of the class. Where a text is an import path, what it names is called without arguments;
            so a part such as ``states`` or ``regressor`` is replaced.

    Raises:
        ValueError: if an option cannot be imported, or nothing can be learnt.
    """
    parts = {name: imported(value)() if _is_import_path(value) else value for name, value in options.items()}
    learnt: RigPolicy = imported(skill)(**parts).fit(training_context.demonstrations)
    return learnt


def check_imports(plan: PolicyPlan, where: str) -> None:
    """Checks that what a plan names can be imported, and that what makes the policy knows its options.

    Raises:
        ValueError: naming ``where``, the policy and what is wrong.
    """
    try:
        for path in named_by(plan):
            imported(path)
        if plan.make is not None:
            inspect.signature(imported(plan.make)).bind(None, **plan.options)
        elif plan.skill is None:
            options = {name: value for name, value in plan.options.items() if name != "skill"}
            kind = imported(plan.options["skill"]) if "skill" in plan.options else ManipulationSkill
            inspect.signature(kind).bind_partial(**options)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{where}: policies.{plan.name}: {error}") from error


def make_policy(plan: PolicyPlan, training_context: TrainingContext) -> MadePolicy:
    """Makes the policy of a plan from a training context, on one thread.

    Raises:
        ValueError: naming the policy and why it cannot be made, or not be sent to the processes that perform trials.
    """
    make: Callable[..., RigPolicy] = learn if plan.make is None else imported(plan.make)
    shown, begun = training_context.demonstrations, time.process_time()
    try:
        with threadpool_limits(1):
            policy = make(training_context, **plan.options)
        trained = time.process_time() - begun
        dumps(policy)
    except Exception as error:  # whatever a part of the user raises
        raise ValueError(f"policies.{plan.name}: cannot be made and sent ({error_summary(error)})") from error
    found = policy.metadata_.get("demonstrations")
    return MadePolicy(
        policy=CarriedOver(policy) if plan.carried_over else policy,
        train_s=trained,
        query_ms=query_time(policy, shown) if shown else None,
        demonstrations=found if isinstance(found, int) else None,
    )


def chosen(plan: PolicyPlan, paths: list[Path]) -> list[Demonstration]:
    """Reads the demonstrations of a set that a plan learns from, given the files of the good ones, then of the bad."""
    found = [read_demonstration(path) for path in paths]
    if plan.demonstrations is not None and plan.demonstrations.select is not None:
        try:
            found = imported(plan.demonstrations.select)(found)
        except Exception as error:  # whatever a user's function raises
            raise ValueError(f"policies.{plan.name}: {plan.demonstrations.select}: {error_summary(error)}") from error
    return found


def requirements_of(plan: PolicyPlan) -> Requirements:
    """Returns what work with the policy of a plan requires of a worker: what it names, beside what all trials need."""
    own = own_packages(named_by(plan))
    tops = {path.partition(":")[0].split(".")[0] for path in named_by(plan)}.difference(own)
    distributions = packages_distributions() if tops else {}
    names = sorted({name for top in tops for name in distributions.get(top, ())})
    return Requirements.of(own, {name: version_of(name) for name in names})


def named_by(plan: PolicyPlan) -> list[str]:
    """Returns the import paths of a plan."""
    select = plan.demonstrations.select if plan.demonstrations else None
    return [value for value in (plan.make, select, *plan.options.values()) if _is_import_path(value)]


def _is_import_path(value: object) -> bool:
    return isinstance(value, str) and IMPORT_PATH.fullmatch(value) is not None


def query_time(policy: RigPolicy, demonstrations: list[Demonstration]) -> float:
    """Median time of one decision (features, state and action) over measurements of demonstrations, ms."""
    rows = np.vstack([d.samples[list(MEASURED)].to_numpy() for d in demonstrations])
    rows = rows[np.linspace(0, len(rows) - 1, QUERIES).astype(int)]
    found, times = estimates(policy.estimator(), observations(rows, np.zeros((QUERIES, 2)))), []
    for row in rows:
        begun = time.perf_counter()
        policy.act(row, next(found))
        times.append(time.perf_counter() - begun)
    return 1e3 * float(np.median(times))
