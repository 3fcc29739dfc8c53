"""The command lines of the benchmarks: help, errors, missing packages and result files."""

import json
import os
import subprocess
import sys

import pytest

import benchmarks
from benchmarks.command_line import JsonFile, finish, run
from tests.scripts.commands import ROOT


def benchmark(json: JsonFile = None):
    raise ValueError("no samples")


def test_the_help_is_the_docstring_of_the_module_with_its_line_breaks(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["benchmark", "-h"])
    with pytest.raises(SystemExit) as end:
        run(benchmark)
    assert end.value.code == 0
    text = capsys.readouterr().out
    assert __doc__.splitlines()[0] in text
    assert "--json FILE" in text


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


@pytest.mark.slow
def test_a_missing_package_is_one_line_that_names_its_extra(tmp_path):
    """A package of the name that cannot be imported stands before the installed one."""
    (tmp_path / "hmmlearn.py").write_text("raise ModuleNotFoundError('hidden', name='hmmlearn')")
    path = os.pathsep.join([str(tmp_path), str(ROOT)])
    command = [sys.executable, "-m", "benchmarks.learners.contact_states", "-h"]
    done = subprocess.run(
        command, cwd=ROOT, env=os.environ | {"PYTHONPATH": path}, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout) == (1, "")
    message = "this needs the extra [peers], but 'hmmlearn' is missing: install haptic-skill[peers]"
    assert done.stderr == f"error: {message}\n"


def test_other_errors_keep_their_traceback(capsys):
    benchmarks.name_missing_extra(KeyError, KeyError("defect"), None)
    assert "KeyError: 'defect'" in capsys.readouterr().err
