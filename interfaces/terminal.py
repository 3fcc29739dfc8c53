"""Terminal output of the command lines: plain text, progress bars, JSON files and one-line errors.

Text from users (file names, names of states, messages) is printed as it stands: a ``[`` in it is not markup. Control
characters, which could change the terminal, are printed as escape sequences.
"""

from __future__ import annotations

import json
import os
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from pathlib import Path
from types import FrameType
from typing import Any, NoReturn, ParamSpec, TypeVar

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.status import Status
from rich.table import Table
from rich.text import Text

# What joblib says after an error about tasks that it has cancelled or whose results nobody takes.
warnings.filterwarnings(
    "ignore", message=r"\d+ tasks (which were still being processed|have been successfully executed)"
)

console = Console()
errors = Console(stderr=True)

_only_progress = False

FAILED, INTERRUPTED, TERMINATED = 1, 130, 143
"""Exit codes of a command that failed, or that Ctrl-C or SIGTERM ended. Wrong usage is 2, success 0."""

SPEED_PERIOD = 600.0
"""Time over which the speed of a progress bar is averaged, s."""

RESEND_TIME = 0.01
"""Time after which a signal that was lost in a destructor is sent again, s."""

EXTRAS = {
    **dict.fromkeys(("pydrake", "joblib", "tornado", "meshcat", "umsgpack"), "sim"),
    **{"matplotlib": "figures", "pyarrow": "data"},
    **{"cascadio": "cad", "trimesh": "cad"},
    **{"franky": "arm", "franky_sim": "arm", "rtde_control": "ur"},
    **{"distributed": "dask", "mcap": "recordings", "rosbags": "recordings"},
    "mujoco": "peers",
    **{"gymnasium": "gym", "lerobot": "lerobot", "stable_baselines3": "rl", "torch": "lerobot"},
}
"""The extra that installs a package, by the name of the package."""

P = ParamSpec("P")
R = TypeVar("R")


def report_errors(command: Callable[P, R]) -> Callable[P, R]:
    """Decorates a command: an expected error becomes one line on stderr and an exit code.

    - ValueError, OSError: ``error: ...``, exit code 1.
    - ModuleNotFoundError of a package in ``EXTRAS``: which extra to install, exit code 1.
    - KeyboardInterrupt (Ctrl-C): ``interrupted``, exit code 130; `Terminated` (SIGTERM): ``terminated``, 143.

    A warning becomes one line on stderr too.

    Other exceptions are defects of the program and keep their traceback.
    """

    @wraps(command)
    def reporting(*args: P.args, **kwargs: P.kwargs) -> R:
        try:
            with sigterm_raises(), interrupts_are_kept(), one_line_warnings():
                return command(*args, **kwargs)
        except (ValueError, OSError) as error:
            fail(str(error) or type(error).__name__)
        except (ImportError, SystemError) as error:
            reason = interrupt_behind(error)
            if reason is not None:
                interrupt(reason)
            fail_without_extra(error)
            raise
        except KeyboardInterrupt as reason:
            interrupt(reason)

    return reporting


def interrupt_behind(error: BaseException) -> KeyboardInterrupt | None:
    """Returns the interrupt that Drake's start or a compiled function has turned into another exception, if any."""
    cause = error.__cause__
    while not (cause is None or isinstance(cause, KeyboardInterrupt)):
        cause = cause.__cause__
    return cause


def fail_without_extra(error: BaseException) -> None:
    """Exits with code 1 and one line that names the extra, if an import did not find a package in ``EXTRAS``."""
    package = (error.name or "").split(".")[0] if isinstance(error, ImportError) else ""
    if package in EXTRAS:
        needed = "the simulation" if EXTRAS[package] == "sim" else f"the extra [{EXTRAS[package]}]"
        fail(f"this needs {needed}, but '{package}' is missing: install haptic-skill[{EXTRAS[package]}]")


class Terminated(KeyboardInterrupt):
    """SIGTERM has arrived; it ends a command as Ctrl-C does."""


@contextmanager
def sigterm_raises() -> Iterator[None]:
    """Raises `Terminated` in the main thread when SIGTERM arrives, so that locks and workers are released."""

    def handle(number: int, frame: FrameType | None) -> NoReturn:
        raise Terminated

    if threading.current_thread() is not threading.main_thread():
        yield  # only the main thread may set a handler
        return
    previous = signal.signal(signal.SIGTERM, handle)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, previous)


@contextmanager
def interrupts_are_kept() -> Iterator[None]:
    """Sends the signal again if its exception was raised in a destructor, where Python drops exceptions."""

    def hook(dropped: sys.UnraisableHookArgs) -> None:
        if isinstance(dropped.exc_value, KeyboardInterrupt):
            number = signal.SIGTERM if isinstance(dropped.exc_value, Terminated) else signal.SIGINT
            threading.Timer(RESEND_TIME, os.kill, (os.getpid(), number)).start()  # when the destructor has ended
        else:
            previous(dropped)

    previous = sys.unraisablehook
    sys.unraisablehook = hook
    try:
        yield
    finally:
        sys.unraisablehook = previous


@contextmanager
def one_line_warnings() -> Iterator[None]:
    """Prints the message of a warning on stderr, without the line of code that issued it."""

    def show(message: Warning | str, category: type[Warning], *_: object, **__: object) -> None:
        if issubclass(category, DeprecationWarning):
            return  # it concerns developers
        errors.print(
            Text.assemble(("warning:", "bold yellow"), " ", visible(" ".join(str(message).split()))), soft_wrap=True
        )

    previous = warnings.showwarning
    warnings.showwarning = show
    try:
        yield
    finally:
        warnings.showwarning = previous


def interrupt(reason: BaseException) -> NoReturn:
    """Prints on stderr that the command was interrupted or terminated, and exits with code 130 or 143."""
    terminated = isinstance(reason, Terminated)
    errors.print("terminated" if terminated else "interrupted")
    raise SystemExit(TERMINATED if terminated else INTERRUPTED) from None


def fail(message: str) -> NoReturn:
    """Prints ``error:`` and the message as one line on stderr, and exits with code 1."""
    text = Text.assemble(
        ("error:", "bold red"), " ", visible(" ".join(line.strip() for line in message.strip().split("\n")))
    )
    errors.print(text, soft_wrap=True)
    raise SystemExit(FAILED) from None


def say(text: str) -> None:
    """Prints plain text, without markup and without line breaks at the width of the terminal."""
    if not _only_progress:
        console.print(Text(visible(text)), soft_wrap=True)


def show(table: Table) -> None:
    """Prints a table; it is as wide as the terminal at most, and 80 columns where the output is no terminal."""
    if not _only_progress:
        console.print(table)


@contextmanager
def only_progress() -> Iterator[None]:
    """Lets the commands within it show progress and warnings, but print neither lines nor tables."""
    global _only_progress
    _only_progress = True
    try:
        yield
    finally:
        _only_progress = False


def visible(text: str) -> str:
    """Returns text with an escape sequence for each character that cannot be printed, such as a line break or ESC."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def busy(text: str) -> Status:
    """A context manager that shows ``text`` and a spinner at a terminal, and nothing elsewhere."""
    return console.status(Text(text))


@contextmanager
def progress(title: str, total: int) -> Iterator[Callable[[str], None]]:
    """Shows a progress bar with the time so far and the time that is left.

    The function it yields advances the bar by one and shows a note.
    """
    columns = (TextColumn("{task.description}", markup=False), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    left, note_column = TimeRemainingColumn(), TextColumn("{task.fields[note]}", markup=False)
    with Progress(
        *columns, TextColumn("left"), left, note_column, console=console, speed_estimate_period=SPEED_PERIOD
    ) as bar:
        task = bar.add_task(title, total=total, note="")

        def advance(note: str = "") -> None:
            bar.update(task, advance=1, note=note)

        yield advance


def write_json(path: Path, value: Any) -> None:
    """Writes ``value`` as a JSON file, completely or not at all."""
    from skill.data.files import write_atomically  # imports pandas

    write_atomically(path, (json.dumps(value, indent=1) + "\n").encode())
