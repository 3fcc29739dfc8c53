"""A worker of a sweep builds one rig for a cell, and its trials are those of new rigs."""

import pytest

from experiments.sweep.cells import Cell, PolicyRecipe
from experiments.sweep.policies import MadePolicy
from experiments.sweep.specification import PolicyPlan
from experiments.sweep.sweep_run import perform, result_columns
from experiments.trial import diagram_trial
from experiments.trial.run_trial import run_trial
from experiments.trial.trial_set import TrialSet, trial_scenario
from models.scenario import load_scenario
from tests.experiments.sweep.pushes import Push


@pytest.fixture
def built(monkeypatch):
    """The engines in which rigs were built, with none kept."""
    found = []
    make_rig = diagram_trial.MakeRig
    monkeypatch.setattr(diagram_trial, "_kept", [])
    monkeypatch.setattr(
        diagram_trial,
        "MakeRig",
        lambda scenario, policy: (found.append(scenario.contact.engine), make_rig(scenario, policy))[1],
    )
    return found


def short_scenario(engine):
    scenario = load_scenario()
    scenario.trial.time_limit, scenario.contact.engine = 0.4, engine
    return scenario


@pytest.mark.parametrize("engine", ["drake", "exact"])
def test_trials_of_one_cell_share_a_rig_and_equal_those_of_new_rigs(built, engine):
    scenario, made = short_scenario(engine), MadePolicy(Push(), None, None, None)
    plan = PolicyPlan("push", None, "tests.experiments.sweep.pushes:push", {}, None, False)
    recipe = PolicyRecipe(plan, None, None, scenario, TrialSet.HARD, {})
    one, other = (Cell(recipe, scenario, TrialSet.HARD, factors, []) for factors in ("{}", '{"a": 1}'))
    for number in (84100, 84101, 84100):
        row = perform(one, made, number)
        new, _ = run_trial(trial_scenario(scenario, number=number, trial_set=TrialSet.HARD), Push(), seed=number)
        expected = result_columns(new)
        assert {name: row[name] for name in expected} == pytest.approx(expected, nan_ok=True, abs=0)
    assert built == [engine]
    perform(other, made, 84100)
    assert built == [engine] * 2
