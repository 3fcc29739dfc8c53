"""The specification of a sweep: which trials of which policies, from a YAML file.

For example:

    title: friction and sensor noise
    scenario: nominal
    vary:
      contact.friction: [0.1, 0.2, 0.3]
      sensor.force_noise: [0.05, 0.5]
    demonstrations: {sets: [1, 2], good: 24, bad: 6}
    policies:
      skill: {learn: {}}
      push: {make: "benchmarks.rig.policies:straight_push"}
    trial_sets: [usual, hard]
    trials: {first: 1000, number: 100}
"""

# Without the future import of annotations: `check_document` reads the types of the fields.
import itertools
import json
import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from experiments.demonstration_set import MAX_DEMONSTRATIONS
from experiments.trial.trial_set import TrialSet
from models.clearance import numerics_of_clearance, start_of_clearance
from models.document import brief, read_document, read_text
from models.scenario import ENGINES, Scenario, load_scenario, validate_scenario
from models.validation import Violation, check_document, copied, fill, raise_first

MAX_TRIALS = 1_000_000
MAX_NAME = 80  # characters of the name of a policy, which names a folder
MAX_COMBINATIONS = 1_000

TRAINING = "training."
"""Begins the keys that change how a policy is made; the others are keys of the scenario."""

UNIFORM, LOG_UNIFORM = RANGES = ("uniform", "log_uniform")
"""How numbers are drawn from a range."""

Overrides = dict[str, Any]
"""Values by their dotted keys, such as ``contact.friction``."""

Level = tuple[Any, Overrides]
"""A value of a factor, as the results have it, and what it changes."""

BASE, CELL = PLACES = ("base", "cell")
"""Where is demonstrated: in the scenario of the sweep, or in that of each cell, where a policy acts."""

RULES: dict[str, Callable[[Scenario], Scenario]] = {
    "numerics": numerics_of_clearance,
    "start": start_of_clearance,
}
"""What of a scenario can follow its clearance."""


@dataclass(frozen=True)
class Combination:
    """One combination of levels.

    Attributes:
        factors: value of each factor.
        scenario: what the levels change in the scenario.
        training: what they change in the making of policies, without the prefix of the keys.
    """

    factors: dict[str, Any]
    scenario: Overrides
    training: Overrides

    @classmethod
    def of(cls, levels: dict[str, Level]) -> "Combination":
        """Returns the combination of a level of each factor."""
        changed = {key: value for _, overrides in levels.values() for key, value in overrides.items()}
        return cls(
            factors={name: value for name, (value, _) in levels.items()},
            scenario={key: value for key, value in changed.items() if not key.startswith(TRAINING)},
            training={key[len(TRAINING) :]: value for key, value in changed.items() if key.startswith(TRAINING)},
        )

    @property
    def label(self) -> str:
        """The factors as JSON, the same text for the same factors."""
        return json.dumps(self.factors, sort_keys=True, default=str)


@dataclass(frozen=True)
class DemonstrationPlan:
    """The demonstrations that a policy learns from: the section ``demonstrations`` of the file.

    Attributes:
        sets: seeds of the sets. The policy is made once for each.
        good, bad: numbers of demonstrations of a set.
        size: how many of them are used, the first of each outcome in the same proportion; None for all.
        divided: whether trial n is performed by the policy of set n modulo their number only, instead of by all.
        demonstrated_in: one of ``PLACES``.
        scenario: what differs from that place, such as the fixture.
        select: import path of a function that chooses from the demonstrations, or None.
    """

    sets: list[int] = field(default_factory=lambda: [0])
    good: int = 24
    bad: int = 6
    size: int | None = None
    divided: bool = False
    demonstrated_in: str = BASE
    scenario: dict[str, Any] = field(default_factory=dict)
    select: str | None = None


@dataclass(frozen=True)
class PolicyPlan:
    """A policy of a sweep.

    Attributes:
        name: of its rows.
        skill: file of a trained skill, or None.
        make: import path of a function that makes the policy, or None; see `TrainingContext`.
        options: keyword arguments of that function, or what a learnt skill replaces.
        demonstrations: what it learns from; None for a policy that learns nothing.
        carried_over: whether it serves other pegs and holes than its own.
        for_all_trial_sets: whether ``make`` is called once for all sets of trials, instead of for each.
        trials: how many it performs, the first ones of the sweep.
    """

    name: str
    skill: Path | None
    make: str | None
    options: dict[str, Any]
    demonstrations: DemonstrationPlan | None
    carried_over: bool
    for_all_trial_sets: bool = False
    trials: int = 20

    @property
    def imitates(self) -> bool:
        """Whether it is a skill of this project's own parts, as far as the plan says."""
        return self.make is None and not {"skill", "regressor"} & set(self.options)


@dataclass(frozen=True)
class Specification:
    """A sweep.

    Attributes:
        title: of its pages.
        scenario: unresolved, before anything is varied.
        combinations: of the levels.
        policies: in the order of the file.
        trial_sets: which trials.
        engines: of `models.scenario.ENGINES`, in each of which the trials are performed.
        rules: names in ``RULES`` of what follows the clearance in every scenario.
        first: number of the first trial.
        text: of the file.
    """

    title: str
    scenario: Scenario
    combinations: list[Combination]
    policies: list[PolicyPlan]
    trial_sets: list[TrialSet]
    engines: list[str]
    rules: list[str]
    first: int
    text: str

    def scenario_with(self, overrides: Overrides, where: str) -> Scenario:
        """Returns the scenario with some overrides, to which the rules are applied.

        Args:
            overrides: values by their dotted keys.
            where: name of the file, for messages.

        Raises:
            ValueError: naming the key that is unknown, or the value that is not allowed.
        """
        chosen = overridden(self.scenario, overrides, where)
        for rule in self.rules:
            chosen = RULES[rule](chosen)
        return chosen


@dataclass(frozen=True)
class TrialNumbers:
    """The section ``trials`` of the file."""

    first: int = 0
    number: int = 20


@dataclass(frozen=True)
class PolicySection:
    """A section of ``policies`` of the file; its ``options`` are those of ``make``."""

    learn: dict[str, Any] | None = None
    skill: str | None = None
    make: str | None = None
    options: dict[str, Any] = field(default_factory=dict)
    demonstrations: dict[str, Any] | None = None
    carried_over: bool = False
    for_all_trial_sets: bool = False
    trials: int | None = None


@dataclass(frozen=True)
class Document:
    """The keys of the file."""

    title: str = ""
    scenario: str = "nominal"
    vary: dict[str, Any] = field(default_factory=dict)
    design: str | dict[str, Any] = "grid"
    demonstrations: dict[str, Any] = field(default_factory=dict)
    policies: dict[str, Any] = field(default_factory=dict)
    trial_sets: list[str] = field(default_factory=lambda: [TrialSet.USUAL.value])
    engines: list[str] = field(default_factory=lambda: ["exact"])
    clearance_rules: list[str] = field(default_factory=list)
    trials: TrialNumbers = field(default_factory=TrialNumbers)


def read_specification(path: Path) -> Specification:
    """Reads and checks the specification of a sweep.

    Raises:
        ValueError: naming the file, the key, what was found and what was expected.
        OSError: if the file cannot be read.
    """
    where = f"sweep {path}"
    if not path.is_file():
        raise ValueError(f"{where}: no such file; expected a YAML file")
    text = read_text(path, where)
    found = read_document(text, where)
    check_document(found, Document, where)
    document = Document(**{**found, "trials": TrialNumbers(**found.get("trials", {}))})
    raise_first(_document_violations(document), where)
    read_plan(document.demonstrations, where, "demonstrations")
    return Specification(
        title=document.title or path.stem,
        scenario=load_scenario(document.scenario),
        combinations=make_combinations(document.vary, document.design, where),
        policies=[_policy(name, own, document, where) for name, own in document.policies.items()],
        trial_sets=[TrialSet(name) for name in document.trial_sets],
        engines=document.engines,
        rules=document.clearance_rules,
        first=document.trials.first,
        text=text,
    )


def _document_violations(document: Document) -> Iterator[Violation]:
    """Checks the values of the keys of a file."""
    for name, chosen, known in (
        ("trial_sets", document.trial_sets, [trial_set.value for trial_set in TrialSet]),
        ("engines", document.engines, list(ENGINES)),
        ("clearance_rules", document.clearance_rules, list(RULES)),
    ):
        if not set(chosen) <= set(known) or (not chosen and name != "clearance_rules"):
            yield Violation(name, brief(chosen), f"a list of some of {known}")
        yield from _repetitions(name, chosen)
    yield from _outside("trials.first", document.trials.first, 0, 2**31 - 1)
    yield from _outside("trials.number", document.trials.number, 1, MAX_TRIALS)
    if not document.policies:
        yield Violation("policies", "empty", "at least one, such as skill: {learn: {}}")
    for name in document.policies:
        if not isinstance(name, str) or not name.strip() or not name.isprintable() or len(name) > MAX_NAME:
            yield Violation(f"policies.{brief(name)}", "no name", f"a printable one of at most {MAX_NAME} characters")


def _policy(name: str, given: Any, document: Document, where: str) -> PolicyPlan:
    """Reads a section of ``policies`` of a document."""
    path = f"policies.{name}"
    check_document(given, PolicySection, where, path)
    own = PolicySection(**given)
    raise_first(_policy_violations(own, document.trials.number, path), where)
    teaches = own.learn is not None or (own.make is not None and own.demonstrations is not None)
    taught = {**document.demonstrations, **(own.demonstrations or {})}
    return PolicyPlan(
        name=name,
        skill=None if own.skill is None else Path(own.skill),
        make=own.make,
        options=own.learn or own.options,
        demonstrations=read_plan(taught, where, f"{path}.demonstrations") if teaches else None,
        carried_over=own.carried_over,
        for_all_trial_sets=own.for_all_trial_sets,
        trials=own.trials or document.trials.number,
    )


def _policy_violations(own: PolicySection, trials: int, path: str) -> Iterator[Violation]:
    ways = [way for way in ("learn", "skill", "make") if getattr(own, way) is not None]
    if len(ways) != 1:
        yield Violation(path, f"made in {len(ways)} ways {ways}", "one of learn, skill and make")
    yield from _no_import_path(f"{path}.make", own.make)
    if own.make is None and own.options:
        yield Violation(f"{path}.options", "given", "none: there is no function to make the policy")
    if own.make is None and own.for_all_trial_sets:
        yield Violation(f"{path}.for_all_trial_sets", "true", "false: no function could be told the set")
    if own.skill is not None and own.demonstrations:
        yield Violation(f"{path}.demonstrations", "given", "none: a skill file has learnt already")
    yield from _outside(f"{path}.trials", own.trials, 1, trials)


def read_plan(values: dict[str, Any], where: str, path: str) -> DemonstrationPlan:
    """Reads a section ``demonstrations``; ``path`` is its name in the file.

    Raises:
        ValueError: naming the key and what is wrong.
    """
    check_document(values, DemonstrationPlan, where, path)
    plan = DemonstrationPlan(**values)
    raise_first(_plan_violations(plan, path), where)
    return plan


def _plan_violations(plan: DemonstrationPlan, path: str) -> Iterator[Violation]:
    if not plan.sets or min(plan.sets) < 0:
        yield Violation(f"{path}.sets", brief(plan.sets), "a list of whole numbers of at least 0")
    yield from _repetitions(f"{path}.sets", plan.sets)
    yield from _outside(f"{path}.good", plan.good, 1, MAX_DEMONSTRATIONS)
    yield from _outside(f"{path}.bad", plan.bad, 0, MAX_DEMONSTRATIONS - plan.good)
    yield from _outside(f"{path}.size", plan.size, 1, plan.good + plan.bad)
    if plan.demonstrated_in not in PLACES:
        yield Violation(f"{path}.demonstrated_in", brief(plan.demonstrated_in), f"one of {list(PLACES)}")
    yield from _no_import_path(f"{path}.select", plan.select)


def _outside(name: str, number: int | None, least: int, most: int) -> Iterator[Violation]:
    if number is not None and not least <= number <= most:
        yield Violation(name, number, f"{least} to {most}")


def _repetitions(name: str, values: Iterable[Any]) -> Iterator[Violation]:
    values = list(values)
    if len(set(values)) < len(values):
        yield Violation(name, brief(values), "each one once")


def _no_import_path(name: str, value: str | None) -> Iterator[Violation]:
    if value is not None and value.count(":") != 1:
        yield Violation(name, brief(value), "an import path such as package.module:function")


def plan_in(policy: PolicyPlan, combination: Combination, where: str) -> DemonstrationPlan | None:
    """Returns the demonstrations of a policy, with the ``training.`` keys of a combination.

    Raises:
        ValueError: if a key is unknown, or a value is not allowed.
    """
    plan, overrides = policy.demonstrations, combination.training
    if plan is None or not overrides:
        return plan
    return read_plan({**vars(plan), **overrides}, where, "training")


def overridden(scenario: Scenario, overrides: Overrides, where: str) -> Scenario:
    """Returns a copy of a scenario with other values at some dotted keys.

    Raises:
        ValueError: naming ``where`` and the key that is unknown, or the value that is not allowed.
    """
    chosen: Scenario = copied(scenario)
    for key, value in overrides.items():
        document: Any = value
        for name in reversed(str(key).split(".")):
            document = {name: document}
        check_document(document, Scenario, where)
        fill(chosen, document)
    validate_scenario(chosen, where)
    return chosen


def make_combinations(vary: dict[str, Any], design: str | dict[str, Any], where: str) -> list[Combination]:
    """Returns the combinations of a design.

    A key of the scenario, or ``training.`` and a key of ``demonstrations``, takes a list of values, or ``{uniform: [a,
    b]}`` or ``{log_uniform: [a, b]}``. Any other name takes named levels, each with the keys that it sets together:
    ``{wide: {geometry.hole_radius: 0.0114, start.tilt_range: 0.1}}``.

    The random design is a scrambled Sobol sequence: a larger number of samples begins with the same ones. Combinations
    of listed levels that are drawn again count once.

    Args:
        vary: the factors by their names.
        design: ``grid``, or ``{random: N, seed: S}``.
        where: name of the file, for messages.

    Raises:
        ValueError: naming the key and what is wrong.
    """
    raise_first(_factor_violations(vary), where)
    raise_first(_design_violations(vary, design), where)
    found: Iterable[Iterable[Level]]
    if isinstance(design, dict):
        from scipy.stats import qmc  # slow to import, and most designs are grids

        samples = design["random"]
        # A power of two keeps the sequence balanced; the first samples of it are used.
        shares = qmc.Sobol(len(vary), seed=design.get("seed", 0)).random_base2(math.ceil(math.log2(samples)))[:samples]
        found = (
            [_level_at(*factor, float(share)) for factor, share in zip(vary.items(), row, strict=True)]
            for row in shares
        )
    else:
        found = itertools.product(*(_levels(name, values) for name, values in vary.items()))
    combinations = [Combination.of(dict(zip(vary, levels, strict=True))) for levels in found]
    return list({combination.label: combination for combination in combinations}.values())


def _levels(name: str, values: Any) -> list[Level]:
    """The levels of a factor; none of a range."""
    if isinstance(values, list):
        return [(value, {name: value}) for value in values]
    return [] if _is_range(values) else list(values.items())


def _is_range(values: Any) -> bool:
    return isinstance(values, dict) and len(values) == 1 and next(iter(values)) in RANGES


def _level_at(name: str, values: Any, share: float) -> Level:
    """The level at a share in [0, 1) of the list or range of a factor."""
    if not _is_range(values):
        levels = _levels(name, values)
        return levels[int(share * len(levels))]
    ((kind, limits),) = values.items()
    low, high = map(float, limits)
    value = low * (high / low) ** share if kind == LOG_UNIFORM else low + (high - low) * share
    return value, {name: value}


def _factor_violations(vary: dict[str, Any]) -> Iterator[Violation]:
    """Checks the factors: lists of values, ranges, or named levels."""
    known: dict[str, str] = {}
    for name, values in vary.items():
        path = f"vary.{name}"
        match values:
            case [_, *_]:
                if any(values.count(value) > 1 for value in values):
                    yield Violation(path, brief(values), "each value once")
            case {"uniform": limits} | {"log_uniform": limits} if len(values) == 1:
                numbers = [limit for limit in limits if type(limit) in (int, float)] if isinstance(limits, list) else []
                if not (
                    len(numbers) == len(limits) == 2 and all(map(math.isfinite, numbers)) and numbers[0] < numbers[1]
                ):
                    yield Violation(path, brief(limits), "two numbers, the smaller first")
                elif LOG_UNIFORM in values and numbers[0] <= 0:
                    yield Violation(path, brief(limits), "two numbers above 0")
            case {} if values and all(isinstance(overrides, dict) and overrides for overrides in values.values()):
                pass
            case _:
                levels = "levels with the keys that they set"
                expected = f"a list of values, one of {list(RANGES)} with its limits, or {levels}"
                yield Violation(path, brief(values), expected)
        for key in {key for _, overrides in _levels(name, values) for key in overrides} or {name}:
            if known.setdefault(key, name) != name:
                yield Violation("vary", f"{key} in two factors, the second {name}", "each key once")


def _design_violations(vary: dict[str, Any], design: Any) -> Iterator[Violation]:
    if isinstance(design, dict):
        for name, least, most in (("random", 1, MAX_COMBINATIONS), ("seed", 0, 2**32 - 1)):
            number: Any = {"seed": 0, **design}.get(name)
            if type(number) is not int or not least <= number <= most:
                yield Violation(f"design.{name}", brief(number), f"{least} to {most}")
        if not set(design) <= {"random", "seed"}:
            yield Violation("design", brief(design), "the keys random and seed only")
        if not vary:
            yield Violation("design", "random", "grid, because nothing is varied")
    elif design != "grid":
        yield Violation("design", brief(design), "grid, or {random: N, seed: S}")
    else:
        for name in (name for name, values in vary.items() if _is_range(values)):
            yield Violation(f"vary.{name}", "a range", "a list of values in a grid")
        if math.prod(len(_levels(name, values)) for name, values in vary.items()) > MAX_COMBINATIONS:
            yield Violation("vary", f"a grid of more than {MAX_COMBINATIONS:,} combinations", "fewer")
