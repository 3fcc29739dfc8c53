"""The skill that a command uses without ``--skill``: the newest of this folder, or the one that a release ships."""

from __future__ import annotations

from pathlib import Path

from interfaces.terminal import say

TRAINED = Path("out/skill.npz")
"""Where `haptic-skill train` and `haptic-skill demo` write the skill."""

SHIPPED = Path(__file__).resolve().parents[1] / "skill" / "default_skill.npz"
"""The skill of `haptic-skill demo`, which ``make release`` puts into the package."""


def find_skill(given: Path | None) -> Path:
    """Returns the file of the given skill; without one that of ``TRAINED``, else the one that this release ships.

    Raises:
        FileNotFoundError: if no skill is given, and there is neither.
    """
    if given is not None:
        return given
    if TRAINED.is_file():
        return TRAINED
    if not SHIPPED.is_file():
        raise FileNotFoundError(
            f"{TRAINED}: there is no such file, and this installation ships no skill; make one with"
            " `haptic-skill demo`, or name one with --skill"
        )
    say(f"there is no {TRAINED}: the skill that this version ships acts, {SHIPPED}")
    return SHIPPED
