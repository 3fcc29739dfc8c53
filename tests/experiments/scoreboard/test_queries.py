"""The one-line commands give the numbers of the table."""

import contextlib
import io
import shlex

import pytest

from experiments.scoreboard.queries import commands_of, paired_command, row_command, sweep_commands
from experiments.scoreboard.result_store import read_trials
from experiments.scoreboard.summary import make_scoreboard
from tests.experiments.scoreboard.simulated_trials import LEARNT, OTHER, write_results, write_trials


@pytest.fixture(scope="module")
def board(tmp_path_factory):
    folder = write_results(tmp_path_factory.mktemp("it's a <folder>"), engines=("drake", "exact"))
    old = [{"trial": k, "code": "0ld", "began": "2025-01-01T00:00:00+00:00"} for k in range(5)]
    write_trials(folder, old, policy=LEARNT, block="0001")
    before = {"skill": "before", "began": "2026-01-01T00:00:00+00:00"}  # the policy has been made anew since
    replaced = [{"trial": k, "demonstration_set": k % 4, "key": f"before/{k}", **before} for k in range(9)]
    write_trials(folder, replaced, policy=LEARNT, block="0002")
    return make_scoreboard(read_trials(folder))


def rows_of(board):
    return [(table.conditions, row) for table in board.tables for row in table.rows]


def computed(command):
    space = {}
    with contextlib.redirect_stdout(io.StringIO()) as text:
        exec(command, space)
    return space["r"], text.getvalue()


def test_the_command_of_a_row_gives_its_numbers(board):
    for conditions, row in rows_of(board):
        found, text = computed(row_command(board, row.summary.policy, conditions))
        assert "back-offs" in text
        assert found["trials"] == row.summary.trials
        for name, expected in row.summary.numbers.items():
            assert found[name] == pytest.approx(expected, rel=1e-9, nan_ok=True), (
                conditions.title,
                row.summary.policy,
                name,
            )


def test_the_command_of_the_pairs_gives_their_numbers(board):
    compared = 0
    for conditions, row in rows_of(board):
        if row.paired is None:
            continue
        found, _ = computed(paired_command(board, row.summary.policy, conditions))
        expected = [row.paired.pairs, row.paired.better, row.paired.worse, row.paired.slower]
        assert found.to_list() == pytest.approx(expected, rel=1e-9)
        compared += 1
    assert compared == 2 * 5 * 2


def test_the_commands_name_the_sweep_and_the_reference(board):
    conditions = board.tables[0].conditions
    commands = dict(commands_of(board, OTHER, conditions))
    assert commands["make the trials of Nominal trials"] == sweep_commands(board)[0]
    arguments = shlex.split(sweep_commands(board)[0])
    specification = board.folder / "sweeps" / "nominal.yaml"
    assert arguments == ["haptic-skill", "sweep", str(specification), "--out", str(board.folder)]
    assert f"pairs with {LEARNT}" in commands
    assert f"pairs with {LEARNT}" not in dict(commands_of(board, LEARNT, conditions))
    assert all("\n" not in command for command in commands.values())
