"""The benchmark of the servo, shortened: its keys."""

import json
import os

import pytest

from benchmarks import servo


@pytest.mark.nightly
@pytest.mark.slow
def test_the_servo_is_measured(tmp_path):
    path = tmp_path / "servo.json"
    servo.main(seconds=1.0, json=path)
    found = json.loads(path.read_text())
    assert 0.9 < found["tick_ms_p50"] < found["tick_ms_p999"] <= found["tick_ms_max"]
    assert 0.0 <= found["late_share"] <= 1.0
    assert found["realtime_rate"] > 0.1
    assert isinstance(found["priority"], bool)
    assert os.sched_getscheduler(0) == os.SCHED_OTHER  # this process and what it starts stay as they were
