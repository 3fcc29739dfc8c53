"""The throughput of the compiled loop, at a small size."""

import json

import pytest

from benchmarks import throughput


@pytest.mark.nightly
def test_the_loop_is_the_diagram_and_faster(tmp_path):
    throughput.main(trials=4, compared=2, json=tmp_path / "found.json")
    found = json.loads((tmp_path / "found.json").read_text())
    assert found["outcomes_equal"] == found["samples_equal"] == 1.0
    assert found["ratio_to_diagram"] > 1.5
    assert {"trials_per_minute_core", "two_core_ratio", "machine_speed"} <= set(found)
