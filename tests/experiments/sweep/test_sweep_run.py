"""The trials of a sweep: what is kept in memory, what is written, and what is lost with a worker."""

from pathlib import Path

import pytest

from experiments.sweep import cell_files, sweep_run
from experiments.sweep.cell_files import files_of
from experiments.sweep.cells import cells_of
from experiments.sweep.policy_store import PolicyStore
from experiments.sweep.specification import read_specification
from experiments.sweep.sweep_run import SweepRun
from experiments.worker_pool import local_pool
from tests.experiments.sweep.conftest import rows_in
from tests.experiments.sweep.made_up_rows import made_up_row

PUSH = {"make": "tests.experiments.sweep.pushes:push"}


class ReadyRows:
    """Yields rows that nobody has simulated, as a `WorkerPool` yields results."""

    def run(self, tasks):
        for task in tasks:
            place = task.args[0]
            yield place, made_up_row(place[1])


def planned(path, folder):
    found = cells_of(read_specification(path), "sweep")
    todo = [file for cell in found for file in files_of(cell, folder)]
    store = PolicyStore(folder)
    store.make({cell.recipe.digest: cell.recipe for cell in found}.values(), local_pool(1), lambda _: None)
    return todo, store


def test_a_file_that_cannot_be_written_costs_no_rows_of_others(specification, tmp_path, monkeypatch):
    path = specification(policies={"push": PUSH}, vary={"contact.friction": [0.1, 0.2, 0.3]}, trials={"number": 2})
    todo, store = planned(path, tmp_path)
    unwritable = todo[0].path
    monkeypatch.setattr(sweep_run, "WRITE_PERIOD", 1000.0)  # all rows are written at the end
    real = cell_files.write_atomically

    def write(path, data):
        if path == unwritable:
            raise OSError(28, "No space left on device")
        real(path, data)

    monkeypatch.setattr(cell_files, "write_atomically", write)
    run = SweepRun(todo, store, ReadyRows(), lambda note: None)
    with pytest.raises(OSError, match=rf"{unwritable}: not written \(No space left"):
        run.run()
    assert len(rows_in(tmp_path)) == run.written == 4


@pytest.mark.nightly
@pytest.mark.parametrize("path", sorted(Path("benchmarks/sweeps").glob("*.yaml")), ids=lambda path: path.stem)
def test_the_sweeps_of_this_project_can_be_planned(path):
    assert sum(len(cell.numbers) for cell in cells_of(read_specification(path), "sweep")) >= 100
