"""The default contact against the settings of earlier scenarios, and the effect of the broken edge."""

import json

import numpy as np
import pytest

from benchmarks.physics import convergence
from benchmarks.physics.contact_measurements import CRAWLING, PegTheory, crawl
from benchmarks.physics.contact_probe import ContactProbe
from benchmarks.physics.convergence import BEFORE, COLUMNS, SLIDES, main, measure, scenario_of

TILT = np.radians(1.0)
ACCURACY = ("depth_error", "moment_error", "overlap_um", "large_overlap_um", *SLIDES)


@pytest.mark.slow
def test_the_default_is_at_least_as_accurate_as_before_and_overlaps_by_less_than_10_um_under_50_n():
    now, before = (measure(setting, TILT, 5.0, 50.0) for setting in ({}, BEFORE))
    for name in ACCURACY:
        assert abs(now[name]) <= abs(before[name]), name
    assert abs(now["play_depth_error"]) < 1e-3
    assert now["large_overlap_um"] < 10.0
    assert now["cost_ms"] < 0.6 * before["cost_ms"]


@pytest.mark.slow
def test_a_chamfer_that_begins_at_the_mouth_pushes_against_a_sliding_peg():
    """The force is 21 % too large, and less than half of that with the broken edge."""
    scenario = scenario_of({})
    sizes, friction = PegTheory.of(scenario), scenario.contact.friction
    errors = {}
    for sharp in (True, False):
        probe = ContactProbe(scenario, sharp=sharp, **CRAWLING)
        predicted, measured = crawl(probe, sizes, friction, lateral=0.0, moment=0.2, depth=0.020)
        errors[sharp] = measured.mean() / predicted - 1.0
    assert errors[True] > 0.15
    assert 0.0 < errors[False] < 0.5 * errors[True]


@pytest.mark.slow
def test_the_table_has_one_row_per_setting(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(convergence, "FINEST", {"facets": 24})
    monkeypatch.setattr(convergence, "SETTINGS", [{"facets": 24, "corners": "outside"}])
    monkeypatch.setattr("sys.argv", ["convergence", "--json", str(tmp_path / "rows.json")])
    main()
    rows = json.loads((tmp_path / "rows.json").read_text())
    assert [row["setting"] for row in rows] == [{"facets": 24}, {"facets": 24, "corners": "outside"}]
    assert all(set(row) == {"setting", *COLUMNS} for row in rows)
    assert rows[1]["play_depth_error"] > 1.0  # the sagitta is 86 um, the clearance 50 um
    printed = capsys.readouterr().out.splitlines()
    assert printed[0].split()[0] == "setting"
    assert printed[2].startswith("facets 24, corners outside")
