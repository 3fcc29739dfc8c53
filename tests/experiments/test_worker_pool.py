"""The processes that simulate."""

import os
import subprocess
import sys
import time
from functools import partial

import pytest

from experiments.worker_pool import run_in_processes
from tests.scripts.commands import ROOT


def square(x):
    return x * x, os.getpid()


def is_alive(pid):
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


def test_one_job_runs_in_this_process_and_in_order():
    results = list(run_in_processes((partial(square, x) for x in range(5)), jobs=1))
    assert results == [(x * x, os.getpid()) for x in range(5)]
    assert list(run_in_processes([], jobs=2)) == []


@pytest.mark.slow
def test_results_of_several_processes_come_in_order():
    results = list(run_in_processes((partial(square, x) for x in range(8)), jobs=2))
    assert [r for r, _ in results] == [x * x for x in range(8)]
    assert os.getpid() not in {pid for _, pid in results}


@pytest.mark.slow
def test_an_idle_worker_ends_with_its_parent(tmp_path):
    """The parent has finished its work, keeps its workers for the next, and is killed."""
    code = """
import os, sys
from functools import partial
from experiments.worker_pool import run_in_processes
from tests.experiments.test_worker_pool import square
print(*{pid for _, pid in run_in_processes([partial(square, x) for x in range(8)], jobs=2)}, flush=True)
input()
"""
    with subprocess.Popen(
        [sys.executable, "-c", code], cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as parent:
        workers = [int(pid) for pid in parent.stdout.readline().split()]
        assert workers
        assert all(map(is_alive, workers))
        parent.kill()
        parent.wait()
        end = time.monotonic() + 10
        while any(map(is_alive, workers)):
            assert time.monotonic() < end, workers
            time.sleep(0.05)
