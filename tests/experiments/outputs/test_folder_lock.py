"""Locks between sessions, in processes of their own."""

import os
import signal
import subprocess
import sys

import pytest

from experiments.outputs.folder_lock import LOCK_NAME, locked_file, locked_folder
from tests.scripts.commands import ROOT

HOLD = """
import sys, time
from pathlib import Path
from experiments.outputs.folder_lock import locked_folder
with locked_folder(Path(sys.argv[1])):
    print("held", flush=True)
    time.sleep(60)
"""


@pytest.fixture
def holder(tmp_path):
    """A process that holds the folder ``tmp_path / "out"``."""
    command = [sys.executable, "-c", HOLD, str(tmp_path / "out")]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout.readline() == "held\n"
        yield process
        process.kill()


def test_the_second_process_is_told_who_holds_the_folder(tmp_path, holder):
    expected = rf"out: process {holder.pid} \(-c, since 2.*\) writes here; wait for it"
    with pytest.raises(OSError, match=expected), locked_folder(tmp_path / "out"):
        pytest.fail("two processes hold the folder")
    (tmp_path / "out" / LOCK_NAME).write_text("")  # damaged
    with pytest.raises(OSError, match="out: another process writes here"), locked_folder(tmp_path / "out"):
        pytest.fail("two processes hold the folder")
    assert holder.poll() is None


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT])
def test_a_process_that_ended_does_not_block(tmp_path, holder, number):
    holder.send_signal(number)
    holder.wait()
    with locked_folder(tmp_path / "out"):
        assert f"process {os.getpid()} " in (tmp_path / "out" / LOCK_NAME).read_text()
    assert not (tmp_path / "out").exists() or list((tmp_path / "out").iterdir()) == []


def test_a_lock_is_released_after_an_exception_and_may_be_nested(tmp_path):
    def fail():
        with locked_folder(tmp_path / "out"):
            with locked_folder(tmp_path / "out"):
                pass
            command = [sys.executable, "-c", HOLD, str(tmp_path / "out")]
            other = subprocess.run(command, cwd=ROOT, capture_output=True, check=False)
            assert b"writes here" in other.stderr  # the inner lock has not released the outer one
            raise KeyboardInterrupt

    for _ in range(2):
        with pytest.raises(KeyboardInterrupt):
            fail()
        assert list(tmp_path.iterdir()) == []


def test_files_of_one_folder_have_locks_of_their_own(tmp_path):
    with locked_file(tmp_path / "a.npz"), locked_file(tmp_path / "b.npz"), locked_folder(tmp_path):
        assert sorted(p.name for p in tmp_path.iterdir()) == [".a.npz.lock", ".b.npz.lock", LOCK_NAME]
    assert list(tmp_path.iterdir()) == []


def test_a_link_in_the_place_of_the_lock_is_named_and_stays(tmp_path):
    (tmp_path / "outside.txt").write_text("mine")
    (tmp_path / LOCK_NAME).symlink_to(tmp_path / "outside.txt")
    with pytest.raises(OSError, match=rf"{LOCK_NAME}: the lock cannot be taken"), locked_folder(tmp_path):
        pytest.fail("the lock was taken")
    assert (tmp_path / LOCK_NAME).is_symlink()
    assert (tmp_path / "outside.txt").read_text() == "mine"


@pytest.mark.slow
def test_processes_that_take_turns_never_hold_the_folder_together(tmp_path):
    """A process may open the lock file just before its holder removes it, and must not take it for the lock."""
    code = """
import sys, time
from pathlib import Path
from experiments.outputs.folder_lock import locked_folder
folder, turns = Path(sys.argv[1]), 0
end = time.monotonic() + 0.7
while time.monotonic() < end:
    try:
        with locked_folder(folder):
            (folder / "inside").touch(exist_ok=False)
            turns += 1
            (folder / "inside").unlink()
    except OSError as error:
        if "writes here" not in str(error):
            raise
print(turns)
"""
    (tmp_path / "other").touch()  # so that the folder stays
    command = [sys.executable, "-c", code, str(tmp_path)]
    processes = [subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True) for _ in range(3)]
    turns = [int(process.communicate()[0] or -1) for process in processes]
    assert [process.returncode for process in processes] == [0, 0, 0]
    assert min(turns) > 0
    assert [path.name for path in tmp_path.iterdir()] == ["other"]
