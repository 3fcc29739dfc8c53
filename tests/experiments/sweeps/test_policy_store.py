"""What a sweep learns from is recorded in portions, so that two sweeps can share the work."""

import pytest

from experiments.outputs.folder_lock import BusyError
from experiments.sweeps import policy_store
from experiments.sweeps.assignments import DemonstrationSource
from experiments.sweeps.policy_store import PolicyStore
from models.scenario import load_scenario
from skill.data.demonstration import read_demonstrations


class ReadyDemonstrations:
    """Yields demonstrations that are there already, as an `Executor` yields results."""

    workers = 1

    def __init__(self, demonstration):
        self._demonstration = demonstration
        self.portions = []

    def run(self, tasks):
        tasks = list(tasks)
        self.portions.append(len(tasks))
        for task in tasks:
            yield task.source, task.request, self._demonstration


@pytest.fixture
def ready(demonstration_folder):
    return ReadyDemonstrations(read_demonstrations(demonstration_folder)[0])


@pytest.fixture
def sets():
    return [DemonstrationSource(load_scenario(), good=2, bad=1, seed=seed) for seed in range(4)]


@pytest.mark.parametrize(("limits", "portions"), [({"TASKS_HELD": 4}, [6, 6]), ({"SETS_HELD": 3}, [9, 3])])
def test_sets_are_held_in_portions(ready, sets, tmp_path, monkeypatch, limits, portions):
    for name, limit in limits.items():
        monkeypatch.setattr(policy_store, name, limit)
    notes = []
    PolicyStore(tmp_path).record(sets, ready, notes.append)
    assert ready.portions == portions
    assert len(notes) == 12
    assert PolicyStore(tmp_path).unrecorded(sets) == 0


def test_sets_of_another_sweep_are_left_to_the_end(ready, sets, tmp_path, monkeypatch):
    monkeypatch.setattr(policy_store, "SETS_HELD", 1)
    store, real = PolicyStore(tmp_path), policy_store.open_set
    busy, unrecorded = {store.folder(sets[0])}, []

    def open_as_another_process_sees_it(folder, *arguments, **options):
        if folder in busy:
            raise BusyError("held")
        return real(folder, *arguments, **options)

    def wait(_):
        unrecorded.append(store.unrecorded(sets))
        busy.clear()

    monkeypatch.setattr(policy_store, "open_set", open_as_another_process_sees_it)
    monkeypatch.setattr(policy_store.time, "sleep", wait)
    store.record(sets, ready, lambda note: None)
    assert unrecorded == [3]  # all others were recorded before
    assert store.unrecorded(sets) == 0
