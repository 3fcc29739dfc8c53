"""The columns of rows of trials."""

import pytest

from experiments.sweep.sweep_run import scenario_columns
from experiments.sweep.trial_files import SCHEMA
from models.scenario import load_scenario
from tests.experiments.sweep.made_up_rows import made_up_row


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
