"""The fuzz test itself: that it is repeatable, that it finds defects, and that the files have none."""

import os
import signal
import time
from random import Random

import pytest

from skill.data import tables
from skill.data.demonstration import read_demonstration
from skill.data.sealed_file import is_sealed
from skill.manipulation_skill import ManipulationSkill
from skill.policy import Action
from tests import fuzz
from tests import fuzz_mutations as mutations

NUMBER = 500


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fuzz")
    fuzz.write_originals(folder)
    return folder


@pytest.fixture(scope="module")
def trials():
    return list(fuzz.run(list(range(NUMBER)), seed=1, jobs=1))


def defects(trials, kinds):
    return [t for t in trials if t.kind in kinds and t.outcome not in fuzz.GOOD]


@pytest.mark.nightly
@pytest.mark.slow
def test_no_change_of_a_file_is_a_defect(trials):
    assert sorted(t.number for t in trials) == list(range(NUMBER))
    assert defects(trials, set(fuzz.KINDS) - {"scenario.yaml"}) == []


@pytest.mark.nightly
@pytest.mark.slow
def test_no_change_of_a_scenario_is_a_defect(trials):
    assert defects(trials, {"scenario.yaml"}) == []


def silent_changes(folder, kind, number=150):
    original, held = fuzz.originals(folder)[kind]
    path = folder / "work"
    outcomes = []
    for k in range(number):
        changed = mutations.flip_bit(original, Random(k))
        outcomes.append(fuzz.judge(kind, original, held, changed, path, sealed=True)[0])
    path.unlink()
    return outcomes.count("silent change")


@pytest.mark.nightly
@pytest.mark.slow
def test_without_the_digest_it_finds_silent_changes(folder, monkeypatch):
    assert silent_changes(folder, "recording.parquet") == 0
    monkeypatch.setattr(tables, "is_sealed", lambda data: True)
    assert silent_changes(folder, "recording.parquet") > 0


@pytest.mark.nightly
@pytest.mark.slow
def test_without_the_checksums_of_pages_either_numbers_change_silently(folder, monkeypatch):
    monkeypatch.setattr(tables, "is_sealed", lambda data: True)
    monkeypatch.setattr(tables.pq.ParquetFile, "__init__", unchecked(tables.pq.ParquetFile.__init__))
    assert silent_changes(folder, "recording.parquet") > 10


def unchecked(init):
    return lambda self, source, **options: init(self, source)


def judged(folder, monkeypatch, read, kind="recording.parquet"):
    """The outcome of a file that is read by ``read``."""
    original, held = fuzz.originals(folder)[kind]
    monkeypatch.setattr(fuzz, "read_demonstration", read)
    outcome, _ = fuzz.judge(kind, original, held, b"changed", folder / "work", sealed=True)
    (folder / "work").unlink()
    return outcome


def raises(error):
    def read(path):
        raise error

    return read


def takes_memory(path):
    raise ValueError(f"{path}: {len(bytearray(200_000_000))}")


def test_each_kind_of_defect_is_found(folder, monkeypatch):
    other = read_demonstration(folder / "recording.parquet")
    other.samples.loc[3, "fx"] += 1e-12
    assert judged(folder, monkeypatch, lambda path: other) == "silent change"
    assert judged(folder, monkeypatch, raises(TypeError("no"))) == "exception"
    assert judged(folder, monkeypatch, raises(SystemExit(1))) == "exception"
    assert judged(folder, monkeypatch, raises(ValueError("without a name"))) == "message"
    assert judged(folder, monkeypatch, raises(ValueError(f"{folder / 'work'}: two\nlines"))) == "message"
    assert judged(folder, monkeypatch, raises(ValueError(f"{folder / 'work'}: bad"))) == "refused"
    monkeypatch.setattr(fuzz, "MAX_TIME", 0.01)
    assert judged(folder, monkeypatch, lambda path: time.sleep(0.02)) == "time"


def test_a_reader_that_takes_too_much_memory_is_a_defect(folder, monkeypatch):
    monkeypatch.setattr(fuzz, "MAX_MEMORY", 1e8)
    assert judged(folder, monkeypatch, takes_memory) == "memory"


def test_a_skill_that_acts_by_nan_is_unsound(folder, monkeypatch):
    kind = "skill.npz"
    original, held = fuzz.originals(folder)[kind]
    broken = Action(turn=[float("nan"), 0.0], feed=0.0, probabilities=[1.0])
    monkeypatch.setattr(ManipulationSkill, "act", lambda self, measured: broken)
    assert fuzz.judge(kind, original, held + b"x", original, folder / "work", sealed=False)[0] == "unsound"


def crashes(number, seed, folder):
    """Stands in for `fuzz.attempt` in a process that is forked: it crashes, hangs, or does nothing."""
    if number == 1:
        os.kill(os.getpid(), signal.SIGKILL)
    if number == 3:
        time.sleep(60.0)
    return fuzz.Trial(number, "run.parquet", "none", "refused")


@pytest.mark.nightly
@pytest.mark.slow
def test_a_process_that_crashes_or_hangs_is_a_defect_and_the_others_go_on(monkeypatch):
    monkeypatch.setattr(fuzz, "attempt", crashes)
    monkeypatch.setattr(fuzz, "PATIENCE", 1.0)
    trials = sorted(fuzz.run(list(range(5)), seed=0, jobs=1, method="fork"), key=lambda t: t.number)
    assert [t.outcome for t in trials] == ["refused", "crash", "refused", "time", "refused"]
    assert "crash: number 1, run.parquet" in fuzz.report(trials)
    assert "5 mutations, 2 defects" in fuzz.report(trials)


def test_a_mutation_is_always_the_same(folder):
    for number in range(40):
        kind = fuzz.KINDS[number % len(fuzz.KINDS)]
        original, _ = fuzz.originals(folder)[kind]
        made = [fuzz.mutation_of(kind, rng)(original, rng) for rng in (Random(number), Random(number))]
        assert made[0] == made[1]


@pytest.mark.parametrize("mutation", mutations.BYTES)
def test_mutations_of_bytes_change_them(mutation):
    data = bytes(range(256)) * 40
    changed = [mutation(data, Random(k)) for k in range(20)]
    assert sum(c != data for c in changed) > 12
    assert len(set(changed)) > 10


@pytest.mark.parametrize("kind", fuzz.SEALED)
def test_forged_files_carry_a_digest_that_fits(folder, kind):
    original, _ = fuzz.originals(folder)[kind]
    for mutation in fuzz.FORGERIES[kind]:
        made = [mutation(original, Random(k)) for k in range(3)]
        assert all(is_sealed(data) for data in made)
        assert any(data != original for data in made)
