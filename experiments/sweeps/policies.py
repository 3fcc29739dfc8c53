"""Makes the policies of a sweep: loads, learns or tunes them; each has a digest of what it is made from."""

from __future__ import annotations

import hashlib
import importlib
import inspect
import re
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib.metadata import packages_distributions
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from experiments.provenance import version_of, versions
from experiments.sweeps.code_digest import code_digest, is_own, modules_of, values_digest
from experiments.sweeps.specification import PolicyPlan
from experiments.trial.trial_set import TrialSet
from experiments.worker_pool import received
from models.document import brief
from models.scenario import Scenario
from skill.data.demonstration import Demonstration, read_demonstration
from skill.data.geometry import PegHoleGeometry
from skill.features.responses import observations
from skill.features.wrench_features import MEASURED
from skill.manipulation_skill import ManipulationSkill
from skill.policy import CarriedOver, RigPolicy
from skill.states.estimate import estimates
from systems.steps.faults import error_summary

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


@dataclass(frozen=True)
class GivenSkill:
    """What is known of a skill file that a specification names.

    Attributes:
        path: of the file.
        digest: of its content when the sweep was planned.
        geometry: of the peg and hole that it serves; None if it does not say.
    """

    path: Path
    digest: str
    geometry: PegHoleGeometry | None

    @classmethod
    def read(cls, path: Path) -> GivenSkill:
        """Reads a skill file.

        Raises:
            ValueError: if it is none.
        """
        return cls(path, file_digest(path), PegHoleGeometry.find(ManipulationSkill.load(path).metadata_, "the skill"))

    def load(self) -> ManipulationSkill:
        """Loads the skill.

        Raises:
            ValueError: if the file has changed since it was read, or is damaged.
        """
        skill = ManipulationSkill.load(self.path)
        if file_digest(self.path) != self.digest:
            raise ValueError(f"{self.path}: changed since the sweep began; give the command again")
        return skill


def file_digest(path: Path) -> str:
    """Returns a digest of the content of a file."""
    return hashlib.sha256(path.read_bytes()).hexdigest()[:16]


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


def learn(training_context: TrainingContext, *, skill: str | None = None, **options: Any) -> RigPolicy:
    """Learns a `ManipulationSkill` from the demonstrations of a training context.

    Args:
        training_context: with demonstrations.
        skill: import path of a class to use in place of `ManipulationSkill`.
        **options: arguments of the class. Where a text is an import path, what it names is called without arguments;
            so a part such as ``states`` or ``regressor`` is replaced.

    Raises:
        ValueError: if an option cannot be imported, or nothing can be learnt.
    """
    kind = ManipulationSkill if skill is None else imported(skill)
    parts = {name: imported(value)() if import_paths(value) else value for name, value in options.items()}
    learnt: RigPolicy = kind(**parts).fit(training_context.demonstrations)
    return learnt


def check_imports(plan: PolicyPlan) -> None:
    """Checks that what a plan names can be imported and that `learn` knows its options.

    Raises:
        ValueError: naming the policy and what is wrong.
    """
    kind = plan.options.get("skill", "skill.manipulation_skill:ManipulationSkill") if plan.make is None else ""
    if not isinstance(kind, str):
        raise ValueError(
            f"policies.{plan.name}.learn.skill is {brief(kind)}, expected an import path package.module:name"
        )
    try:
        known = {"skill", *inspect.signature(imported(kind)).parameters} if kind else set()
        if plan.make is not None:
            inspect.signature(imported(plan.make)).bind(None, **plan.options)
    except (TypeError, ValueError) as error:
        raise ValueError(f"policies.{plan.name}: {error}") from error
    for name in plan.options if plan.make is None else ():
        if name not in known:
            raise ValueError(f"policies.{plan.name}.learn.{name}: unknown key, expected one of {sorted(known)}")
    for path in named_by(plan):
        try:
            imported(path)
        except ValueError as error:
            raise ValueError(f"policies.{plan.name}: {error}") from error


def import_paths(*values: Any) -> list[str]:
    """Returns the values that are import paths."""
    return [value for value in values if isinstance(value, str) and IMPORT_PATH.fullmatch(value)]


def make_policy(plan: PolicyPlan, training_context: TrainingContext) -> MadePolicy:
    """Makes the policy of a plan from a training context, on one thread.

    Raises:
        ValueError: naming the policy and why it cannot be made, or not be sent to the processes that perform trials.
    """
    try:
        made = _made(plan, training_context)
    except Exception as error:  # whatever a part of the user raises
        raise ValueError(f"policies.{plan.name}: cannot be made ({error_summary(error)})") from error
    try:
        received(made.policy)
    except Exception as error:  # whatever the policy of a user holds
        raise ValueError(
            f"policies.{plan.name}: cannot be sent to another process ({error_summary(error)}); let it make what it"
            " holds, such as locks and open files, when it acts first, and leave it out in __getstate__"
        ) from error
    return made


def _made(plan: PolicyPlan, training_context: TrainingContext) -> MadePolicy:
    make: Callable[..., RigPolicy] = learn if plan.make is None else imported(plan.make)
    begun = time.process_time()
    with threadpool_limits(1):
        policy = make(training_context, **plan.options)
    trained = time.process_time() - begun
    found = policy.metadata_.get("demonstrations")
    return MadePolicy(
        policy=CarriedOver(policy) if plan.carried_over else policy,
        train_s=trained,
        query_ms=query_time(policy, training_context.demonstrations) if training_context.demonstrations else None,
        demonstrations=found if isinstance(found, int) else None,
    )


def chosen(plan: PolicyPlan, paths: list[Path]) -> list[Demonstration]:
    """Reads the demonstrations of a set that a plan learns from, given the files of the good ones, then of the bad."""
    if plan.demonstrations is None:
        return []
    found = [read_demonstration(path) for path in paths]
    if plan.demonstrations.select is not None:
        try:
            found = imported(plan.demonstrations.select)(found)
        except Exception as error:  # whatever a user's function raises
            raise ValueError(f"policies.{plan.name}: {plan.demonstrations.select}: {error_summary(error)}") from error
    return found


def policy_digest(plan: PolicyPlan, made_from: Mapping[str, Any]) -> str:
    """Returns the digest of what decides a policy: its plan, what it is made from, and the code of its own modules.

    Args:
        plan: of the policy.
        made_from: what else decides it, as JSON values: the skill file, the demonstrations, or the scenario.
    """
    select = plan.demonstrations.select if plan.demonstrations else None
    return values_digest(
        {
            **{"carried_over": plan.carried_over, "make": plan.make, "options": plan.options, "select": select},
            **{"from": dict(made_from), "versions": versions()},
            "code": _named_code(tuple(_named_modules(plan))),
        }
    )


def own_modules(plan: PolicyPlan) -> set[str]:
    """Returns the names of the modules that a plan names and of what they import, without installed packages."""
    return _own_modules(_named_modules(plan))


def named_packages(plan: PolicyPlan) -> dict[str, str]:
    """Returns the versions of the installed distributions that hold what a plan names."""
    return _packages(_named_modules(plan))


@cache
def _named_code(modules: tuple[str, ...]) -> tuple[str, dict[str, str]]:
    """A digest of the source of some modules and their imports, and the versions of packages."""
    return code_digest(_own_modules(modules)), _packages(modules)


def _own_modules(modules: Iterable[str]) -> set[str]:
    return modules_of(module for module in modules if is_own(module.split(".")[0]))


def _packages(modules: Iterable[str]) -> dict[str, str]:
    tops = {module.split(".")[0] for module in modules}
    names = {name for top in tops if not is_own(top) for name in _distributions().get(top, ())}
    return {name: version_of(name) for name in sorted(names)}


def _named_modules(plan: PolicyPlan) -> list[str]:
    return [path.partition(":")[0] for path in named_by(plan)]


def named_by(plan: PolicyPlan) -> list[str]:
    """Returns the import paths of a plan."""
    select = plan.demonstrations.select if plan.demonstrations else None
    return import_paths(plan.make, select, *plan.options.values())


@cache
def _distributions() -> Mapping[str, list[str]]:
    return packages_distributions()


def query_time(policy: RigPolicy, demonstrations: list[Demonstration]) -> float:
    """Median time of one decision (features, state, context and action) over measurements of demonstrations, ms."""
    rows = np.vstack([d.samples[list(MEASURED)].to_numpy() for d in demonstrations])
    rows = rows[np.linspace(0, len(rows) - 1, QUERIES).astype(int)]
    found, times = estimates(policy.estimator(), observations(rows, np.zeros((QUERIES, 2)))), []
    for row in rows:
        begun = time.perf_counter()
        policy.act(row, next(found))
        times.append(time.perf_counter() - begun)
    return 1e3 * float(np.median(times))
