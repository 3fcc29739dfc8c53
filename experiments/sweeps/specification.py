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
    arms: [default, stress]
    trials: {first: 1000, number: 100}
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import quote

import yaml

from experiments.demonstration_set import MAX_DEMONSTRATIONS
from experiments.sweeps.checked_mapping import CheckedMapping
from experiments.sweeps.factors import Cell, Overrides, read_cells
from experiments.sweeps.trial_engines import ENGINES
from experiments.trial import Arm
from models.clearance import numerics_of_clearance, start_of_clearance
from models.document import brief, read_document, read_text
from models.scenario import Scenario, dump_scenario, load_scenario, parse_scenario

MAX_TRIALS = 1_000_000
MAX_FOLDER_NAME = (
    200  # bytes of the percent-encoded name of a policy; file systems allow 255 with what stands before it
)
GOOD, BAD = 24, 6
"""Numbers of good and bad demonstrations of a set, if the specification gives none."""

BASE, CELL = "base", "cell"
PLACES = (BASE, CELL)
"""Where is demonstrated: in the scenario of the sweep, or in that of each cell."""


RULES: dict[str, Callable[[Scenario], Scenario]] = {
    "numerics": numerics_of_clearance,
    "start": start_of_clearance,
}
"""What of a scenario can follow its clearance."""


@dataclass(frozen=True)
class DemonstrationPlan:
    """The demonstrations that a policy learns from.

    Attributes:
        sets: seeds of the sets. The policy is made once for each.
        good, bad: numbers of demonstrations of a set.
        size: how many of them are used, the first of each outcome in the same proportion; None for all.
        divided: whether trial n is performed by the policy of set n modulo their number only, instead of by all.
        demonstrated_in: one of ``PLACES``.
        scenario: what differs from that place, such as the fixture.
        select: import path of a function that chooses from the demonstrations, or None.
    """

    sets: tuple[int, ...] = (0,)
    good: int = GOOD
    bad: int = BAD
    size: int | None = None
    divided: bool = False
    demonstrated_in: str = BASE
    scenario: Overrides = field(default_factory=dict)
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
        for_all_arms: whether ``make`` is called once for all arms, instead of for each.
    """

    name: str
    skill: Path | None
    make: str | None
    options: dict[str, Any]
    demonstrations: DemonstrationPlan | None
    carried_over: bool
    for_all_arms: bool = False


@dataclass(frozen=True)
class Specification:
    """A sweep.

    Attributes:
        title: of its pages.
        scenario: unresolved, before anything is varied.
        cells: the combinations of levels.
        policies: in the order of the file.
        arms: which trials.
        engines: names of the engines that simulate, of ``ENGINES``.
        rules: names in ``RULES`` of what follows the clearance in every scenario.
        first, number: of the trials.
        text: of the file.
    """

    title: str
    scenario: Scenario
    cells: list[Cell]
    policies: list[PolicyPlan]
    arms: tuple[Arm, ...]
    engines: tuple[str, ...]
    rules: tuple[str, ...]
    first: int
    number: int
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
    whole = CheckedMapping(read_document(text, where), where)
    scenario = load_scenario(whole.take("scenario", str, "nominal"))
    cells = read_cells(whole)
    shared = whole.section("demonstrations")
    trials = whole.section("trials")
    found = Specification(
        title=whole.take("title", str, path.stem),
        scenario=scenario,
        cells=cells,
        policies=_policies(whole.section("policies"), dict(shared.values)),
        arms=tuple(Arm(name) for name in whole.choices("arms", list(Arm), Arm.DEFAULT)),
        engines=whole.choices("engines", ENGINES, ENGINES[0]),
        rules=whole.choices("clearance_rules", RULES, "") if "clearance_rules" in whole.values else (),
        first=trials.count("first", 0, least=0, most=2**31 - 1),
        number=trials.count("number", 20, least=1, most=MAX_TRIALS),
        text=text,
    )
    trials.finish()
    whole.optional("clearance_rules", list)
    whole.finish()
    read_plan(shared, {})
    varied = sorted({key for cell in cells for key in cell.training_overrides()})
    if varied and not any(policy.demonstrations for policy in found.policies):
        raise ValueError(f"{where}: training.{varied[0]} is varied, but no policy learns from demonstrations")
    for cell in cells:
        found.scenario_with(cell.scenario_overrides(), where)
        for policy in found.policies:
            plan_in(policy, cell, where)
    return found


def _policies(section: CheckedMapping, shared: Mapping[str, Any]) -> list[PolicyPlan]:
    found = []
    for name in section.values:
        if not isinstance(name, str) or not name.strip() or not name.isprintable() or len(name) > 80:
            raise section.error(brief(name), "no name", "a printable name of at most 80 characters")
        if len(quote(name, safe="")) > MAX_FOLDER_NAME:
            limit = f"at most {MAX_FOLDER_NAME} bytes, percent-encoded: it is the name of a folder"
            raise section.error(brief(name), "too long a name", limit)
        found.append(_policy(name, section.section(name), shared))
    if not found:
        raise ValueError(f"{section.where}: policies is empty, expected at least one, such as skill: {{learn: {{}}}}")
    return found


def _policy(name: str, own: CheckedMapping, shared: Mapping[str, Any]) -> PolicyPlan:
    kinds = [kind for kind in ("learn", "skill", "make") if kind in own.values]
    if len(kinds) != 1:
        raise ValueError(f"{own.where}: {own.path} has {kinds or 'none'}, expected one of learn, skill and make")
    learn, skill, make = own.section("learn"), own.optional("skill", str), own.optional("make", str)
    options = dict(learn.values if kinds == ["learn"] else own.section("with").values if kinds == ["make"] else {})
    if not all(isinstance(name, str) and _is_json(value) for name, value in options.items()):
        raise ValueError(f"{own.where}: {own.path} has options {brief(options)}, expected names with plain values")
    if make is not None and make.count(":") != 1:
        raise own.error("make", brief(make), "an import path such as package.module:function")
    teaches = kinds == ["learn"] or (make is not None and "demonstrations" in own.values)
    given = own.section("demonstrations")
    plan = read_plan(given, shared) if teaches else None
    if not teaches and given.values:
        raise ValueError(f"{own.where}: {given.path} is given, but a skill file has learnt already")
    found = PolicyPlan(
        name=name,
        skill=None if skill is None else Path(skill),
        make=make,
        options=options,
        demonstrations=plan,
        carried_over=own.take("carried_over", bool, False),
        for_all_arms=make is not None and own.take("for_all_arms", bool, False),
    )
    own.finish()
    return found


def read_plan(own: CheckedMapping, shared: Mapping[str, Any]) -> DemonstrationPlan:
    """Reads the section ``demonstrations`` of a policy; keys that are missing are those of the whole sweep.

    Raises:
        ValueError: naming the key and what is wrong.
    """
    section = CheckedMapping({**shared, **own.values}, own.where, own.path)
    good = section.count("good", GOOD, least=1, most=MAX_DEMONSTRATIONS)
    bad = section.count("bad", BAD, least=0, most=MAX_DEMONSTRATIONS - good)
    place = section.take("demonstrated_in", str, BASE)
    if place not in PLACES:
        raise section.error("demonstrated_in", brief(place), f"one of {list(PLACES)}")
    plan = DemonstrationPlan(
        sets=section.numbers("sets", (0,)),
        good=good,
        bad=bad,
        size=section.count("size", good + bad, least=1, most=good + bad) if "size" in section.values else None,
        divided=section.take("divided", bool, False),
        demonstrated_in=place,
        scenario=dict(section.section("scenario").values),
        select=section.optional("select", str),
    )
    if plan.select is not None and plan.select.count(":") != 1:
        raise section.error("select", brief(plan.select), "an import path such as package.module:function")
    if not all(isinstance(key, str) for key in plan.scenario):
        raise section.error("scenario", brief(plan.scenario), "dotted keys with values")
    section.optional("size", int)
    section.finish()
    return plan


def _is_json(value: Any) -> bool:
    """Whether a value can be written as JSON: dates cannot."""
    try:
        json.dumps(value)
    except TypeError:
        return False
    return True


def plan_in(policy: PolicyPlan, cell: Cell, where: str) -> DemonstrationPlan | None:
    """Returns the demonstrations of a policy in a cell, with the ``training.`` keys of the cell.

    Raises:
        ValueError: if a key is unknown, or a value is not allowed.
    """
    plan, overrides = policy.demonstrations, cell.training_overrides()
    if plan is None or not overrides:
        return plan
    given = {name: value for name, value in vars(plan).items() if value is not None}
    given |= {"sets": list(plan.sets)}
    return read_plan(CheckedMapping({**given, **overrides}, where, "training"), {})


def overridden(scenario: Scenario, overrides: Overrides, where: str) -> Scenario:
    """Returns a copy of a scenario with other values at some dotted keys.

    Raises:
        ValueError: naming ``where`` and the key that is unknown, or the value that is not allowed.
    """
    document = yaml.safe_load(dump_scenario(scenario))
    for key, value in overrides.items():
        node, names = document, key.split(".")
        for name in names[:-1]:
            node = node.get(name) if isinstance(node, dict) else None
        if not isinstance(node, dict) or names[-1] not in node:
            raise ValueError(f"{where}: unknown key {brief(key)} of the scenario")
        node[names[-1]] = value
    return parse_scenario(yaml.safe_dump(document), where)
