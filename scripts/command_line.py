"""The parts that all commands share: the application and the error path.

A command imports what it needs when it runs. So help and `replay` start quickly, and work where Drake is not installed.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, ParamSpec, TypeVar

import typer

P = ParamSpec("P")
R = TypeVar("R")


def make_app(**settings: Any) -> typer.Typer:
    """A Typer application with the settings of all commands; ``settings`` adds to them."""
    return typer.Typer(
        add_completion=False,
        rich_markup_mode="markdown",
        context_settings={"help_option_names": ["-h", "--help"]},
        pretty_exceptions_show_locals=False,
        **settings,
    )


def command(function: Callable[P, R]) -> Callable[P, R]:
    """Decorates the function of a command with the error path of `interfaces.terminal.report_errors`."""

    @wraps(function)
    def reporting(*args: P.args, **kwargs: P.kwargs) -> R:
        from interfaces.terminal import report_errors

        return report_errors(function)(*args, **kwargs)

    return reporting
