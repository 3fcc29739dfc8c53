"""What a specification asks for: which policy, made from what, performs which trials under which conditions."""

from __future__ import annotations

import hashlib
import itertools
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from typing import Any

from experiments.demonstration_set import Request, requests
from experiments.provenance import versions
from experiments.sweep.code_digest import Requirements, code_digest, values_digest
from experiments.sweep.policies import check_imports, requirements_of
from experiments.sweep.specification import BASE, Combination, PolicyPlan, Specification, plan_in
from experiments.trial.trial_set import TrialSet, trial_scenario
from models.scenario import Geometry, Scenario
from skill.data.geometry import PegHoleGeometry, fit_difference
from skill.manipulation_skill import ManipulationSkill


@dataclass(frozen=True)
class DemonstrationSet:
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
        return values_digest({**known, "code": code_digest(), "versions": versions()})


@dataclass(frozen=True)
class PolicyRecipe:
    """How a policy is made.

    Attributes:
        plan: of the specification; with the demonstrations of its combination of levels.
        given: the skill of a file, or None.
        demonstrations: what it learns from, or None.
        scenario: unresolved, of the cell in which it acts; of the first one if it does not depend on it.
        trial_set: which trials it performs; likewise.
        made_from: what else decides it, as JSON values: the skill file, the demonstrations, or the scenario.
    """

    plan: PolicyPlan
    given: ManipulationSkill | None
    demonstrations: DemonstrationSet | None
    scenario: Scenario
    trial_set: TrialSet
    made_from: dict[str, Any]

    @cached_property
    def requirements(self) -> Requirements:
        """What a worker needs that makes it, or performs trials with it."""
        return requirements_of(self.plan)

    @cached_property
    def digest(self) -> str:
        """The digest of what decides it, the code and the versions of packages included."""
        plan = self.plan
        select = plan.demonstrations.select if plan.demonstrations else None
        known = {"carried_over": plan.carried_over, "make": plan.make, "options": plan.options, "select": select}
        return values_digest({**known, "from": self.made_from, "needs": self.requirements})


@dataclass(frozen=True)
class Cell:
    """Trials of one policy in one combination of levels, set of trials and engine.

    Attributes:
        recipe: of the policy that performs them.
        scenario: unresolved; its engine is that of the cell.
        trial_set: which trials.
        factors: value of each factor, as JSON.
        numbers: of the trials.
    """

    recipe: PolicyRecipe
    scenario: Scenario
    trial_set: TrialSet
    factors: str
    numbers: list[int]

    @property
    def policy(self) -> str:
        """The name of the policy."""
        return self.recipe.plan.name

    @property
    def engine(self) -> str:
        """The engine that simulates."""
        return self.scenario.contact.engine

    @cached_property
    def digest(self) -> str:
        """The digest of what decides the trials but their number, the code and the versions of packages included."""
        known: dict[str, Any] = {"policy": self.recipe.digest, "name": self.policy, "trial_set": self.trial_set.value}
        known |= {"scenario": self.scenario, "factors": self.factors}
        return values_digest({**known, "code": code_digest(), "versions": versions()})


def cells_of(specification: Specification, where: str) -> list[Cell]:
    """Returns what a specification asks for, in its order: combinations, policies, sets of trials, engines, sets.

    Args:
        specification: of the sweep.
        where: name of the specification, for messages.

    Raises:
        ValueError: if a policy serves another peg or hole than that of its cell, or a cell has no hard trial.
    """
    found: list[Cell] = []
    for plan in specification.policies:
        check_imports(plan, where)
    given = {plan.name: ManipulationSkill.load(plan.skill) for plan in specification.policies if plan.skill is not None}
    for combination in specification.combinations:
        scenario = specification.scenario_with(combination.scenario, where)
        for trial_set in specification.trial_sets:
            try:
                trial_scenario(scenario, number=specification.first, trial_set=trial_set)
            except ValueError as error:
                raise ValueError(f"{where}: the {trial_set} trials in the cell {combination.label}: {error}") from error
        for plan, trial_set, engine in itertools.product(
            specification.policies, specification.trial_sets, specification.engines
        ):
            own = replace(scenario, contact=replace(scenario.contact, engine=engine))
            # Policies are tuned and practise with the wrench that is measured, whatever they receive in the trials.
            made_in = replace(own, controller=replace(own.controller, wrench="true"))
            recipes = _recipes(specification, plan, given.get(plan.name), combination, made_in, trial_set, where)
            found += [Cell(recipe, own, trial_set, combination.label, numbers) for recipe, numbers in recipes]
    return found


def _recipes(
    specification: Specification,
    plan: PolicyPlan,
    given: ManipulationSkill | None,
    combination: Combination,
    scenario: Scenario,
    trial_set: TrialSet,
    where: str,
) -> Iterator[tuple[PolicyRecipe, list[int]]]:
    """Yields the recipes of a plan, one for each set of demonstrations, and the numbers of the policies' trials."""
    numbers = list(range(specification.first, specification.first + plan.trials))
    acting: dict[str, Any] = {"scenario": scenario} | (
        {} if plan.for_all_trial_sets else {"trial_set": trial_set.value}
    )
    teaching = plan_in(plan, combination, where)
    if teaching is None:
        if given is not None and plan.skill is not None:
            acting = {"skill": hashlib.sha256(plan.skill.read_bytes()).hexdigest()[:16]}
            _require_geometry(plan, scenario, PegHoleGeometry.find(given.metadata_, "the skill"), where)
        yield PolicyRecipe(plan, given, None, scenario, trial_set, acting), numbers
        return
    changed = {} if teaching.demonstrated_in == BASE else combination.scenario
    shown = specification.scenario_with({**changed, **teaching.scenario}, where)
    _require_geometry(plan, scenario, shown.geometry, where)
    taught = replace(plan, demonstrations=teaching)
    for k, seed in enumerate(teaching.sets):
        demonstrations = DemonstrationSet(shown, teaching.good, teaching.bad, seed)
        made_from: dict[str, Any] = {"demonstrations": demonstrations.digest, "size": teaching.size}
        if plan.make is not None:
            made_from |= acting
        own = [n for n in numbers if n % len(teaching.sets) == k] if teaching.divided else numbers
        if own:
            yield PolicyRecipe(taught, None, demonstrations, scenario, trial_set, made_from), own


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
