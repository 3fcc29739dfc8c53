"""The command lines of the benchmarks: help, errors and result files."""

import ast
import importlib
import sys
from pathlib import Path

import pytest

from benchmarks.command_line import argument_parser, run
from tests.benchmarks.test_extras import COMMANDS, ROOT


def import_command(module):
    for name in ("hmmlearn", "mujoco"):
        if name in (ROOT / (module.replace(".", "/") + ".py")).read_text():
            pytest.importorskip(name, reason="needs the extra [peers]")
    return importlib.import_module(module)


@pytest.mark.parametrize("module", COMMANDS)
def test_the_help_shows_the_command_and_explains_every_option(module, monkeypatch, capsys):
    command = import_command(module)
    monkeypatch.setattr(sys, "argv", [module, "-h"])
    monkeypatch.setenv("COLUMNS", "200")
    with pytest.raises(SystemExit) as end:
        command.main()
    assert end.value.code == 0
    text = capsys.readouterr().out
    assert f"python -m {module}" in text
    assert command.__doc__.splitlines()[0] in text
    options = [line for line in text[text.index("\noptions:") :].splitlines() if line.startswith("  -")]
    assert options
    following = text.splitlines()
    for line in options:
        help_text = line.strip().split("  ", 1)[1:] or [following[following.index(line) + 1].strip()]
        assert len(help_text[0].strip()) > 5, line


def test_an_error_is_one_message_and_exit_code_1(capfd):
    def main():
        raise ValueError("--trials 0; expected at least 1")

    with pytest.raises(SystemExit) as end:
        run(main)
    assert end.value.code == 1
    out, err = capfd.readouterr()
    assert out == ""
    assert "error: --trials 0; expected at least 1" in err
    assert "Traceback" not in err


def test_a_run_without_an_error_returns():
    results = []
    run(lambda: results.append(1))
    assert results == [1]


def test_every_benchmark_has_the_option_for_a_result_file():
    assert argument_parser("text").parse_args(["--json", "a.json"]).json == Path("a.json")


def test_result_files_are_written_atomically():
    for path in (ROOT / "benchmarks").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            name = node.attr if isinstance(node, ast.Attribute) else ""
            assert name not in {"write_text", "write_bytes", "dump"}, f"{path}: {name}; use write_json"
