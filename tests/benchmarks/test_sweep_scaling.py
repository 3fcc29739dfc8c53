"""The figures of the benchmark of sweeps."""

import pytest

from benchmarks.sweep_scaling import client_cost, summary
from tests.experiments.sweeps.made_up_rows import made_up_row


def one(jobs, wall, trials=10, cpu=2.0):
    return {"jobs": jobs, "trials": trials, "wall_s": wall, "trial_cpu_s": cpu, "cpu_s": trials * cpu}


def test_ratio_and_overhead_by_hand():
    single, double = summary([one(1, 20.0), one(2, 12.0), one(1, 25.0), one(2, 11.0), one(1, 21.0), one(2, 10.5)])
    assert single["trials_per_min"] == pytest.approx(600 / 21)
    assert double["ratio"] == pytest.approx(21 / 11)
    assert single["overhead"] == pytest.approx(0.05)  # 21 s for 20 s of trials
    assert double["overhead"] == pytest.approx(0.10)  # two times 11 s for them


@pytest.mark.slow
def test_the_client_writes_every_row_that_is_timed(skill_file, tmp_path):
    found = client_cost(skill_file, made_up_row(3), tmp_path)
    assert 0.0 < found["client_ms"] < 1000.0
    assert found["task_bytes"] > skill_file.stat().st_size / 10
    assert len(list(tmp_path.rglob("*.parquet"))) == 50
