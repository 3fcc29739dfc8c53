"""The stream of trials: what it keeps in memory, and what it writes."""

import itertools
import tracemalloc
from pathlib import Path

import pytest

from experiments.sweeps import result_blocks, trial_stream
from experiments.sweeps.assignments import assignments
from experiments.sweeps.executors import make_pool
from experiments.sweeps.policy_store import PolicyStore
from experiments.sweeps.specification import read_specification
from experiments.sweeps.trial_stream import TrialStream
from experiments.worker_pool import WorkerPool
from models.scenario import dump_scenario
from tests.experiments.sweeps.conftest import rows_in
from tests.experiments.sweeps.made_up_rows import made_up_row

ROWS = 2_000
PUSH = {"make": "tests.experiments.sweeps.pushes:push"}


class ReadyRows:
    """Yields rows that nobody has simulated, as a `WorkerPool` yields results."""

    workers = 2

    def __init__(self, scenario):
        self._scenario = scenario
        self.sizes = {}

    def run(self, tasks):
        for task in tasks:
            self.sizes.setdefault((task.source.name, task.source.engine), []).append(len(task.numbers))
            yield [(task.block, n, made_up_row(n, scenario=self._scenario)) for n in task.numbers]


@pytest.mark.slow
def test_thousands_of_rows_take_no_memory_that_grows(specification, skill_file, tmp_path, monkeypatch):
    path = specification(policies={"mine": {"skill": str(skill_file)}}, trials={"number": ROWS})
    wanted = read_specification(path)
    todo = [(a, block, len(block.numbers)) for a in assignments(wanted, tmp_path, "sweep") for block in a.blocks]
    executor = ReadyRows(dump_scenario(wanted.scenario))
    monkeypatch.setattr(trial_stream, "WRITE_PERIOD", 0.05)
    count, early = itertools.count(1), []

    def advance(note):
        if next(count) == ROWS // 5:
            early.append(tracemalloc.get_traced_memory()[0])

    tracemalloc.start()
    try:
        ended = TrialStream(todo, PolicyStore(tmp_path), executor, advance).run()
        late = tracemalloc.get_traced_memory()[0]
    finally:
        tracemalloc.stop()
    assert ended.written == ROWS
    assert late - early[0] < 2e6  # bytes; all rows together have 7e6
    rows = rows_in(tmp_path)
    assert sorted(rows.trial) == list(range(ROWS))
    assert rows.key.is_unique


def test_only_trials_of_the_compiled_loop_share_a_task(specification, skill_file, tmp_path):
    policies = {"mine": {"skill": str(skill_file)}, "push": PUSH | {"trials": 3}}
    wanted = read_specification(specification(policies=policies, engines=["exact", "drake"], trials={"number": 70}))
    todo = [(a, block, len(block.numbers)) for a in assignments(wanted, tmp_path, "sweep") for block in a.blocks]
    store, pool = PolicyStore(tmp_path), ReadyRows(dump_scenario(wanted.scenario))
    with WorkerPool(1) as workers:
        store.make([a.policy for a, _, _ in todo if a.policy.given is None], workers, lambda _: None)
    assert TrialStream(todo, store, pool, lambda _: None).run().written == 2 * (70 + 3)
    assert pool.sizes["mine", "exact"] == [17, 17, 17, 17, 2]  # two batches for each of two workers, and the rest
    assert pool.sizes["mine", "drake"] == [1] * 70
    assert pool.sizes["push", "exact"] == pool.sizes["push", "drake"] == [1] * 3


def test_a_block_that_cannot_be_written_costs_no_rows_of_others(specification, tmp_path, monkeypatch):
    path = specification(policies={"push": PUSH}, vary={"contact.friction": [0.1, 0.2, 0.3]}, trials={"number": 2})
    wanted = read_specification(path)
    todo = [(a, block, len(block.numbers)) for a in assignments(wanted, tmp_path, "sweep") for block in a.blocks]
    unwritable = todo[0][1].path
    monkeypatch.setattr(trial_stream, "WRITE_PERIOD", 1000.0)  # all rows are written at the end
    real = result_blocks.write_atomically

    def write(path, data):
        if path == unwritable:
            raise OSError(28, "No space left on device")
        real(path, data)

    monkeypatch.setattr(result_blocks, "write_atomically", write)
    store = PolicyStore(tmp_path)
    with make_pool("local", jobs=1) as executor:
        store.make([assignment.policy for assignment, _, _ in todo], executor, lambda note: None)
    stream = TrialStream(todo, store, ReadyRows(dump_scenario(wanted.scenario)), lambda note: None)
    with pytest.raises(OSError, match=rf"{unwritable}: not written \(No space left"):
        stream.run()
    assert len(rows_in(tmp_path)) == stream.ended.written == 4


@pytest.mark.nightly
@pytest.mark.parametrize("path", sorted(Path("benchmarks/sweeps").glob("*.yaml")), ids=lambda path: path.stem)
def test_the_sweeps_of_this_project_can_be_planned(path, tmp_path):
    found = assignments(read_specification(path), tmp_path, "sweep")
    assert sum(len(block.numbers) for assignment in found for block in assignment.blocks) >= 100
