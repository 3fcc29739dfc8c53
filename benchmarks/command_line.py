"""The parts of a command line that all benchmarks share."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path

import typer

from interfaces.terminal import report_errors


def argument_parser(description: str | None) -> argparse.ArgumentParser:
    """A parser with the option ``--json`` whose help is ``description``, the docstring of the benchmark."""
    parser = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the results to this file")
    return parser


def add_demonstrations(parser: argparse.ArgumentParser) -> None:
    """Adds the option ``--demonstrations``: folders of recorded sets, by default the one that the demo leaves."""
    parser.add_argument(
        "--demonstrations",
        type=Path,
        nargs="+",
        default=[Path("out/demonstrations")],
        metavar="FOLDER",
        help="recorded sets",
    )


def run(main: Callable[[], None]) -> None:
    """Runs a benchmark; a ValueError or an OSError ends the process with one message and exit code 1."""
    try:
        report_errors(main)()
    except typer.Exit as end:
        sys.exit(end.exit_code)
