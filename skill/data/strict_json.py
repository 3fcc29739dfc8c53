"""Reads the JSON texts that files carry."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

MAX_DIGITS = 100
"""Largest number of digits of an integer; more than 308 could not become a float."""

MAX_LENGTH = 10_000_000
"""Largest number of characters; its objects then take below 500 MB."""


def parse_object(text: bytes | str, object_hook: Callable[[dict[str, Any]], Any] | None = None) -> dict[str, Any]:
    """Returns a JSON object.

    Args:
        text: JSON; NaN and infinite numbers are allowed.
        object_hook: replaces each object within it.

    Raises:
        ValueError: if the text is not JSON, not an object, nested too deeply, longer than ``MAX_LENGTH``, or has a key
            twice or an integer of more than ``MAX_DIGITS`` digits.
    """

    def unique(pairs: list[tuple[str, Any]]) -> Any:
        found = dict(pairs)
        if len(found) < len(pairs):
            raise ValueError(f"a key occurs twice among {sorted(name for name, _ in pairs)}")
        return found if object_hook is None else object_hook(found)

    if len(text) > MAX_LENGTH:
        raise ValueError(f"{len(text)} characters, expected at most {MAX_LENGTH}")
    try:
        value = json.loads(text, object_pairs_hook=unique, parse_int=_integer)
    except RecursionError:
        raise ValueError("nested too deeply") from None
    if not isinstance(value, dict):
        raise ValueError(f"found {'null' if value is None else type(value).__name__}, expected an object")
    return value


def _integer(digits: str) -> int:
    if len(digits) > MAX_DIGITS:
        raise ValueError(f"an integer of {len(digits)} digits, expected at most {MAX_DIGITS}")
    return int(digits)
