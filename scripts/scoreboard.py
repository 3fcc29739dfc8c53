"""Makes the scoreboard of the trials that `haptic-skill sweep` stored, without Drake."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from scripts.command_line import command, make_app
from scripts.options import parse_path, parse_text

app = make_app()


@app.command()
@command
def main(
    results: Annotated[
        Path,
        typer.Argument(
            parser=parse_path, metavar="RESULTS", help="Folder that `haptic-skill sweep` wrote.", show_default=False
        ),
    ],
    out: Annotated[
        Path,
        typer.Option(parser=parse_path, metavar="FILE", help="HTML page to write; replaces an existing page."),
    ] = Path("scoreboard.html"),
    markdown: Annotated[
        Path | None,
        typer.Option(
            parser=parse_path,
            metavar="FILE",
            help="File for the same tables in Markdown; replaces an existing scoreboard.",
            show_default="none",
        ),
    ] = None,
    against: Annotated[
        str | None,
        typer.Option(
            parser=parse_text,
            metavar="NAME",
            help="Policy with which the others are compared.",
            show_default="the skill of this project if it is there, else the one that inserts most often",
        ),
    ] = None,
) -> None:
    """Compares the policies of a sweep: who inserts, how fast, how gently, and at what cost.

    Reads the trials that `haptic-skill sweep` stored. Writes one page with a table for each arm, engine and choice of
    factors, and curves over every factor with three values or more. Each number links the files of its trials and
    tells the command that recomputes it. The page needs neither a network nor this program.

    Insertions have 95 % intervals. Each policy is compared with one reference in the trials that both performed: by
    the exact McNemar test for the insertions and a sign-flip test for the times, corrected by Holm's method over the
    rows of a table. Only trials of the newest code are shown, and of a policy that was made anew only the newest; the
    page says how many others there are. The results are never changed.

    For example (in a checkout also `python -m scripts.scoreboard`):

        haptic-skill scoreboard out/results --out scoreboard.html

        haptic-skill scoreboard out/results --against "straight push" --markdown docs/scoreboard.md
    """
    from scripts.scoreboard_session import write_scoreboard

    write_scoreboard(results, out=out, markdown=markdown, against=against)


if __name__ == "__main__":
    app()
