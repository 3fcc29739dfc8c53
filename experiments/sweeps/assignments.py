"""What a specification asks for: which policy, made from what, performs which trials of which cell."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from experiments.demonstration_set import Request, requests
from experiments.provenance import versions
from experiments.sweeps.code_digest import values_digest
from experiments.sweeps.factors import Cell
from experiments.sweeps.policies import GivenSkill, check_imports, policy_digest
from experiments.sweeps.result_blocks import Block, blocks_of
from experiments.sweeps.specification import BASE, PolicyPlan, Specification, plan_in
from experiments.sweeps.trial_rows import TrialSource, trial_code
from experiments.trial.trial_set import TrialSet, trial_scenario
from models.scenario import Geometry, Scenario
from skill.data.geometry import PegHoleGeometry, fit_difference


@dataclass(frozen=True)
class DemonstrationSource:
    """A set of demonstrations.

    Attributes:
        scenario: unresolved, in which they are recorded.
        good, bad: numbers of them.
        seed: of the set.
    """

    scenario: Scenario
    good: int
    bad: int
    seed: int

    def requests(self) -> list[Request]:
        """Returns the requests of the set: the good ones, then the bad ones."""
        return requests(self.good, self.bad)

    def first(self, size: int | None) -> list[Request]:
        """Returns the first requests of each outcome, in the proportion of the set; at least one is good."""
        if size is None:
            return self.requests()
        good = min(max(1, round(size * self.good / (self.good + self.bad))), self.good)
        bad = min(size - good, self.bad)
        return [*self.requests()[:good], *self.requests()[self.good : self.good + bad]]

    @cached_property
    def digest(self) -> str:
        """The digest of what decides the set, the code included."""
        known = {"scenario": self.scenario, "good": self.good, "bad": self.bad, "seed": self.seed}
        return values_digest({**known, "code": trial_code(), "versions": versions()})


@dataclass(frozen=True)
class PolicySource:
    """A policy that has to be made.

    Attributes:
        plan: how; with the demonstrations of its cell.
        given: the skill file, or None.
        demonstrations: what it learns from, or None.
        scenario: unresolved, of the cell in which it acts; the one of its first cell if it does not depend on it.
        trial_set: which trials it performs; likewise.
        digest: of what decides it.
    """

    plan: PolicyPlan
    given: GivenSkill | None
    demonstrations: DemonstrationSource | None
    scenario: Scenario
    trial_set: TrialSet
    digest: str


@dataclass(frozen=True)
class Assignment:
    """Trials of one policy in one cell, set of trials and engine.

    Attributes:
        source: of the trials.
        policy: that performs them.
        blocks: where their rows belong.
    """

    source: TrialSource
    policy: PolicySource
    blocks: list[Block]


def assignments(specification: Specification, results: Path, where: str) -> list[Assignment]:
    """Returns what a specification asks for, in its order: cells, policies, sets of trials, engines, demonstrations.

    Args:
        specification: of the sweep.
        results: folder of its rows.
        where: name of the specification, for messages.

    Raises:
        ValueError: if a policy serves another peg or hole than that of a cell, or a cell has no hard trial.
    """
    found: list[Assignment] = []
    skills: dict[str, GivenSkill] = {}
    for plan in specification.policies:
        try:
            check_imports(plan)
        except ValueError as error:
            raise ValueError(f"{where}: {error}") from error
        if plan.skill is not None:
            skills[plan.name] = GivenSkill.read(plan.skill)
    for cell in specification.cells:
        scenario = specification.scenario_with(cell.scenario_overrides(), where)
        for trial_set in specification.trial_sets:
            try:
                trial_scenario(scenario, number=specification.first, trial_set=trial_set)
            except ValueError as error:
                raise ValueError(f"{where}: the {trial_set} trials in the cell {cell.label}: {error}") from error
        for plan in specification.policies:
            given = skills.get(plan.name)
            for trial_set, engine in itertools.product(specification.trial_sets, specification.engines):
                own = replace(scenario, contact=replace(scenario.contact, engine=engine))
                # Policies are tuned and practise with the wrench that is measured, whatever they receive in the trials.
                made_in = replace(own, controller=replace(own.controller, wrench="true"))
                for policy, numbers in _policies(specification, plan, given, cell, made_in, trial_set, where):
                    source = TrialSource(own, trial_set, policy.digest, plan.name, cell.label)
                    folders = {"policy": plan.name, "trial_set": trial_set.value, "engine": engine}
                    blocks = blocks_of(results, source.digest(), numbers, **folders)
                    found.append(Assignment(source, policy, blocks))
    return found


def _policies(
    specification: Specification,
    plan: PolicyPlan,
    given: GivenSkill | None,
    cell: Cell,
    scenario: Scenario,
    trial_set: TrialSet,
    where: str,
) -> Iterator[tuple[PolicySource, list[int]]]:
    """Yields the policies of a plan in a cell, one for each set of demonstrations, and the numbers of their trials."""
    numbers = list(range(specification.first, specification.first + plan.trials))
    teaching = plan_in(plan, cell, where)
    if teaching is None:
        acting = _acting(plan, scenario, trial_set)
        if given is not None:
            acting = {"skill": given.digest}
            _require_geometry(plan, scenario, given.geometry, where)
        yield PolicySource(plan, given, None, scenario, trial_set, policy_digest(plan, acting)), numbers
        return
    changed = {} if teaching.demonstrated_in == BASE else cell.scenario_overrides()
    shown = specification.scenario_with({**changed, **teaching.scenario}, where)
    _require_geometry(plan, scenario, shown.geometry, where)
    for k, seed in enumerate(teaching.sets):
        source = DemonstrationSource(shown, teaching.good, teaching.bad, seed)
        made_from: dict[str, Any] = {"demonstrations": source.digest, "size": teaching.size}
        if plan.make is not None:
            made_from |= _acting(plan, scenario, trial_set)
        own = [n for n in numbers if n % len(teaching.sets) == k] if teaching.divided else numbers
        taught = replace(plan, demonstrations=teaching)
        if own:
            yield PolicySource(taught, None, source, scenario, trial_set, policy_digest(taught, made_from)), own


def _acting(plan: PolicyPlan, scenario: Scenario, trial_set: TrialSet) -> dict[str, Any]:
    """What a function that makes policies is told of the trials."""
    return {"scenario": scenario} | ({} if plan.for_all_trial_sets else {"trial_set": trial_set.value})


def _require_geometry(
    plan: PolicyPlan, scenario: Scenario, learnt: Geometry | PegHoleGeometry | None, where: str
) -> None:
    """Checks that a policy that is not carried over learns for the peg and hole of its cell; None: it does not say."""
    if plan.carried_over or learnt is None:
        return
    difference = fit_difference(asdict(learnt), asdict(scenario.geometry))
    if difference:
        raise ValueError(
            f"{where}: policies.{plan.name} learns for {difference} as a cell needs; set carried_over: true, or"
            " demonstrations.demonstrated_in: cell"
        )
