"""Names, colours and gaps of contact states, the same in figures, tables and replays."""

from __future__ import annotations

from collections.abc import Sequence

PALETTE = (
    "#0072B2",  # blue
    "#E69F00",  # orange
    "#009E73",  # green
    "#CC79A7",  # pink
    "#56B4E9",  # sky
    "#D55E00",  # vermilion
    "#B8AD2E",  # olive
    "#882255",  # wine
    "#7F7F7F",  # grey
)
"""Colours that people with the common kinds of colour blindness can distinguish, all visible on white."""

GAP = 5.0
"""A time between two samples is a gap if it is longer than so many median ones; it then counts as one of these."""

TINTS = (1.0, 0.55, 0.3)
"""Strengths of the palette's colours: the first states have the full colours, later ones lighter tints."""


def state_colours(number: int) -> list[str]:
    """Returns the hexadecimal colours of ``number`` states.

    Raises:
        ValueError: if there are more states than distinct colours.
    """
    if number > len(TINTS) * len(PALETTE):
        raise ValueError(f"{number} states, expected at most {len(TINTS) * len(PALETTE)} with distinct colours")
    return [_tint(PALETTE[k % len(PALETTE)], TINTS[k // len(PALETTE)]) for k in range(number)]


def state_labels(number: int, names: Sequence[str] | None = None) -> list[str]:
    """Returns the names of ``number`` states: the given names, or "state 0", "state 1", ...

    Raises:
        ValueError: if there are fewer names than states.
    """
    if names is None:
        return [f"state {k}" for k in range(number)]
    if len(names) < number:
        raise ValueError(f"{len(names)} state names {list(names)}, expected one for each of {number} states")
    return [str(name) for name in names]


def _tint(colour: str, strength: float) -> str:
    """Returns a colour "#RRGGBB" mixed with white; a strength of 1 keeps it, 0 gives white."""
    channels = (int(colour[i : i + 2], 16) for i in (1, 3, 5))
    return "#" + "".join(f"{round(255 - strength * (255 - c)):02X}" for c in channels)
