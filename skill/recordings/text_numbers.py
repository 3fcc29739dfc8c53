"""Numbers as programs write them: with decimal points or commas, signs between thousands, texts for missing values."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from skill.arrays import Array

DECIMALS = {".": "point", ",": "comma"}
"""Decimal signs and what they are called."""

_MISSING = {
    *("", "-", "--", "---", ".", "?", "na", "n/a", "n.a.", "<na>", "nv", "null", "nil", "none", "nat", r"\n"),
    *("nan", "+nan", "-nan", "nans", "nanq", "nan(ind)", "-nan(ind)", "nan(snan)", "-nan(snan)"),
    *("#na", "#n/a", "#nv", "#n/d", "#null!", "#div/0!", "#num!", "#value!", "#ref!", "#name?", "#wert!", "#zahl!"),
}
"""What means that there is no value, in lower case: NumPy, C, R, SQL, SAS, Excel in English, German and French."""

_MISSING_IN_VISUAL_C = re.compile(r"[+-]?1[.,]#(?:ind|q?nan|snan)\S*")
_INFINITE = re.compile(r"[+-]?(?:inf|infinity|∞|1[.,]#inf\S*)")
_NOT_PLAIN = re.compile(r"[^0-9eE+\-. \n]")


def _grammar(decimal: str, other: str) -> re.Pattern[str]:
    """A number with a decimal sign; its thousands may be separated by the other sign, spaces or apostrophes."""
    d, fraction = re.escape(decimal), rf"(?:{re.escape(decimal)}\d*)?"
    thousands = rf"[1-9]\d{{0,2}}(?:([{other}'’ \u00a0\u2009\u202f])\d{{3}}(?:\1\d{{3}})*){fraction}"
    return re.compile(rf"[+-]?(?:{thousands}|(?:\d+{fraction}|{d}\d+)(?:[eEdD][+-]?\d+)?)", re.ASCII)


_GRAMMARS = {".": _grammar(".", ","), ",": _grammar(",", ".")}


def number(text: str, decimal: str) -> float | None:
    """Returns the number of a text with this decimal sign: NaN where it means that there is none, None for other texts.

    A sign separates thousands only where groups of three digits follow it and the number does not begin with 0.
    """
    text = text.strip().replace("\u2212", "-")
    low = text.lower()
    if low in _MISSING or _MISSING_IN_VISUAL_C.fullmatch(low):
        return np.nan
    if _INFINITE.fullmatch(low):
        return -np.inf if low[0] == "-" else np.inf
    if not _GRAMMARS[decimal].fullmatch(text):
        return None
    return float(re.sub(rf"[^0-9e+\-{re.escape(decimal)}]", "", low.replace("d", "e")).replace(decimal, "."))


def is_number(text: str) -> bool:
    """Whether a text is a number with one of both decimal signs, or infinite."""
    return any((value := number(text, decimal)) is not None and not np.isnan(value) for decimal in DECIMALS)


def is_missing(text: str) -> bool:
    """Whether a text means that there is no value."""
    value = number(text, ".")
    return value is not None and bool(np.isnan(value))


def numbers(texts: Sequence[str], decimal: str) -> Array | int:
    """Returns the numbers of texts with this decimal sign, or the index of the first text that is none."""
    joined = "\n".join(texts)
    plain = joined if decimal == "." else joined.replace(",", ".")
    one_sign = decimal == "." or "." not in joined
    if one_sign and not _NOT_PLAIN.search(plain) and joined.count("\n") == len(texts) - 1:
        try:
            return np.fromiter(map(float, plain.split("\n")), dtype=float, count=len(texts))
        except ValueError:
            pass  # some are missing
    found = np.empty(len(texts))
    for k, text in enumerate(texts):
        value = number(text, decimal)
        if value is None:
            return k
        found[k] = value
    return found
