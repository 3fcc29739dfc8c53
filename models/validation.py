"""Checks the values of a scenario and the keys of its YAML document.

Every check of values is a generator of `Violation`; `raise_first` turns the first one into an error.
"""

import math
from collections.abc import Iterable, Iterator
from dataclasses import fields, is_dataclass
from types import UnionType
from typing import Any, NamedTuple, get_args

# By default a number must be positive. The numbers of these fields may be zero ...
MAY_BE_ZERO = {
    *("seed", "chamfer", "dissipation", "friction", "friction_spread", "carriage_friction"),
    *("pivot_range", "demonstrated_pivot_range"),
    *("tilt_range", "offset_range", "damping", "angular_damping", "guide_damping", "mount_damping"),
    *("guide_stiffness", "force_scale", "torque_scale", "viscous_friction", "coulomb_friction", "speed_ki"),
    *("sight_delay", "sight_noise", "sight_bias_sigma", "dead_zone", "align_gain", "align_rate", "touch_gain"),
    *("tremor", "tremor_angle", "personal_spread", "force_noise", "torque_noise", "force_bias", "torque_bias"),
    *("gain", "full_depth_margin", "patience", "force_drift", "torque_drift", "delay"),
    *("offset_noise", "offset_bias_sigma", "offset_dead_zone", "touch_slide", "tremor_spread"),
}
# ... and the numbers of these fields may have either sign.
SIGNED = {"tilt", "offset", "sight_bias", "offset_bias", "pivot_height"}

COUNTS = {
    **dict.fromkeys(("tilt", "offset", "sight_bias", "offset_bias"), 2),
    **dict.fromkeys(("force_range", "torque_range", "force_noise", "torque_noise"), 3),
}
"""Number of elements of each list field."""


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
    """Checks that every number in a tree of dataclasses is finite and has an allowed sign, and every list its length.

    Args:
        tree: A dataclass instance whose fields are values or dataclass instances.
    """
    for path, name, value in _leaves(tree):
        if isinstance(value, list) and name in COUNTS and len(value) != COUNTS[name]:
            yield Violation(path, value, f"{COUNTS[name]} numbers")
        for number in value if isinstance(value, list) else [value]:
            if isinstance(number, bool) or not isinstance(number, int | float):
                continue
            if not math.isfinite(number):
                yield Violation(path, number, "a finite number")
            elif name not in SIGNED and not (number > 0 or (number == 0 and name in MAY_BE_ZERO)):
                yield Violation(path, value, ">= 0" if name in MAY_BE_ZERO else "> 0")


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
    if not isinstance(document, dict):
        raise ValueError(f"{where}: {path or 'the file'} is {document!r}, expected keys with values")
    known = {field.name: field.type for field in fields(schema)}
    for key, value in document.items():
        name = f"{path}.{key}" if path else str(key)
        if key not in known:
            raise ValueError(f"{where}: unknown key '{name}', expected one of {sorted(known)}")
        kind = known[key]
        if isinstance(kind, type) and is_dataclass(kind):
            check_document(value, kind, where, name)
        elif not _has_type(value, kind):
            raise ValueError(f"{where}: {name} is {value!r}, expected {getattr(kind, '__name__', kind)}")


def _has_type(value: Any, kind: Any) -> bool:
    """Returns whether a YAML value fits a field of type ``kind``; an int fits a float field."""
    kinds = get_args(kind) if isinstance(kind, UnionType) else (kind,)
    if value is None:
        return type(None) in kinds
    if list[float] in kinds:
        return isinstance(value, list) and all(_has_type(v, float) for v in value)
    if float in kinds:
        return isinstance(value, int | float) and not isinstance(value, bool)
    return any(isinstance(k, type) and type(value) is k for k in kinds)


def _leaves(node: Any, prefix: str = "") -> Iterator[tuple[str, str, Any]]:
    """Yields path, field name and value of every field of the tree that is not a dataclass instance."""
    for field in fields(node):
        value = getattr(node, field.name)
        if is_dataclass(value):
            yield from _leaves(value, f"{prefix}{field.name}.")
        else:
            yield f"{prefix}{field.name}", field.name, value
