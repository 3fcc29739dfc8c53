"""What a sweep learns from is recorded once, and what it has made is kept."""

import pytest

from experiments.sweep.cells import DemonstrationSet
from experiments.sweep.policy_store import PolicyStore
from models.scenario import load_scenario
from skill.data.demonstration import read_demonstrations


class ReadyDemonstrations:
    """Yields demonstrations that are there already, as a `WorkerPool` yields results."""

    def __init__(self, demonstration):
        self._demonstration = demonstration

    def run(self, tasks):
        for task in tasks:
            shown, request, _ = task.args
            yield shown, request, self._demonstration


def test_only_missing_demonstrations_are_recorded(demonstration_folder, tmp_path):
    store, ready = PolicyStore(tmp_path), ReadyDemonstrations(read_demonstrations(demonstration_folder)[0])
    sets = [DemonstrationSet(load_scenario(), good=2, bad=1, seed=seed) for seed in range(2)]
    assert store.unrecorded(sets) == 6
    store.record(sets[:1], ready, lambda note: None)
    assert store.unrecorded(sets) == 3
    notes = []
    store.record(sets, ready, notes.append)
    assert store.unrecorded(sets) == 0
    assert [note.partition(",")[0] for note in notes] == ["set 1"] * 3


@pytest.mark.parametrize(("size", "names"), [(None, 6), (3, ["000_good", "001_good", "004_bad"]), (1, ["000_good"])])
def test_a_smaller_set_has_the_first_of_each_outcome_in_proportion(size, names):
    found = [request.file_name for request in DemonstrationSet(load_scenario(), good=4, bad=2, seed=0).first(size)]
    if size is None:
        assert len(found) == names
    else:
        assert ["_".join(name.split("_")[:2]) for name in found] == names
