"""Rows of trials: what identifies them, and what must not perform them."""

from dataclasses import replace

import pytest

from experiments.sweeps import trial_rows
from experiments.sweeps.trial_files import SCHEMA
from experiments.sweeps.trial_rows import TrialSource, scenario_columns
from experiments.trial.trial_set import TrialSet
from models.scenario import load_scenario
from tests.experiments.sweeps.made_up_rows import made_up_row


def in_engine(engine):
    scenario = load_scenario()
    scenario.contact.engine = engine
    return scenario


def source(**changes):
    plain = TrialSource(load_scenario(), TrialSet.USUAL, "p" * 16, "push", "{}")
    return replace(plain, **changes)


@pytest.mark.parametrize(
    "changes",
    [
        {"scenario": load_scenario("tight")},
        {"trial_set": TrialSet.HARD},
        {"scenario": in_engine("exact")},
        {"policy": "q" * 16},
        {"name": "shove"},
        {"factors": '{"a": 1}'},
    ],
)
def test_all_that_decides_a_trial_changes_its_key(changes):
    assert source().digest() == source().digest()
    assert source(**changes).digest() != source().digest()


def test_code_and_versions_change_the_key_too(monkeypatch):
    before = source().digest()
    with monkeypatch.context() as patched:
        patched.setattr(trial_rows, "trial_code", lambda: "another revision")
        assert source().digest() != before
    monkeypatch.setattr(trial_rows, "versions", lambda: {"drake": "0"})
    assert source().digest() != before


def test_a_row_has_the_columns_of_the_schema_and_no_other():
    assert {*made_up_row(3), "key"} == set(SCHEMA.names)


def test_the_columns_of_a_scenario_are_in_the_units_of_their_names():
    scenario = load_scenario()
    scenario.rig.pivot_height = -0.0012
    found = scenario_columns(scenario)
    assert found["pivot_mm"] == pytest.approx(-1.2)
    assert found["clearance"] == pytest.approx(0.005)  # 0.1 mm over 20 mm
    assert (found["peg_radius_mm"], found["hole_radius_mm"]) == pytest.approx((10.0, 10.05))
    assert found["force_limit_n"] == 40.0
