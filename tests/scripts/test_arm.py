"""The commands `twin` and `arm`, end to end."""

import json
import re
import signal
import subprocess
import sys
from contextlib import contextmanager

import pytest
from typer.testing import CliRunner

from scripts.haptic_skill import app
from tests.interfaces.robots.test_fr3_twin import loopback_address

pytest.importorskip("franky")
pytest.importorskip("franky_sim")


def run(*arguments, answer=""):
    return CliRunner().invoke(app, ["arm", *map(str, arguments)], input=answer)


def test_nothing_moves_before_the_address_is_confirmed(tmp_path):
    result = run("--address", loopback_address(), "--out", tmp_path / "arm", answer="n\n")
    assert result.exit_code == 1
    assert "Move the fr3 at" in result.output
    assert not (tmp_path / "arm").exists()


def test_an_arm_that_does_not_answer_is_named(tmp_path):
    host = loopback_address()
    result = run("--address", host, "--out", tmp_path / "arm", "--yes")
    assert result.exit_code == 1
    assert re.search(rf"{host}: no arm answers \(.*\); expected a Franka with FCI activated", result.output)
    assert not (tmp_path / "arm").exists()


@contextmanager
def served(tmp_path):
    """Address of a simulated arm, and of its sensor; at the end the arm is stopped."""
    host = loopback_address()
    serve = ["-m", "haptic_skill", "twin", "fr3", "--host", host, "--json", str(tmp_path / "twin.json")]
    twin = subprocess.Popen([sys.executable, *serve], stdout=subprocess.PIPE, text=True)
    try:
        yield host, re.search(r"its sensor at (\S+);", twin.stdout.readline())[1]
    finally:
        twin.send_signal(signal.SIGINT)
        assert twin.wait(10.0) == 130


@pytest.mark.slow
def test_an_insertion_is_served_performed_and_recorded(tmp_path):
    with served(tmp_path) as (host, url):
        done = run("--address", host, "--sensor", url, "--trials", 1, "--yes", "--out", tmp_path / "arm")
        assert done.exit_code == 0, done.output
    (result,) = json.loads((tmp_path / "arm" / "results.json").read_text())
    (hole,) = json.loads((tmp_path / "twin.json").read_text())
    assert result["inserted"]
    assert hole["inserted"]
    assert hole["depth_mm"] == pytest.approx(result["depth_mm"], abs=0.5)  # the tip bends by its load, and goes on
    assert (tmp_path / "arm" / "run_0000.parquet").exists()


@pytest.mark.nightly
def test_a_dry_run_moves_above_the_hole(tmp_path):
    with served(tmp_path) as (host, url):
        dry = run("--address", host, "--sensor", url, "--dry-run", "--yes")
    assert dry.exit_code == 0, dry.output
    assert re.search(r"dry run, 60 mm above the hole: inserted after", dry.output)
