"""The benchmark of a live session, shortened: a real browser, a real session, and what can go wrong."""

import json

import pytest

from benchmarks.haptics import live_session


@pytest.mark.browser
@pytest.mark.slow
@pytest.mark.browser
def test_nothing_is_lost_when_the_tab_closes_the_machine_sleeps_and_the_servo_dies(tmp_path, monkeypatch):
    path = tmp_path / "session.json"
    monkeypatch.setattr("sys.argv", ["live_session", "--number", "3", "--json", str(path)])
    live_session.main()
    found = json.loads(path.read_text())
    assert len(found["demonstrations"]) == 3
    assert all(row["ticks"] > 1000 for row in found["demonstrations"])
    said = found["interruptions"]
    assert said["tab closed"] == "the page was closed: demonstration discarded, Space starts another"
    assert said["servo killed"].startswith("device lost (device driver 'page': its process ended with code -9)")
    assert found["kept"] == found["readable"] == 5  # and one after each of sleep and kill
    assert abs(found["memory_growth_mb"]) < 50.0


def row(**changes):
    known = {"ending": "inserted", "seconds": 7.0, "rate": 1.0, "late_ticks": 1, "ticks": 1000, "late_steps": 5}
    return known | {"steps": 250, "pictures": 30.0, "memory_mb": 500.0} | changes


def test_the_figures_are_over_all_demonstrations():
    rows = [row(), row(ending="stopped", seconds=9.0, late_ticks=3, ticks=3000), row(seconds=8.0, memory_mb=503.0)]
    found = live_session.summary(rows, {"tab closed": "said"})
    assert found["inserted"] == 2
    assert found["seconds_median"] == 8.0
    assert found["late_share"] == pytest.approx(5 / 5000)
    assert found["late_steps_share"] == pytest.approx(15 / 750)
    assert found["memory_growth_mb"] == pytest.approx(3.0)  # from the second to the last
    assert found["interruptions"] == {"tab closed": "said"}


def test_too_few_demonstrations_are_refused(monkeypatch):
    monkeypatch.setattr("sys.argv", ["live_session", "--number", "2"])
    with pytest.raises(ValueError, match="--number is 2, expected at least 3"):
        live_session.main()
