"""The command lines of the benchmarks: help, errors, missing packages and result files."""

import json
import sys

import pytest

from benchmarks.command_line import JsonFile, finish, run


def benchmark(json: JsonFile = None):
    raise ValueError("no samples")


def test_an_error_is_one_line_and_exit_code_1(monkeypatch, capfd):
    monkeypatch.setattr(sys, "argv", ["benchmark"])
    with pytest.raises(SystemExit) as end:
        run(benchmark)
    assert end.value.code == 1
    assert capfd.readouterr().err == "error: no samples\n"


def test_results_are_written_with_the_machines_own_speed(tmp_path, capsys):
    finish({"rows": [1]}, tmp_path / "results.json")
    found = json.loads((tmp_path / "results.json").read_text())
    assert found == {"rows": [1], "machine_speed": pytest.approx(found["machine_speed"])}
    assert f"reference loop: {found['machine_speed']:.0f} ms" in capsys.readouterr().out
