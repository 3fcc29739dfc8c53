"""Pegs of any size: the design, the laws of one, and the summary."""

import numpy as np
import pandas as pd
import pytest

from benchmarks.own_pegs import LEAST, MOST, corners, demonstrated, laws, measure, scenario_of, sizes_of, summary


def test_the_design_fills_its_range_and_is_that_of_its_seed():
    sizes = sizes_of(2, 60)
    assert (sizes == sizes_of(2, 60)).all()
    assert (sizes != sizes_of(1, 60)).any()
    parts = (np.log(sizes) - LEAST) / (MOST - LEAST)
    for column in parts.T:  # one in each of sixty equal parts
        assert sorted(np.floor(60 * column)) == list(range(60))
    assert corners().shape == (8, 3)
    assert corners()[[0, -1]] == pytest.approx(np.array([[0.003, 0.002, 0.5], [0.03, 0.2, 5.0]]))


@pytest.mark.slow
@pytest.mark.parametrize("sizes", [(0.003, 0.002, 5.0), (0.03, 0.002, 2.0)])
def test_the_laws_hold_at_unusual_sizes(sizes):
    found = laws(scenario_of(*sizes), 0)
    assert abs(found["depth"]) < 0.02
    assert abs(found["slide"]) < 0.06
    assert abs(found["wedge"]) < 0.02
    assert found["jam"] > 0.9


@pytest.mark.nightly
def test_an_unusual_peg_is_taught_and_tried():
    row = measure(np.array([0.02, 0.02, 0.6]), 1, 3)
    assert row["demonstrated"] == 24 + 6
    assert row["inserted"] == 1
    assert row["warned"] == ""


@pytest.mark.parametrize("bad", [0, 2])
def test_where_a_bad_example_is_missing_only_good_ones_are_taught(bad, monkeypatch):
    def shown(scenario, requested, *, seed, jobs):
        yield from ((request, request.number) for request in requested[: 24 + bad])
        raise ValueError("no bad example")

    monkeypatch.setattr("benchmarks.own_pegs.demonstrate_all", shown)
    assert demonstrated(None, 0) == list(range(24))


def test_a_good_example_that_is_missing_is_an_error(monkeypatch):
    def shown(scenario, requested, *, seed, jobs):
        yield requested[0], 0
        raise ValueError("no good example")

    monkeypatch.setattr("benchmarks.own_pegs.demonstrate_all", shown)
    with pytest.raises(ValueError, match="no good example"):
        demonstrated(None, 0)


def test_the_depth_is_not_measured_where_the_floor_comes_before_the_second_contact():
    assert np.isnan(laws(scenario_of(0.003, 0.12, 1.1), 0)["depth"])
    assert abs(laws(scenario_of(0.0043, 0.0173, 0.6), 0)["depth"]) < 0.02


def test_a_peg_that_no_device_reaches_is_refused():
    assert measure(np.array([0.03, 0.002, 5.0]), 1, 3)["warned"].startswith("refused: own peg: geometry.hole_depth")


def test_the_summary_counts_scenarios():
    rows = pd.DataFrame(
        {
            "inserted": [10, 10, 7, np.nan],
            "laws": [True, False, True, np.nan],
            "warned": [np.nan, np.nan, "a", "refused"],
        }
    )
    assert summary(rows, 10).splitlines() == [
        "1 of 4 scenarios refused; laws hold in 2 of 3",
        "without a warning, scenarios by insertions of 10: 2 with 10",
        "with one, scenarios by insertions of 10: 1 with 7",
    ]
