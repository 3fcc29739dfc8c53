"""The default contact against the settings of earlier scenarios, and the effect of the broken edge."""

import json

import pytest

from benchmarks.physics import convergence
from benchmarks.physics.convergence import BEFORE, SLIDES, drake_case, main, measure, mujoco_cases

ACCURACY = ("depth_error", "moment_error", "overlap_um", "large_overlap_um", *SLIDES)


@pytest.mark.slow
def test_the_default_is_at_least_as_accurate_as_before_and_overlaps_by_less_than_10_um_under_50_n():
    now, before = (measure(drake_case(setting)) for setting in ({}, BEFORE))
    for name in ACCURACY:
        assert abs(now[name]) <= abs(before[name]), name
    assert abs(now["play_depth_error"]) < 1e-3
    assert now["large_overlap_um"] < 10.0
    assert now["cost_ms"] < 0.6 * before["cost_ms"]


@pytest.mark.slow
def test_the_table_has_one_row_per_setting(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(convergence, "SETTINGS", [{"facets": 24, "corners": "outside"}])
    main(json=tmp_path / "rows.json")
    row, *rigid = json.loads((tmp_path / "rows.json").read_text())["rows"]
    assert row["play_depth_error"] > 1.0  # the sagitta is 86 um, the clearance 50 um
    assert [case["setting"].split(",")[0] for case in rigid] == ["exact"] * 5
    assert row["setting"] in capsys.readouterr().out


@pytest.mark.slow
def test_mujoco_agrees_about_a_firm_slide_and_has_no_meshes_to_measure():
    pytest.importorskip("mujoco", reason="needs the extra [peers]")
    row = measure(next(mujoco_cases()))
    assert "play_depth_error" not in row
    assert abs(row["firm_20mm"]) < 0.1
