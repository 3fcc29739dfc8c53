"""A short form of the kill campaign, and the faults that it finds."""

import pytest

from experiments.outputs.output_set import DEMONSTRATIONS, SetIndex
from skill.data.demonstration import write_demonstration
from tests.campaign import LANES, RecordLane, run
from tests.trajectories import make_demonstration


@pytest.mark.nightly
@pytest.mark.slow
def test_twelve_kills_lose_nothing():
    counts, faults = run(number=12, seed=1, jobs=1)
    assert faults == []
    for lane in LANES:
        assert sum(n for what, n in counts.items() if what.startswith(f"{lane.name}, killed")) == 3
        assert counts[f"{lane.name}, completed"] >= 1


@pytest.fixture
def lane(tmp_path):
    """A lane with two finished demonstrations of its first set of three."""
    lane = RecordLane(tmp_path)
    SetIndex(DEMONSTRATIONS, {"seed": 0}, tuple(f"00{k}_good_a.parquet" for k in range(3))).write(lane.folder)
    for k in range(2):
        write_demonstration(make_demonstration(), lane.folder / f"00{k}_good_a.parquet")
    assert lane.faults(completed=False) == []
    assert len(lane.known) == 2
    return lane


def test_a_lost_or_damaged_demonstration_is_a_fault(lane):
    path = lane.folder / "001_good_a.parquet"
    data = path.read_bytes()
    path.unlink()
    assert lane.faults(completed=False) == ["lost or made again: ['001_good_a.parquet']"]
    path.write_bytes(data[:-50])
    with pytest.raises(ValueError, match="001_good_a"):
        lane.faults(completed=False)


def test_what_is_missing_or_left_over_at_the_end_and_a_mixture_of_two_sets_are_faults(lane):
    (lane.folder / ".left").touch()
    assert lane.faults(completed=True) == ["complete: False, not in the index: ['.left']"]
    (lane.folder / ".left").unlink()
    write_demonstration(make_demonstration(), lane.folder / "002_good_a.parquet")
    assert lane.faults(completed=True) == []
    assert (lane.round, len(lane.old), lane.known) == (1, 3, {})
    (lane.folder / "000_good_a.parquet").unlink()
    assert lane.faults(completed=False) == ["the old set is not whole"]
