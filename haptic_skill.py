"""Entry point of the command `haptic-skill`.

It lies outside the packages, so that it can report another package that hides one of them.
"""

from __future__ import annotations

import os
from importlib.util import find_spec
from pathlib import Path

ROOT = Path(__file__).resolve().parent
PACKAGES = ("models", "skill", "systems", "experiments", "interfaces", "scripts")


def main() -> None:
    """Checks that the packages found are ours, then runs the command."""
    check_packages()
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # the matrices are small: more threads only cost time
    from scripts.haptic_skill import app

    app(prog_name="haptic-skill")


def check_packages() -> None:
    """Exits with code 1 and one line if another package with the name of one of ours is found first."""
    for name in PACKAGES:
        ours, found = ROOT / name, location(name)
        if found != ours:
            problem = f"another package '{name}' at {found} hides" if found else "Python does not find"
            raise SystemExit(
                f"error: {problem} the one of haptic-skill at {ours}; check PYTHONPATH and the current directory"
            )


def location(name: str) -> Path | None:
    """Returns the folder (or file) that a top-level package would be imported from, or None if there is none."""
    spec = find_spec(name)
    if spec is None:
        return None
    folders = [*(spec.submodule_search_locations or []), spec.origin or ""]
    return Path(folders[0]).resolve()


if __name__ == "__main__":
    main()
