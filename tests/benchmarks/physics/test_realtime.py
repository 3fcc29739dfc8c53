"""The count of late steps, and the results of a short demonstration."""

import json

import numpy as np
import pytest
import yaml

from benchmarks.physics.realtime import late, main

KEYS = {"realtime_rate", "step_ms_p50", "step_ms_p99", "missed_deadlines", "facets", "contact_fraction"}


@pytest.mark.parametrize(
    ("costs", "missed"),
    [
        ([0.9] * 5, 0),
        ([1.1] * 5, 5),  # the delay accumulates
        ([0.5, 2.5, 0.2, 0.2, 0.2], 2),  # a slow step delays the next one, and then the delay is made up
        ([3.0, 0.5, 0.5, 0.5], 4),
    ],
)
def test_a_slow_step_delays_the_next_ones_until_the_delay_is_made_up(costs, missed):
    assert late(np.array(costs), 1.0) == missed


@pytest.mark.slow
def test_the_results_are_complete(tmp_path):
    quick = {
        "geometry": {"hole_depth": 0.006, "peg_length": 0.02},
        "start": {"height": 2e-4},
        "contact": {"time_step": 0.004},
        "coupling": {"peg_inertia": 0.02, "angular_damping": 2.0},
    }
    (tmp_path / "quick.yaml").write_text(yaml.safe_dump(quick))
    path = tmp_path / "out" / "realtime.json"
    main(["--json", str(path), "--scenario", str(tmp_path / "quick.yaml"), "--seed", "1"])
    results = json.loads(path.read_text())
    assert set(results) >= KEYS
    assert results["facets"] == 32
    assert results["contact_fraction"] > 0.5
    assert results["play_error"] == pytest.approx(0.004815, rel=1e-3)
