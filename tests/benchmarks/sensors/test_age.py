"""The benchmark of the age of readings, shortened: its keys, and that ages are those of a stream at 1 kHz."""

import json

import numpy as np
import pytest

from benchmarks.sensors import age


def test_the_age_is_the_time_since_the_newest_record():
    now = age.time.monotonic()
    found = age.ages(lambda: 5.0, epoch=now - 7.0, seconds=0.05)  # sent 2 s before now
    assert found[0] == pytest.approx(2000.0, abs=100.0)
    assert (np.diff(found) > 0.0).all()
    assert not len(age.ages(lambda: None, epoch=now, seconds=0.01))


@pytest.mark.slow
def test_the_ages_of_both_readers_are_measured(tmp_path, capsys):
    path = tmp_path / "age.json"
    age.main(seconds=1.0, json=path)
    found = json.loads(path.read_text())
    for ages in (found, found["bare"]):
        assert 0.0 < ages["age_ms_p50"] < 10.0  # of a busy machine, too
        assert ages["age_ms_p50"] <= ages["age_ms_p99"] <= ages["age_ms_max"]
    assert found["age_ratio_p99"] == pytest.approx(found["age_ms_p99"] / found["bare"]["age_ms_p99"])
    assert "wanted: 99 % below 2 ms" in capsys.readouterr().out
