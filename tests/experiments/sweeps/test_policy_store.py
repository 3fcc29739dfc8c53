"""What a sweep learns from is recorded in portions, so that two sweeps can share the work."""

import pytest

from experiments.outputs.folder_lock import BusyError
from experiments.sweeps import policy_store
from experiments.sweeps.assignments import DemonstrationSource
from experiments.sweeps.policies import GivenSkill
from experiments.sweeps.policy_store import PolicyStore
from models.scenario import load_scenario
from skill.data.demonstration import read_demonstrations
from skill.manipulation_skill import ManipulationSkill


class ReadyDemonstrations:
    """Yields demonstrations that are there already, as a `WorkerPool` yields results."""

    def __init__(self, demonstration):
        self._demonstration = demonstration

    def run(self, tasks):
        for task in tasks:
            source, request, _ = task.args
            yield source, request, self._demonstration


@pytest.fixture
def ready(demonstration_folder):
    return ReadyDemonstrations(read_demonstrations(demonstration_folder)[0])


@pytest.fixture
def sets():
    return [DemonstrationSource(load_scenario(), good=2, bad=1, seed=seed) for seed in range(4)]


def test_sets_of_another_sweep_are_left_to_the_end(ready, sets, tmp_path, monkeypatch):
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


def test_a_skill_file_that_changes_while_the_sweep_runs_is_refused(skill_file, tmp_path):
    own = tmp_path / "own.npz"
    own.write_bytes(skill_file.read_bytes())
    given = GivenSkill.read(own)
    skill = ManipulationSkill.load(own)
    skill.name_states([f"state {k}" for k in range(skill.n_states)])
    skill.save(own)
    with pytest.raises(ValueError, match="changed since the sweep began"):
        given.load()
