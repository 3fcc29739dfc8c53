"""Runs commands for the tests: in a separate process, or faster in this one."""

import os
import subprocess
import sys
from pathlib import Path
from unittest.mock import patch

from typer.testing import CliRunner

from interfaces.terminal import console
from scripts.haptic_skill import app

ROOT = Path(__file__).resolve().parents[2]
HAPTIC_SKILL = ("-m", "haptic_skill")  # what the installed command does


def run_python(*arguments, cwd=ROOT, timeout=300, **environment):
    """Runs Python in a separate process, which finds the packages of this checkout; returns the completed process."""
    plain = {"NO_COLOR": "1", "COLUMNS": "200", "TERM": "dumb", "OPENBLAS_NUM_THREADS": "1", "PYTHONPATH": str(ROOT)}
    return subprocess.run(
        [sys.executable, *map(str, arguments)],
        cwd=cwd,
        capture_output=True,
        text=True,
        timeout=timeout,
        check=False,
        env=os.environ | plain | environment,
    )


def invoke(*arguments, columns=160):
    """Runs a command of haptic-skill in this process; tables are up to 160 columns wide."""
    runner = CliRunner(env={"NO_COLOR": "1", "TERM": "dumb", "COLUMNS": str(columns)})
    # The console takes its width from the environment once, when a test first imports it.
    with patch.object(console, "_width", columns):
        return runner.invoke(app, [str(a) for a in arguments])


def error_line(result):
    """The one line that a failed command of `invoke` prints on stderr."""
    assert result.exit_code == 1, result.output
    assert isinstance(result.exception, SystemExit), result.exception
    assert "Traceback" not in result.output
    lines = [line for line in result.stderr.splitlines() if line.strip()]
    assert len(lines) == 1, result.stderr
    assert lines[0].startswith("error: ")
    return lines[0]


def files(folder):
    """Paths of all files below a folder, relative to it, sorted."""
    return sorted(str(p.relative_to(folder)) for p in folder.rglob("*") if p.is_file())
