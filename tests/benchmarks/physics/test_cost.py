import json

from benchmarks.physics import cost


def test_every_engine_has_a_cost_in_contact(tmp_path, monkeypatch):
    monkeypatch.setattr(cost, "ENGINES", ("drake", "exact"))
    monkeypatch.setattr(cost, "SECONDS", 0.3)
    monkeypatch.setattr(cost, "ROUNDS", 1)
    cost.main(json=tmp_path / "rows.json")
    rows = json.loads((tmp_path / "rows.json").read_text())["rows"]
    assert [row["engine"] for row in rows] == ["drake", "exact"]
    assert rows[1]["cpu_s"] < rows[0]["cpu_s"]
    assert all(0.4 < row["contact"] < 1.0 for row in rows)
