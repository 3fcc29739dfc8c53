"""The parts of a command line that all benchmarks share."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer

from experiments.machine_speed import machine_speed
from interfaces.terminal import report_errors, say, write_json

JsonFile = Annotated[Path | None, typer.Option("--json", metavar="FILE", help="Also write the results to this file.")]


def run(main: Callable[..., None]) -> None:
    """Runs a benchmark with the command line of its function; its help begins with the docstring of the module."""
    app = typer.Typer(
        add_completion=False,
        rich_markup_mode=None,
        context_settings={"help_option_names": ["-h", "--help"]},
        pretty_exceptions_show_locals=False,
    )
    # After "\b" a paragraph keeps its line breaks.
    paragraphs = str(sys.modules[main.__module__].__doc__).strip().split("\n\n")
    app.command(help="\n\n".join(f"\b\n{paragraph}" for paragraph in paragraphs))(report_errors(main))
    app()


def finish(results: dict[str, Any], json: Path | None) -> None:
    """Prints the machine's own speed, and writes the results with it (key ``machine_speed``, ms) if there is a file."""
    speed = machine_speed()
    say(f"reference loop: {speed:.0f} ms")
    if json is not None:
        write_json(json, {**results, "machine_speed": speed})
