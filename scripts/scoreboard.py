"""Makes the scoreboard of the trials that `haptic-skill sweep` stored, without Drake."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from scripts.command_line import parse_path, path_option, text_option

MAX_PRINTED = 12
"""Largest number of tables at the terminal."""


def main(
    results: Annotated[
        Path,
        typer.Argument(
            parser=parse_path, metavar="RESULTS", help="Folder that `haptic-skill sweep` wrote.", show_default=False
        ),
    ],
    out: Annotated[
        Path | None,
        path_option("FILE", "HTML page to write; replaces an existing page.", shown="scoreboard.html in RESULTS"),
    ] = None,
    against: Annotated[
        str | None,
        text_option(
            "NAME",
            "Policy with which the others are compared.",
            shown="the skill of this project if it is there, else the one that inserts most often",
        ),
    ] = None,
) -> None:
    """Compares the policies of a sweep: who inserts, how fast, how gently, and at what cost.

    Reads the trials that `haptic-skill sweep` stored. Writes one page with a table for each set of trials, engine and
    choice of factors, and curves over every factor with three values or more. Each policy links the files of its
    trials, and each row has commands that recompute it. The page needs neither a network nor this program.

    Insertions have 95 % intervals over sets of demonstrations. Each policy is compared with one reference in the trials
    that both performed: the signs of the mean differences of the sets are flipped, and p-values corrected by Holm's
    method over the rows of a table. Fewer than six sets have no p-value, but their differences are shown. Only trials
    of the newest code are shown, and of a policy that was made anew only the newest; the page says how many others
    there are. The rows are never changed.

    For example:

        haptic-skill scoreboard out/results

        haptic-skill scoreboard out/results --against "straight push"
    """
    from experiments.outputs.folder_lock import locked_file
    from experiments.outputs.output_checks import REPORT_SIZE, check_file, named_errors
    from experiments.scoreboard.result_store import read_trials, trial_files
    from experiments.scoreboard.summary import make_scoreboard
    from interfaces.reports.result_tables import scoreboard_table
    from interfaces.reports.scoreboard_page import scoreboard_page, warnings
    from interfaces.terminal import busy, progress, say, show
    from skill.data.files import write_atomically

    out = out or results / "scoreboard.html"
    files = trial_files(results)
    check_file(out, ".html", size=REPORT_SIZE)
    with progress("reading trials", len(files)) as advance:
        found = read_trials(results, advance)
    with busy(f"comparing {len(found.table):,} trials"):
        board = make_scoreboard(found, against)
        page = scoreboard_page(board, out)
    with locked_file(out), named_errors(out, "the results are unchanged"):
        write_atomically(out, page.encode())
    for table in board.tables[:MAX_PRINTED]:
        show(scoreboard_table(table, board.reference))
    if len(board.tables) > MAX_PRINTED:
        say(f"{len(board.tables) - MAX_PRINTED} more tables are in the page")
    say("against, slower by: in the trials that a policy shares with the reference; p: Holm-corrected over a table")
    for text in warnings(board):
        say(f"note: {text}")
    say(f"scoreboard of {board.trials:,} trials, compared with {board.reference}")
    say(f"open {out}")
