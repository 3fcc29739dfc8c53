"""The benchmark's own arithmetic, and its report end to end on a short demonstration."""

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
        ([1.1] * 5, 5),  # the delay piles up
        ([0.5, 2.5, 0.2, 0.2, 0.2], 2),  # a slow one makes the next late, and then time is made up
        ([3.0, 0.5, 0.5, 0.5], 4),
    ],
)
def test_a_slow_step_makes_the_next_ones_late_until_time_is_made_up(costs, missed):
    assert late(np.array(costs), 1.0) == missed


def test_the_report_has_its_keys(tmp_path):
    quick = {
        "geometry": {"hole_depth": 0.006, "peg_length": 0.02},
        "start": {"height": 2e-4},
        "contact": {"time_step": 0.004},
        "coupling": {"peg_inertia": 0.02, "angular_damping": 2.0},
    }
    (tmp_path / "quick.yaml").write_text(yaml.safe_dump(quick))
    main(tmp_path / "out" / "realtime.json", scenario=str(tmp_path / "quick.yaml"), seed=1)
    found = json.loads((tmp_path / "out" / "realtime.json").read_text())
    assert set(found) >= KEYS
    assert found["facets"] == 64
    assert found["contact_fraction"] > 0.5
    assert found["sagitta_over_clearance"] < 0.25
