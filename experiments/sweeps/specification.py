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
import json
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, is_dataclass
from pathlib import Path
from typing import Any
from urllib.parse import quote

from experiments.demonstration_set import MAX_DEMONSTRATIONS
from experiments.sweeps.factors import Cell, Overrides, make_cells
from experiments.trial.trial_set import TrialSet
from models.clearance import numerics_of_clearance, start_of_clearance
from models.document import brief, read_document, read_text
from models.scenario import ENGINES, Scenario, load_scenario, validate_scenario
from models.validation import Violation, check_document, copied, raise_first, set_field

MAX_TRIALS = 1_000_000
MAX_CURVES = 20_000  # combinations of all that is varied; planning takes a millisecond for each
MAX_NAME = 80  # characters of the name of a policy
MAX_FOLDER_NAME = 200  # bytes of it, percent-encoded; file systems allow 255 with what stands before it

BASE, CELL = PLACES = ("base", "cell")
"""Where is demonstrated: in the scenario of the sweep, or in that of each cell."""

RULES: dict[str, Callable[[Scenario], Scenario]] = {
    "numerics": numerics_of_clearance,
    "start": start_of_clearance,
}
"""What of a scenario can follow its clearance."""


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
        cells: the combinations of levels.
        policies: in the order of the file.
        trial_sets: which trials.
        engines: of `models.scenario.ENGINES`, in each of which the trials are performed.
        rules: names in ``RULES`` of what follows the clearance in every scenario.
        first: number of the first trial.
        text: of the file.
    """

    title: str
    scenario: Scenario
    cells: list[Cell]
    policies: list[PolicyPlan]
    trial_sets: list[TrialSet]
    engines: list[str]
    rules: list[str]
    first: int
    text: str
    _known: dict[str, Scenario] = field(default_factory=dict, init=False, repr=False, compare=False)

    def scenario_with(self, overrides: Overrides, where: str) -> Scenario:
        """Returns the scenario with some overrides, to which the rules are applied.

        Args:
            overrides: values by their dotted keys.
            where: name of the file, for messages.

        Raises:
            ValueError: naming the key that is unknown, or the value that is not allowed.
        """
        key = json.dumps(overrides, sort_keys=True)
        if key not in self._known:
            chosen = overridden(self.scenario, overrides, where)
            for rule in self.rules:
                chosen = RULES[rule](chosen)
            self._known[key] = chosen
        return self._known[key]


@dataclass(frozen=True)
class TrialNumbers:
    """The section ``trials`` of the file."""

    first: int = 0
    number: int = 20


@dataclass(frozen=True)
class PolicySection:
    """A section of ``policies`` of the file, without its ``with``, which are the options of ``make``."""

    learn: dict[str, Any] | None = None
    skill: str | None = None
    make: str | None = None
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
    scenario = load_scenario(document.scenario)
    specification = Specification(
        title=document.title or path.stem,
        scenario=scenario,
        cells=make_cells(document.vary, document.design, where),
        policies=[_policy(name, own, document, where) for name, own in document.policies.items()],
        trial_sets=[TrialSet(name) for name in document.trial_sets],
        engines=document.engines,
        rules=document.clearance_rules,
        first=document.trials.first,
        text=text,
    )
    _check_cells(specification, where)
    return specification


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
        elif len(quote(name, safe="")) > MAX_FOLDER_NAME:
            limit = f"at most {MAX_FOLDER_NAME} bytes, percent-encoded: it is the name of a folder"
            yield Violation(f"policies.{brief(name)}", "too long a name", limit)


def _policy(name: str, given: Any, document: Document, where: str) -> PolicyPlan:
    """Reads a section of ``policies`` of a document."""
    path = f"policies.{name}"
    options = given.get("with") if isinstance(given, dict) and given.get("make") is not None else None
    checked = {key: value for key, value in given.items() if key != "with"} if options is not None else given
    check_document(checked, PolicySection, where, path)
    own = PolicySection(**checked)
    options = own.learn if own.make is None else options
    teaches = own.learn is not None or (own.make is not None and own.demonstrations is not None)
    raise_first(_policy_violations(own, options, document.trials.number, path), where)
    taught = {**document.demonstrations, **(own.demonstrations or {})}
    plan = read_plan(taught, where, f"{path}.demonstrations") if teaches else None
    return PolicyPlan(
        name=name,
        skill=None if own.skill is None else Path(own.skill),
        make=own.make,
        options=options or {},
        demonstrations=plan,
        carried_over=own.carried_over,
        for_all_trial_sets=own.for_all_trial_sets,
        trials=own.trials or document.trials.number,
    )


def _policy_violations(own: PolicySection, options: Any, trials: int, path: str) -> Iterator[Violation]:
    kinds = [kind for kind in ("learn", "skill", "make") if getattr(own, kind) is not None]
    if len(kinds) != 1:
        yield Violation(path, f"made in {len(kinds)} ways {kinds}", "one of learn, skill and make")
    if options is not None and not (isinstance(options, dict) and all(map(_is_plain, options.items()))):
        yield Violation(f"{path}.{'learn' if own.make is None else 'with'}", brief(options), "names with plain values")
    yield from _no_import_path(f"{path}.make", own.make)
    if own.skill is not None and own.demonstrations:
        yield Violation(f"{path}.demonstrations", "given", "none: a skill file has learnt already")
    yield from _outside(f"{path}.trials", own.trials, 1, trials)
    if own.for_all_trial_sets and own.make is None:
        yield Violation(f"{path}.for_all_trial_sets", "true", "false: no function could be told the set")


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
    if not all(isinstance(key, str) for key in plan.scenario):
        yield Violation(f"{path}.scenario", brief(plan.scenario), "dotted keys with values")
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


def _is_plain(option: tuple[Any, Any]) -> bool:
    """Whether a name and a value can be written as JSON: dates cannot."""
    try:
        json.dumps(option[1])
    except TypeError:
        return False
    return isinstance(option[0], str)


def _check_cells(specification: Specification, where: str) -> None:
    """Checks that every cell has a scenario, and every policy its demonstrations there."""
    varied = sorted({key for cell in specification.cells for key in cell.training_overrides()})
    if varied and not any(policy.demonstrations for policy in specification.policies):
        raise ValueError(f"{where}: training.{varied[0]} is varied, but no policy learns from demonstrations")
    trials = curves = 0
    for cell in specification.cells:
        specification.scenario_with(cell.scenario_overrides(), where)
        for policy in specification.policies:
            plan = plan_in(policy, cell, where)
            sets = len(plan.sets) if plan else 1
            own = len(specification.trial_sets) * len(specification.engines)
            curves += own * sets
            trials += own * policy.trials * (1 if plan and plan.divided else sets)
            for found, most, what in ((trials, MAX_TRIALS, "trials"), (curves, MAX_CURVES, "sets of trials")):
                if found > most:
                    product = "cells, policies, demonstrations, sets of trials and engines"
                    raise ValueError(f"{where}: {product} make more than {most:,} {what}; use fewer of one")


def plan_in(policy: PolicyPlan, cell: Cell, where: str) -> DemonstrationPlan | None:
    """Returns the demonstrations of a policy in a cell, with the ``training.`` keys of the cell.

    Raises:
        ValueError: if a key is unknown, or a value is not allowed.
    """
    plan, overrides = policy.demonstrations, cell.training_overrides()
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
        *groups, name = key.split(".")
        node: Any = chosen
        for group in groups:
            node = getattr(node, group, None)
        if not (is_dataclass(node) and hasattr(node, name)):
            raise ValueError(f"{where}: unknown key {brief(key)} of the scenario")
        if is_dataclass(getattr(node, name)):
            raise ValueError(f"{where}: {brief(key)} is a group of keys of the scenario, expected one of its keys")
        set_field(node, name, value, where, ".".join(groups))
    validate_scenario(chosen, where)
    return chosen
