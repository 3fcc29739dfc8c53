"""Limits of the values of a scenario, which stand beside its fields, and checks of values and YAML documents.

Every check of values is a generator of `Violation`; `raise_first` turns the first one into an error.
"""

import copy
import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, fields, is_dataclass
from functools import cache
from types import UnionType
from typing import Any, NamedTuple, get_args, get_origin

from models.document import brief

# Magnitudes without limits of their own. Physics works far within them, and arithmetic stays finite.
MIN_POSITIVE, MAX_MAGNITUDE = 1e-12, 1e12


@dataclass(frozen=True)
class Limits:
    """The allowed values of a field with a number, or with a list of ``count`` numbers.

    A number must be positive, unless ``low`` is zero or it is ``signed``; its magnitude is within the limits.
    """

    low: float = MIN_POSITIVE
    high: float = MAX_MAGNITUDE
    signed: bool = False
    count: int | None = None


def limited(default: Any, **limits: Any) -> Any:
    """Returns a dataclass field with a default value and `Limits`."""
    metadata = {"limits": Limits(**{"low": 0.0, **limits} if limits.get("signed") else limits)}
    if isinstance(default, list):
        return field(default_factory=default.copy, metadata=metadata)
    return field(default=default, metadata=metadata)


# Recordings and runs outside these limits are refused as implausible (`skill.data.plausibility`).
PERIODS = {"low": 1e-5, "high": 0.5}
TIME_LIMITS = {"low": 1e-3, "high": 3600.0}
"""Limits of periods and of time limits, s."""


TYPE_NAMES: dict[Any, str] = {
    int: "a whole number of 64 bits",
    float: "a number",
    float | None: "a number",
    str: "a name",
    list[float]: "a list of numbers",
    list[float] | None: "a list of numbers",
    list[list[float]]: "a list of lists of numbers",
    bool: "true or false",
    int | None: "a whole number",
    str | None: "a text",
    list[int]: "a list of whole numbers",
    list[str]: "a list of names",
    dict[str, Any]: "keys with values",
    dict[str, Any] | None: "keys with values",
    str | dict[str, Any]: "a name, or keys with values",
}
"""Names of the types of the fields, for messages."""

FLOATS = {float, float | None, list[float], list[float] | None, list[list[float]]}
"""Those whose whole numbers are converted."""

MAX_WHOLE_NUMBER = 10**300
"""Limit of a whole number that becomes a float, which holds no number of hundreds of digits."""


class Violation(NamedTuple):
    """A value that breaks a rule.

    Attributes:
        field: Name of the field, with its path in the tree.
        found: The value that was found, with its unit.
        expected: The values that are allowed.
    """

    field: str
    found: Any
    expected: str


def raise_first(violations: Iterable[Violation], where: str) -> None:
    """Raises the first of ``violations``, if there is one; later violations are not evaluated.

    Args:
        violations: Violations in the order in which they are checked.
        where: Name of the source in the message.

    Raises:
        ValueError: Naming ``where``, the field, the value found and the values expected.
    """
    for violation in violations:
        raise ValueError(f"{where}: {violation.field} is {violation.found}, expected {violation.expected}")


def number_violations(tree: Any) -> Iterator[Violation]:
    """Checks the numbers in a tree of dataclasses against their `Limits`, and the lengths of its lists.

    Args:
        tree: A dataclass instance whose fields are values or dataclass instances.
    """
    for path, value, limits in leaves(tree):
        if value is None or isinstance(value, bool | str):
            continue
        if isinstance(value, list) and limits.count not in (None, len(value)):
            yield Violation(path, brief(value), f"{limits.count} numbers")
        for number in value if isinstance(value, list) else [value]:
            if isinstance(number, bool) or not isinstance(number, int | float):
                continue
            if not math.isfinite(number):
                yield Violation(path, number, "a finite number")
            elif not limits.signed and (number < 0 or (number == 0 and limits.low > 0)):
                yield Violation(path, value, "> 0" if limits.low > 0 else ">= 0")
            elif not limits.low <= abs(number) <= limits.high:
                low = -limits.high if limits.signed else limits.low
                yield Violation(path, number, f"between {low:g} and {limits.high:g}")


def is_multiple(value: float, step: float) -> bool:
    """Returns whether a duration is a whole number of steps, up to rounding."""
    return abs(value / step - round(value / step)) < 1e-6


def check_document(document: Any, schema: type, where: str, path: str = "") -> None:
    """Checks the keys and value types of a parsed YAML document against a dataclass, before it is loaded.

    Args:
        document: The parsed document, or the part of it at ``path``.
        schema: Dataclass with the allowed keys.
        where: Name of the source in the message.
        path: Path of ``document`` within the whole document.

    Raises:
        ValueError: Naming ``where``, the key, what was found and what was expected.
    """
    known = {entry.name: entry.type for entry in fields(schema)}
    if not isinstance(document, dict):
        raise ValueError(
            f"{where}: {path or 'the file'} is {'empty' if document is None else brief(document)},"
            f" expected keys with values, of {sorted(known)}"
        )
    for key, value in document.items():
        name = f"{path}.{key}" if path else str(key)
        if key not in known:
            raise ValueError(f"{where}: unknown key {brief(name)}, expected one of {sorted(known)}")
        kind = known[key]
        if isinstance(kind, type) and is_dataclass(kind):
            check_document(value, kind, where, name)
        elif not _has_type(value, kind):
            quoted = " in quotes" if kind is str and isinstance(value, bool) else ""
            raise ValueError(f"{where}: {name} is {brief(value)}, expected {TYPE_NAMES[kind]}{quoted}")


def _has_type(value: Any, kind: Any) -> bool:
    """Returns whether a YAML value fits a field of type ``kind``; an int fits a float field."""
    if isinstance(kind, UnionType):
        return any(_has_type(value, one) for one in get_args(kind))
    if get_origin(kind) is list:
        return isinstance(value, list) and all(_has_type(element, get_args(kind)[0]) for element in value)
    if get_origin(kind) is dict:  # free keys and values
        return isinstance(value, dict)
    if kind is float:
        return type(value) is float or (type(value) is int and abs(value) < MAX_WHOLE_NUMBER)
    return type(value) is kind and not (kind is int and abs(value) >= 2**63)


def fill(tree: Any, document: dict[str, Any]) -> None:
    """Sets fields of a tree of dataclasses to the values of a document.

    Args:
        tree: A dataclass; it is changed.
        document: Values that `check_document` accepts for its type.
    """
    for entry in fields(tree):
        if entry.name not in document:
            continue
        value, node = document[entry.name], getattr(tree, entry.name)
        if is_dataclass(node):
            fill(node, value)
        else:
            setattr(tree, entry.name, _converted(value, entry.type))


def _converted(value: Any, kind: Any) -> Any:
    """Returns the value of a field, which shares no list with the document; an int of a float field is a float."""
    if isinstance(value, list):
        return [_converted(element, kind) for element in value]
    return float(value) if type(value) is int and kind in FLOATS else value


def copied(tree: Any) -> Any:
    """Returns a copy of a tree of dataclasses, values and lists; `copy.deepcopy` takes ten times as long."""
    made = copy.copy(tree)
    for name, value in vars(tree).items():
        if is_dataclass(value):
            setattr(made, name, copied(value))
        elif isinstance(value, list):
            setattr(made, name, copy.deepcopy(value))
    return made


def leaves(node: Any, prefix: str = "") -> Iterator[tuple[str, Any, Limits]]:
    """Yields path, value and limits of every field of the tree that is not a dataclass instance."""
    for name, limits in _limits(node.__class__):
        value = getattr(node, name)
        if is_dataclass(value):
            yield from leaves(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", value, limits


@cache
def _limits(kind: type) -> list[tuple[str, Limits]]:
    """The fields of a dataclass with their limits; a sweep checks thousands of scenarios."""
    return [(leaf.name, leaf.metadata.get("limits", Limits())) for leaf in fields(kind)]
