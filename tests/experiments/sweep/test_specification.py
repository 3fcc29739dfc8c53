"""Specifications of sweeps: what they ask for, and the messages about what is wrong in them."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from experiments.sweep.cells import cells_of
from experiments.sweep.specification import (
    DemonstrationPlan,
    make_combinations,
    overridden,
    plan_in,
    read_specification,
)
from experiments.trial.trial_set import TrialSet
from models.clearance import numerics_of_clearance, start_of_clearance
from models.scenario import load_scenario

PLAIN = "policies: {skill: {learn: {}}}\n"


def cells(vary, design="grid"):
    return make_combinations(vary, design, "sweep")


def read(tmp_path, text):
    path = tmp_path / "sweep.yaml"
    path.write_text(text)
    return read_specification(path)


def test_a_grid_has_every_combination_in_the_order_of_the_file():
    found = cells({"contact.friction": [0.1, 0.3], "start.height": [0.002, 0.004, 0.006]})
    assert [tuple(cell.factors.values()) for cell in found] == [
        *((0.1, 0.002), (0.1, 0.004), (0.1, 0.006)),
        *((0.3, 0.002), (0.3, 0.004), (0.3, 0.006)),
    ]
    assert found[1].scenario == {"contact.friction": 0.1, "start.height": 0.004}


def test_a_named_level_sets_several_keys_together():
    wide = {"geometry.hole_radius": 0.0114, "training.good": 8}
    (cell,) = cells({"hole": {"wide": wide}})
    assert cell.factors == {"hole": "wide"}
    assert cell.scenario == {"geometry.hole_radius": 0.0114}
    assert cell.training == {"good": 8}
    assert json.loads(cell.label) == {"hole": "wide"}


@given(first=st.integers(1, 40), more=st.integers(0, 60), seed=st.integers(0, 2**32 - 1))
def test_a_larger_random_design_begins_with_the_same_cells(first, more, seed):
    vary = {"contact.friction": {"uniform": [0.1, 0.3]}, "rig.mount_stiffness": {"log_uniform": [1e3, 1e5]}}
    small, large = (cells(vary, {"random": n, "seed": seed}) for n in (first, first + more))
    assert large[:first] == small
    assert len(large) == first + more
    for cell in large:
        assert 0.1 <= cell.factors["contact.friction"] <= 0.3
        assert 1e3 <= cell.factors["rig.mount_stiffness"] <= 1e5


def test_a_random_design_fills_ranges_evenly_and_a_logarithmic_one_in_its_logarithm():
    vary = {"a": {"uniform": [0.0, 1.0]}, "b": {"log_uniform": [1.0, 100.0]}, "c": [1, 2, 3, 4]}
    found = [cell.factors for cell in cells(vary, {"random": 256})]
    for name, quarter in (("a", 0.25), ("b", 100.0**0.25)):
        assert sum(factors[name] < quarter for factors in found) == 64
    assert np.bincount([factors["c"] for factors in found])[1:].tolist() == [64] * 4


def test_combinations_of_listed_levels_that_are_drawn_again_count_once():
    found = cells({"a": [1, 2, 3], "b": [1, 2]}, {"random": 64})
    assert len(found) == 6
    assert len({cell.label for cell in found}) == 6


@pytest.mark.parametrize(
    ("vary", "design", "message"),
    [
        ({"a": []}, "grid", "vary.a is [], expected a list of values"),
        ({"a": [1, 1]}, "grid", "vary.a is [1, 1], expected each value once"),
        ({"a": {"uniform": [0, 1]}}, "grid", "vary.a is a range, expected a list of values in a grid"),
        (
            {"a": {"uniform": [1, 0]}},
            {"random": 3},
            "vary.a is [1, 0], expected two numbers, the small",
        ),
        ({"a": {"log_uniform": [0, 1]}}, {"random": 3}, "vary.a is [0, 1], expected two numbers above 0"),
        (
            {"a": {"uniform": [0, 1], "of": 2}},
            {"random": 3},
            "expected a list of values, one of ['uniform', 'log_uniform'] with its limits",
        ),
        ({"a": {"x": 3}}, "grid", "vary.a is {'x': 3}, expected a list of values, one of"),
        (
            {"a": {"x": {"k": 1}}, "b": {"y": {"k": 2}}},
            "grid",
            "k in two factors, the second b, expected each key",
        ),
        ({"a": [1]}, "random", "design is 'random', expected grid, or {random: N, seed: S}"),
        ({"a": [1]}, {"random": 0}, "design.random is 0, expected 1 to 1000"),
        ({}, {"random": 4}, "design is random, expected grid, because nothing is varied"),
        (
            {"a": list(range(400)), "b": list(range(400))},
            "grid",
            "a grid of more than 1,000 combinations",
        ),
    ],
)
def test_a_design_that_makes_no_sense_is_refused(vary, design, message):
    with pytest.raises(ValueError, match=r"^sweep: ") as error:
        cells(vary, design)
    assert message in str(error.value)


def test_the_defaults_are_one_set_of_thirty_and_twenty_default_trials_in_drake(tmp_path):
    found = read(tmp_path, PLAIN)
    (policy,) = found.policies
    assert (found.title, found.trial_sets, found.engines) == ("sweep", [TrialSet.USUAL], ["exact"])
    assert (found.first, found.policies[0].trials) == (0, 20)
    plan = policy.demonstrations
    assert plan == DemonstrationPlan([0], good=24, bad=6)


def test_a_policy_takes_the_demonstrations_of_the_sweep_and_its_own_keys(tmp_path):
    text = """
demonstrations: {sets: [3, 4], good: 12, bad: 3, divided: true}
policies:
  all: {learn: {}}
  few: {learn: {}, demonstrations: {size: 5}}
  law: {make: "benchmarks.rig.policies:straight_push"}
"""
    every, few, law = read(tmp_path, text).policies
    assert (every.demonstrations.sets, every.demonstrations.divided) == ([3, 4], True)
    assert (few.demonstrations.sets, few.demonstrations.size, few.demonstrations.good) == ([3, 4], 5, 12)
    assert law.demonstrations is None


def test_a_varied_key_has_the_type_of_its_field_and_is_no_group(tmp_path):
    found = read(tmp_path, PLAIN + "vary: {sensor.force_noise: [[1, 2, 3]], contact.friction: [1]}\n")
    scenario = found.scenario_with(found.combinations[0].scenario, "sweep")
    assert [type(value) for value in (scenario.contact.friction, *scenario.sensor.force_noise)] == [float] * 4
    with pytest.raises(ValueError, match="sweep: sensor is 1, expected keys with values"):
        cells_of(read(tmp_path, PLAIN + "vary: {sensor: [1, 2]}\n"), "sweep")


def test_a_policy_may_perform_only_the_first_trials(tmp_path):
    push = '{make: "benchmarks.rig.policies:straight_push", trials: 4}'
    text = f"policies: {{skill: {{learn: {{}}}}, push: {push}}}\ntrials: {{first: 7, number: 9}}\n"
    assert [policy.trials for policy in read(tmp_path, text).policies] == [9, 4]
    with pytest.raises(ValueError, match=r"policies.push.trials is 4, expected 1 to 3"):
        read(tmp_path, text.replace("number: 9", "number: 3"))


def test_a_factor_of_the_training_changes_the_demonstrations_of_every_policy_that_learns(tmp_path):
    text = PLAIN + "  # one policy\nvary: {training.size: [5, 10]}\ndemonstrations: {sets: [1, 2], good: 8, bad: 2}\n"
    found = read(tmp_path, text)
    sizes = [plan_in(found.policies[0], cell, "sweep").size for cell in found.combinations]
    assert sizes == [5, 10]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("policies: {}", "policies is empty"),
        ("title: 3\n" + PLAIN, "title is 3, expected a name"),
        ("trails: {number: 3}\n" + PLAIN, "unknown key 'trails'"),
        ("trial_sets: [harder]\n" + PLAIN, "trial_sets is ['harder'], expected a list of some of"),
        ("engines: [drake, drake]\n" + PLAIN, "expected each one once"),
        ("engines: []\n" + PLAIN, "expected a list of some of"),
        ("vary: {contact.frictoin: [0.1]}\n" + PLAIN, "unknown key 'contact.frictoin', expected one of"),
        ("vary: {contact.friction: [-1]}\n" + PLAIN, "contact.friction is -1"),
        ("vary: {training.goods: [1]}\n" + PLAIN, "unknown key 'training.goods'"),
        ("demonstrations: {demonstrated_in: here}\n" + PLAIN, "expected one of ['base', 'cell']"),
        (
            "policies: {a: {learn: {}, skill: x.npz}}",
            "['learn', 'skill'], expected one of learn, skill and make",
        ),
        ("policies: {a: {make: push}}", "expected an import path such as package.module:function"),
        ("policies: {a: {learn: {}, for_all_trial_sets: true}}", "for_all_trial_sets is true, expected false"),
        ("policies: {a: {learn: {}, options: {d: 1}}}", "policies.a.options is given, expected none"),
        ("demonstrations: {select: first}\n" + PLAIN, "demonstrations.select is 'first', expected an import path"),
        ("policies: {a: {skill: x.npz, demonstrations: {good: 3}}}", "a skill file has learnt already"),
        ('policies: {"a\\nb": {learn: {}}}', "is no name, expected a printable one"),
        ("", "the file is empty, expected keys with values, of ['clearance_rules',"),
        ("- a\n- b\n", "the file is ['a', 'b'], expected keys with values"),
        ("policies: [\n", "line"),
    ],
)
def test_a_specification_that_is_wrong_is_one_line_that_names_the_file_and_the_key(tmp_path, text, message):
    with pytest.raises(ValueError, match=r"sweep\.yaml: ") as error:
        cells_of(read(tmp_path, text), "sweep.yaml")
    assert message in str(error.value)
    assert "\n" not in str(error.value)


def test_an_overridden_scenario_differs_in_these_keys_only():
    nominal = load_scenario()
    changed = overridden(nominal, {"contact.friction": 0.3, "sensor.force_bias": 0.25}, "sweep")
    assert (changed.contact.friction, changed.sensor.force_bias) == (0.3, 0.25)
    back = {"contact.friction": nominal.contact.friction, "sensor.force_bias": nominal.sensor.force_bias}
    assert overridden(changed, back, "sweep") == nominal


def test_numerics_and_start_follow_the_clearance_by_rule(tmp_path):
    text = PLAIN + "vary: {geometry.hole_radius: [0.010025, 0.01005]}\n"
    plain, ruled = read(tmp_path, text), read(tmp_path, text + "clearance_rules: [numerics, start]\n")
    for cell in plain.combinations:
        own, followed = (s.scenario_with(cell.scenario, "sweep") for s in (plain, ruled))
        assert own == overridden(load_scenario(), cell.scenario, "sweep")
        assert followed == start_of_clearance(numerics_of_clearance(own))
    assert followed == own  # the nominal clearance
    assert ruled.scenario_with(ruled.combinations[0].scenario, "sweep").geometry.facets == 48
