"""The cells of a sweep: the trials of a policy in a combination of levels, and what identifies them."""

from dataclasses import replace

import pytest

from experiments.sweep import cells
from experiments.sweep.cells import Cell, cells_of
from experiments.sweep.specification import read_specification
from experiments.trial.trial_set import TrialSet
from models.scenario import load_scenario
from skill.manipulation_skill import ManipulationSkill

SWEEP = """
vary: {controller.wrench: ["true", zero, "scaled:0.5"]}
policies:
  push: {make: "benchmarks.rig.policies:straight_push"}
  compliance: {make: "benchmarks.rig.policies:tuned_compliance"}
  skill: {learn: {}}
demonstrations: {sets: [0]}
trials: {first: 96000, number: 2}
"""


def read(tmp_path, text):
    path = tmp_path / "sweep.yaml"
    path.write_text(text)
    return cells_of(read_specification(path), "sweep")


def test_a_policy_is_made_once_with_the_measured_wrench_whatever_it_receives(tmp_path):
    found = read(tmp_path, SWEEP)
    assert [cell.scenario.controller.wrench for cell in found] == ["true"] * 3 + ["zero"] * 3 + ["scaled:0.5"] * 3
    assert {cell.recipe.scenario.controller.wrench for cell in found} == {"true"}
    assert len({cell.recipe.digest for cell in found}) == 3
    assert len({cell.digest for cell in found}) == 9


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ("true", "controller.wrench is True, expected a name in quotes"),
        ('"half"', "controller.wrench is 'half', expected one of"),
    ],
)
def test_a_value_that_yaml_takes_for_another_is_named(tmp_path, value, message):
    with pytest.raises(ValueError, match=message):
        read(tmp_path, SWEEP.replace('"true"', value))


def test_sets_of_demonstrations_have_a_policy_each_and_may_divide_the_trials(tmp_path):
    text = "policies: {skill: {learn: {}}}\ntrials: {number: 5}\ndemonstrations: {sets: [3, 4]"
    every, divided = (read(tmp_path, f"{text}{rest}}}\n") for rest in ("", ", divided: true"))
    assert [cell.recipe.demonstrations.seed for cell in every] == [3, 4]
    assert [cell.numbers for cell in every] == [[0, 1, 2, 3, 4]] * 2
    assert [cell.numbers for cell in divided] == [[0, 2, 4], [1, 3]]
    assert len({cell.recipe.digest for cell in every}) == 2


def test_a_skill_of_a_file_is_read_once_and_refused_for_another_peg(tmp_path, skill_file, scenario_file):
    text = f"scenario: {scenario_file}\npolicies: {{mine: {{skill: {skill_file}}}}}\n"
    text += "vary: {contact.friction: [0.1, 0.3]}\n"
    one, other = read(tmp_path, text)
    assert one.recipe.given is other.recipe.given
    assert isinstance(one.recipe.given, ManipulationSkill)
    with pytest.raises(ValueError, match=r"policies\.mine learns for .* set carried_over: true"):
        read(tmp_path, text.replace("contact.friction: [0.1, 0.3]", "geometry.hole_radius: [0.0101]"))


def in_engine(engine):
    scenario = load_scenario()
    scenario.contact.engine = engine
    return scenario


@pytest.fixture
def cell(tmp_path) -> Cell:
    return read(tmp_path, "policies: {push: {make: 'tests.experiments.sweep.pushes:push'}}\ntrials: {number: 1}\n")[0]


@pytest.mark.parametrize(
    "changes",
    [
        {"scenario": load_scenario("tight")},
        {"trial_set": TrialSet.HARD},
        {"scenario": in_engine("drake")},
        {"factors": '{"a": 1}'},
    ],
)
def test_all_that_decides_a_trial_changes_its_key(cell, changes):
    assert replace(cell).digest == cell.digest
    assert replace(cell, **changes).digest != cell.digest


def test_policy_code_and_versions_change_the_key_too(cell, monkeypatch):
    assert replace(cell, recipe=replace(cell.recipe, made_from={"skill": "q" * 16})).digest != cell.digest
    named = replace(cell.recipe, plan=replace(cell.recipe.plan, name="shove"))
    assert replace(cell, recipe=named).digest != cell.digest
    with monkeypatch.context() as patched:
        patched.setattr(cells, "code_digest", lambda: "another revision")
        assert replace(cell).digest != cell.digest
    monkeypatch.setattr(cells, "versions", lambda: {"drake": "0"})
    assert replace(cell).digest != cell.digest
