"""A worker of a sweep builds one rig for a cell, and its trials are those of new rigs."""

from dataclasses import replace

import pytest

from experiments.sweeps.trial_rows import TrialSource, perform, result_columns
from experiments.trial import diagram_trial
from experiments.trial.run_trial import run_trial
from experiments.trial.trial_set import TrialSet, trial_scenario
from models.scenario import load_scenario
from tests.experiments.sweeps.pushes import Push


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


def short_source(engine="drake", **changes):
    scenario = load_scenario()
    scenario.trial.time_limit, scenario.contact.engine = 0.4, engine
    return replace(TrialSource(scenario, TrialSet.USUAL, "p" * 16, "push", "{}"), **changes)


@pytest.mark.parametrize("engine", ["drake", "exact"])
def test_trials_of_one_cell_share_a_rig_and_equal_those_of_new_rigs(built, engine):
    trial_set = TrialSet.HARD
    source = short_source(engine, trial_set=trial_set)
    for number in (84100, 84101, 84100):
        row = perform(source, Push(), number, {})
        new, _ = run_trial(trial_scenario(source.scenario, number=number, trial_set=trial_set), Push(), seed=number)
        assert {name: row[name] for name in result_columns(new)} == pytest.approx(
            result_columns(new), nan_ok=True, abs=0
        )
    assert built == [engine]


def test_another_cell_gets_another_rig(built):
    perform(short_source(), Push(), 84100, {})
    perform(short_source(policy="q" * 16), Push(), 84100, {})
    changed = load_scenario()
    changed.trial.time_limit, changed.contact.friction = 0.4, 0.25
    perform(short_source(scenario=changed), Push(), 84100, {})
    perform(short_source(scenario=changed), Push(), 84101, {})
    assert len(built) == 3
