"""The policies of a sweep in the cells of its factors."""

import pytest

from experiments.sweeps.assignments import assignments
from experiments.sweeps.specification import read_specification

SWEEP = """
vary: {controller.wrench: ["true", zero, "scaled:0.5"]}
policies:
  push: {make: "benchmarks.rig.policies:straight_push"}
  compliance: {make: "benchmarks.rig.policies:tuned_compliance"}
  skill: {learn: {}}
demonstrations: {sets: [0]}
trials: {first: 96000, number: 2}
"""


def test_a_policy_is_made_once_with_the_measured_wrench_whatever_it_receives(tmp_path):
    path = tmp_path / "sweep.yaml"
    path.write_text(SWEEP)
    found = assignments(read_specification(path), tmp_path, "sweep")
    assert [a.source.scenario.controller.wrench for a in found] == ["true"] * 3 + ["zero"] * 3 + ["scaled:0.5"] * 3
    assert {a.policy.scenario.controller.wrench for a in found} == {"true"}
    assert len({a.policy.digest for a in found}) == 3
    assert len({a.source.digest() for a in found}) == 9


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ("true", "controller.wrench is True, expected a name in quotes"),
        ('"half"', "controller.wrench is 'half', expected one of"),
    ],
)
def test_a_value_that_yaml_takes_for_another_is_named(tmp_path, value, message):
    path = tmp_path / "sweep.yaml"
    path.write_text(SWEEP.replace('"true"', value))
    with pytest.raises(ValueError, match=message):
        assignments(read_specification(path), tmp_path, "sweep")
