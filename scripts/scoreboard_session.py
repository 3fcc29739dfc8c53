"""Makes the scoreboard of a folder of results: the page, the tables in Markdown, and those at the terminal."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path

from experiments.outputs.folder_lock import locked_file
from experiments.outputs.output_checks import REPORT_SIZE, check_file, named_errors, require_distinct
from experiments.outputs.own_folder import remove_unfinished
from experiments.scoreboard.result_store import read_trials, trial_files
from experiments.scoreboard.summary import Scoreboard, make_scoreboard
from interfaces.reports.scoreboard_markdown import scoreboard_markdown
from interfaces.reports.scoreboard_page import scoreboard_page, warnings
from interfaces.reports.scoreboard_table import terminal_table
from interfaces.terminal import busy, console, progress, say
from skill.data.tables import write_atomically

MAX_PRINTED = 12
"""Largest number of tables at the terminal."""


def write_scoreboard(
    folder: Path, *, out: Path, markdown: Path | None = None, against: str | None = None
) -> Scoreboard:
    """Summarises the trials of a folder of results, writes page and Markdown, and prints the tables.

    Args:
        folder: that `haptic-skill sweep` wrote.
        out: page to write.
        markdown: file to write the tables into; None for none.
        against: name of the policy with which the others are compared; see `make_scoreboard`.

    Raises:
        ValueError: if the folder is missing, empty, foreign or damaged, or there is no such policy.
        OSError: if an output cannot be written.
    """
    files = trial_files(folder)
    outputs = {"--out": out} if markdown is None else {"--out": out, "--markdown": markdown}
    require_distinct(outputs)
    check_file(out, ".html", size=REPORT_SIZE)
    if markdown is not None:
        check_file(markdown, ".md", option="--markdown", size=REPORT_SIZE)
    with progress("reading trials", len(files)) as advance:
        found = read_trials(folder, advance)
    with busy(f"comparing {len(found.table):,} trials"):
        board = make_scoreboard(found, against)
        texts = {out: scoreboard_page(board, out)}
        if markdown is not None:
            texts[markdown] = scoreboard_markdown(board, markdown)
    with ExitStack() as locks:
        for path in texts:
            locks.enter_context(locked_file(path))
            remove_unfinished(path.parent, [path.name])
        for path, text in texts.items():
            with named_errors(path, "the results are unchanged"):
                write_atomically(path, text.encode())
    for table in board.tables[:MAX_PRINTED]:
        console.print(terminal_table(table, board))
    if len(board.tables) > MAX_PRINTED:
        say(f"{len(board.tables) - MAX_PRINTED} more tables are in the page")
    say("against, slower by: in the trials that a policy shares with the reference; p: Holm-corrected over a table")
    for text in warnings(board):
        say(f"note: {text}")
    say(f"scoreboard of {board.trials:,} trials, compared with {board.reference}, in {' and '.join(map(str, texts))}")
    return board
