"""The fuzz test itself: that it is repeatable, that it finds defects, and that the files have none."""

import os
import signal
import time
from random import Random

import pytest

from skill.data import tables
from skill.data.demonstration import read_demonstration
from skill.data.files import check_seal
from tests import fuzz
from tests import fuzz_mutations as mutations

RECORDING = "recording.parquet"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fuzz")
    fuzz.write_originals(folder)
    return folder


@pytest.mark.nightly
@pytest.mark.slow
def test_no_change_of_a_file_is_a_defect():
    trials = list(fuzz.run(list(range(500)), seed=1, jobs=1))
    assert [t.number for t in trials] == list(range(500))
    assert [t for t in trials if t.outcome not in fuzz.GOOD] == []


@pytest.mark.slow
def test_without_the_digest_it_finds_silent_changes(folder, monkeypatch):
    original, held = fuzz.originals(folder)[RECORDING]

    def outcomes():
        flipped = [mutations.flip_bit(original, Random(k)) for k in range(60)]
        return [fuzz.judge(RECORDING, original, held, data, folder / "work", sealed=True)[0] for data in flipped]

    assert "silent change" not in outcomes()
    monkeypatch.setattr(tables, "check_seal", lambda data, required: None)
    assert "silent change" in outcomes()


def judged(folder, monkeypatch, read):
    """The outcome of a recording that is read by ``read``."""
    original, held = fuzz.originals(folder)[RECORDING]
    monkeypatch.setattr(fuzz, "read_demonstration", read)
    return fuzz.judge(RECORDING, original, held, b"changed", folder / "work", sealed=True)[0]


def raises(error):
    def read(path):
        raise error

    return read


def takes_memory(path):
    raise ValueError(f"{path}: {len(bytearray(200_000_000))}")


def test_each_kind_of_defect_is_found(folder, monkeypatch):
    other = read_demonstration(folder / RECORDING)
    other.samples.loc[3, "fx"] += 1e-12
    assert judged(folder, monkeypatch, lambda path: other) == "silent change"
    assert judged(folder, monkeypatch, raises(TypeError("no"))) == "exception"
    assert judged(folder, monkeypatch, raises(SystemExit(1))) == "exception"
    assert judged(folder, monkeypatch, raises(ValueError("without a name"))) == "message"
    assert judged(folder, monkeypatch, raises(ValueError(f"{folder / 'work'}: two\nlines"))) == "message"
    assert judged(folder, monkeypatch, raises(ValueError(f"{folder / 'work'}: bad"))) == "refused"
    monkeypatch.setattr(fuzz, "MAX_MEMORY", 1e8)
    assert judged(folder, monkeypatch, takes_memory) == "memory"
    monkeypatch.setattr(fuzz, "MAX_TIME", 0.01)
    assert judged(folder, monkeypatch, lambda path: time.sleep(0.02)) == "time"


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
    trials = list(fuzz.run(list(range(5)), seed=0, jobs=1, method="fork"))
    assert [t.outcome for t in trials] == ["refused", "crash", "refused", "time", "refused"]
    assert "crash: number 1, run.parquet" in fuzz.report(trials)
    assert "5 mutations, 2 defects" in fuzz.report(trials)


def test_a_mutation_is_always_the_same(folder):
    for number in range(40):
        kind = fuzz.KINDS[number % len(fuzz.KINDS)]
        original, _ = fuzz.originals(folder)[kind]
        made = [fuzz.mutation_of(kind, rng)(original, rng) for rng in (Random(number), Random(number))]
        assert made[0] == made[1]


@pytest.mark.parametrize("kind", fuzz.SEALED)
def test_forged_files_carry_a_digest_that_fits(folder, kind):
    original, _ = fuzz.originals(folder)[kind]
    for mutation in fuzz.FORGERIES[kind]:
        made = [mutation(original, Random(k)) for k in range(3)]
        for data in made:
            check_seal(data)  # raises no error
        assert any(data != original for data in made)
