"""Units of force, torque, length, angle and time, as people write them, and what they are in SI units."""

from __future__ import annotations

import math

_LBF, _INCH = 4.4482216152605, 0.0254

UNITS: dict[str, dict[str, float]] = {
    "time": {"s": 1.0, "sec": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9},
    "force": {"n": 1.0, "mn": 1e-3, "kn": 1e3, "lbf": _LBF, "klbf": 1e3 * _LBF, "gf": 9.80665e-3, "kgf": 9.80665},
    "torque": {
        **{"nm": 1.0, "knm": 1e3, "mnm": 1e-3, "nmm": 1e-3, "ncm": 1e-2, "kgfcm": 9.80665e-2},
        **{"lbfin": _LBF * _INCH, "lbfft": _LBF * 12 * _INCH, "ozfin": _LBF * _INCH / 16},
    },
    "length": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "in": _INCH},
    "angle": {"rad": 1.0, "mrad": 1e-3, "deg": math.pi / 180},
}
"""Size of each unit in the SI unit of its quantity; spelt as `_spelling` returns it."""

_SYNONYMS = {"µ": "u", "μ": "u", "°": "deg", "·": "", "*": "", "-": "", "_": "", " ": "", ".": ""}
_WORDS = {
    **{"seconds": "s", "second": "s", "milliseconds": "ms", "microseconds": "us", "nanoseconds": "ns"},
    **{"secs": "s", "msec": "ms", "usec": "us", "nsec": "ns"},
    **{"newtons": "n", "newtonmeter": "nm", "newtonmeters": "nm"},
    **{"lbin": "lbfin", "inlb": "lbfin", "inlbf": "lbfin", "ozin": "ozfin", "inoz": "ozfin", "inozf": "ozfin"},
    **{"lbft": "lbfft", "ftlb": "lbfft", "ftlbf": "lbfft", "degrees": "deg", "radians": "rad", "newton": "n"},
}
_SYMBOLS = {"time": "s", "force": "N", "torque": "Nm", "length": "m", "angle": "rad"}


def unit_size(unit: str, quantity: str | None = None) -> float:
    """Returns the size of a unit in SI units.

    Args:
        unit: such as "N", "mN", "N m", "Nmm", "lbf-in", "ms" or "deg"; upper and lower case are the same.
        quantity: one of "time", "force", "torque", "length", "angle"; None for any of them.

    Raises:
        ValueError: if this is no unit of the quantity. "MN" is refused: it could be a mega- or a millinewton.
    """
    spelling = _spelling(unit)
    for name, units in UNITS.items():
        if spelling in units and (quantity is None or name == quantity) and not unit.strip().startswith("MN"):
            return units[spelling]
    allowed = sorted(u for name, units in UNITS.items() if quantity in (None, name) for u in units)
    raise ValueError(f"'{unit}' is no unit of {quantity or 'a quantity that is known'}; expected one of {allowed}")


def is_unit(unit: str, quantity: str | None = None) -> bool:
    """Whether this is the name of a unit of a quantity; of any quantity for None."""
    try:
        unit_size(unit, quantity)
    except ValueError:
        return False
    return True


def si_symbol(quantity: str | None) -> str:
    """Returns the symbol of the SI unit of a quantity; "1" for a plain number."""
    return _SYMBOLS.get(quantity or "", "1")


def _spelling(unit: str) -> str:
    """A unit in lower case without spaces, dots and dashes."""
    text = "".join(_SYNONYMS.get(c, c) for c in unit.strip().lower())
    return _WORDS.get(text, text)
