"""Comparisons with contact theory, other learners and other controllers.

A benchmark imports all that it needs at its top. Started as a command without one of these packages, it names the extra
that installs it in one line.
"""

import os
import sys
from types import TracebackType

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before NumPy is imported; see `haptic_skill.main`

from interfaces.terminal import fail_without_extra


def name_missing_extra(kind: type[BaseException], error: BaseException, traceback: TracebackType | None) -> None:
    """Handles an uncaught exception: one line if a package of an extra is missing, else the traceback."""
    fail_without_extra(error)
    sys.__excepthook__(kind, error, traceback)


if sys.argv[0] == "-m":  # this package is imported because `python -m benchmarks.NAME` looks for NAME
    sys.excepthook = name_missing_extra
