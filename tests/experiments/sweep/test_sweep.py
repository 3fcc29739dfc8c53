"""Whole sweeps: what is performed, what is repeated, and what is lost when processes die."""

import os
import re
import signal
import subprocess
import sys
import time

import pytest

from experiments.sweep import cells
from skill.manipulation_skill import ManipulationSkill
from tests.experiments.sweep.conftest import rows_in
from tests.scripts.commands import ROOT

PUSH = {"make": "tests.experiments.sweep.pushes:push"}
TIMES = ["cpu_s", "began", "train_s", "query_ms"]

pytestmark = pytest.mark.slow


def without_times(rows):
    return rows.drop(columns=TIMES)


def test_a_sweep_that_is_given_again_performs_only_what_is_missing(
    specification, perform, tmp_path, capsys, monkeypatch
):
    keys = {"policies": {"push": PUSH}, "vary": {"contact.friction": {"uniform": [0.1, 0.3]}}}
    path = specification(**keys, design={"random": 2}, trials={"number": 1})
    first = perform(path)
    assert first.friction.between(0.1, 0.3).all()
    assert perform(path).equals(first)  # the times of the trials too
    assert "2 trials, 2 of them done already" in capsys.readouterr().out
    larger = specification("larger", **keys, design={"random": 3}, trials={"number": 1})
    more = perform(larger)
    assert more.friction.nunique() == len(more) == 3
    assert more[more.key.isin(first.key)].reset_index(drop=True).equals(first)
    stored = tmp_path / "results" / "sweeps"
    assert sorted(p.name for p in stored.glob("*.yaml")) == ["larger.yaml", "sweep.yaml"]
    assert (stored / "sweep.yaml").read_bytes() == path.read_bytes()
    monkeypatch.setattr(cells, "code_digest", lambda: "another revision")
    again = perform(path)
    assert len(again) == 5  # another line of code makes other rows
    assert again.key.is_unique


@pytest.mark.nightly
def test_policies_that_learn_are_taught_once_and_kept(specification, perform, tmp_path, monkeypatch):
    keys = {
        "policies": {"all": {"learn": {}}, "few": {"learn": {}, "demonstrations": {"size": 2}}},
        "demonstrations": {"sets": [0, 1], "good": 3, "bad": 1, "divided": True},
    }
    rows = perform(specification(**keys, trials={"first": 10, "number": 4}))
    assert len(rows) == 8
    assert set(zip(rows.policy, rows.demonstrations, strict=True)) == {("all", 4), ("few", 2)}
    assert all(rows.demonstration_set == rows.trial % 2)
    kept = sorted(path.name for path in (tmp_path / "results" / "skills").glob("*.npz"))
    assert len(kept) == 4
    monkeypatch.setattr(ManipulationSkill, "fit", None)  # nothing is learnt again
    assert len(perform(specification(**keys, trials={"first": 10, "number": 6}), jobs=1)) == 12


def test_a_killed_worker_costs_its_trial_once_and_what_always_kills_is_given_up(specification, perform, tmp_path):
    deadly, fatal = ({**PUSH, "options": {"deaths": str(tmp_path / f"{k}"), "times": k}} for k in (1, 99))
    rows = perform(specification(policies={"push": deadly}, trials={"number": 2}))
    assert (tmp_path / "1").read_text() == "x"
    assert sorted(rows.trial) == [0, 1]
    policies = {"fatal": fatal, "none": {"make": "tests.experiments.sweep.pushes:unwilling"}, "push": PUSH}
    with pytest.raises(ValueError, match="2 trials could not be performed and have no row"):
        perform(specification("fatal", policies=policies, trials={"number": 1}), results="fatal")
    assert rows_in(tmp_path / "fatal").policy.tolist() == ["push"]


@pytest.mark.nightly
def test_a_killed_client_loses_no_row_and_a_second_one_goes_on(specification, tmp_path):
    path = specification(policies={"push": PUSH}, trials={"number": 14})
    results = tmp_path / "results"
    arguments = [sys.executable, "-m", "haptic_skill", "sweep", path, "--out", results, "--jobs", "2"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "COLUMNS": "200", "OPENBLAS_NUM_THREADS": "1"}
    client = subprocess.Popen(arguments, cwd=ROOT, env=environment, stdout=subprocess.DEVNULL)
    wait_for(lambda: list(results.rglob("*.parquet")) and len(rows_in(results)) >= 3)
    client.send_signal(signal.SIGKILL)
    client.wait()
    before = rows_in(results)
    assert 3 <= len(before) < 14
    done = subprocess.run(arguments, cwd=ROOT, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert f"{len(before)} of them done already" in done.stdout
    after = rows_in(results)
    assert len(after) == 14
    assert after.key.is_unique
    assert after[after.key.isin(before.key)].reset_index(drop=True).equals(before)


def wait_for(condition, seconds=400.0):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.05)


class DaskCluster:
    """A Dask scheduler and two workers, as processes of their own."""

    def __init__(self, folder):
        self._file = folder / "scheduler.json"
        scheduler = ["dask_scheduler", "--host", "127.0.0.1", "--port", "0", "--scheduler-file", str(self._file)]
        self.scheduler = self._start(*scheduler)
        wait_for(self._file.exists)
        self.address = re.search(r"tcp://[^\"]+", self._file.read_text())[0]
        options = ["--scheduler-file", str(self._file), "--nthreads", "1", "--no-nanny"]
        self.workers = [self._start("dask_worker", *options) for _ in range(2)]

    def kill(self):
        for process in (self.scheduler, *self.workers):
            process.kill()
            process.wait()

    def _start(self, name, *options):
        environment = {**os.environ, "PYTHONPATH": str(ROOT), "OPENBLAS_NUM_THREADS": "1"}
        places = {"cwd": ROOT, "env": environment, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        return subprocess.Popen([sys.executable, "-m", f"distributed.cli.{name}", *options, "--no-dashboard"], **places)


@pytest.fixture
def dask_cluster(tmp_path):
    """A cluster that ends with the test."""
    pytest.importorskip("distributed", reason="needs the extra [dask]")
    cluster = DaskCluster(tmp_path)
    yield cluster
    cluster.kill()


@pytest.mark.nightly
def test_a_dask_cluster_gives_the_same_rows_though_one_worker_is_killed_in_mid_trial(
    specification, perform, dask_cluster, tmp_path
):
    deadly = {**PUSH, "options": {"deaths": str(tmp_path / "deaths"), "times": 1}}
    path = specification(policies={"push": deadly}, trials={"number": 6})
    rows = perform(path, dask=dask_cluster.address)
    assert sum(worker.poll() is not None for worker in dask_cluster.workers) == 1
    assert sorted(rows.trial) == [0, 1, 2, 3, 4, 5]
    local = perform(path, results="local")
    assert without_times(rows).equals(without_times(local))
