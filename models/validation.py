"""Checks the values of a scenario and the keys of its YAML document.

Every check of values is a generator of `Violation`; `raise_first` turns the first one into an error.
"""

import math
from collections.abc import Iterable, Iterator
from dataclasses import fields, is_dataclass
from types import UnionType
from typing import Any, NamedTuple, get_args

from models.bore import MAX_FACETS
from models.document import brief

# By default a number must be positive. The numbers of these fields may be zero ...
MAY_BE_ZERO = {
    *("seed", "chamfer", "dissipation", "friction", "friction_spread", "carriage_friction"),
    *("pivot_range", "demonstrated_pivot_range"),
    *("tilt_range", "offset_range", "damping", "angular_damping", "guide_damping", "mount_damping"),
    *("guide_stiffness", "force_scale", "torque_scale", "viscous_friction", "coulomb_friction", "speed_ki"),
    *("sight_delay", "sight_noise", "sight_bias_sigma", "dead_zone", "align_gain", "align_rate", "touch_gain"),
    *("tremor", "tremor_angle", "personal_spread", "force_noise", "torque_noise", "force_bias", "torque_bias"),
    *("depth", "gain", "full_depth_margin", "patience", "force_drift", "torque_drift", "delay"),
    *("offset_noise", "offset_bias_sigma", "offset_dead_zone", "touch_slide", "tremor_spread"),
}
# ... and the numbers of these fields may have either sign.
SIGNED = {"tilt", "offset", "sight_bias", "offset_bias", "pivot_height"}

# Magnitudes without limits of their own. Physics works far within them, and arithmetic stays finite.
MIN_POSITIVE, MAX_MAGNITUDE = 1e-12, 1e12

LIMITS = {
    **dict.fromkeys(("geometry.peg_radius", "geometry.hole_radius"), (1e-4, 1.0, "m")),
    **dict.fromkeys(("geometry.peg_length", "geometry.hole_depth", "geometry.block_radius"), (1e-4, 10.0, "m")),
    "geometry.floor": (1e-4, 10.0, "m"),
    "geometry.facets": (3, MAX_FACETS, ""),
    # Below the step, hours of computing time pass within a second; the others are counted in it or in as small steps.
    "contact.time_step": (1e-5, 0.1, "s"),
    "contact.modulus": (MIN_POSITIVE, math.inf, "Pa"),  # a stiffer contact is rigid
    # Recordings and runs outside these limits are refused as implausible (`skill.data.plausibility`).
    **dict.fromkeys(("recorder.period", "controller.period"), (1e-5, 0.5, "s")),
    **dict.fromkeys(("sensor.torque_bias", "sensor.torque_noise"), (0.0, 0.2, "N m")),
    "sensor.torque_drift": (0.0, 5e-3, "N m/sqrt(s)"),
    **dict.fromkeys(("sensor.force_bias", "sensor.force_noise"), (0.0, 1e3, "N")),
    "sensor.force_drift": (0.0, 10.0, "N/sqrt(s)"),
    **dict.fromkeys(("start.offset_range", "start.offset"), (0.0, 0.9, "m")),
    "start.height": (MIN_POSITIVE, 0.45, "m"),  # an operator gives up at twice this height
    "sensor.period": (1e-5, 1.0, "s"),
    "operator.decision_period": (1e-3, 1.0, "s"),
    **dict.fromkeys(("recorder.time_limit", "trial.time_limit"), (1e-3, 3600.0, "s")),
    **dict.fromkeys(("sensor.delay", "operator.sight_delay"), (0.0, 10.0, "s")),
    **dict.fromkeys(("start.tilt_range", "start.demonstrated_tilt_range"), (0.0, 0.5 * math.pi, "rad")),
    "sensor.height": (MIN_POSITIVE, 1.0, "m"),
    "seed": (0, 2**63 - 1, ""),
}
"""Minimum, maximum and unit of single numbers, by their path."""

COUNTS = {
    **dict.fromkeys(("tilt", "offset", "sight_bias", "offset_bias"), 2),
    **dict.fromkeys(("force_range", "torque_range", "force_noise", "torque_noise"), 3),
}
"""Number of elements of each list field."""


TYPE_NAMES: dict[Any, str] = {
    int: "a whole number of 64 bits",
    float: "a number",
    float | None: "a number",
    str: "a name",
    list[float]: "a list of numbers",
    list[float] | None: "a list of numbers",
}
"""Names of the types of the fields, for messages."""


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
    """Checks the numbers in a tree of dataclasses, and the lengths of its lists.

    Every number must be finite, have an allowed sign, and lie within `LIMITS` or within the general limits.

    Args:
        tree: A dataclass instance whose fields are values or dataclass instances.
    """
    for path, name, value in _leaves(tree):
        if isinstance(value, list) and name in COUNTS and len(value) != COUNTS[name]:
            yield Violation(path, brief(value), f"{COUNTS[name]} numbers")
        for number in value if isinstance(value, list) else [value]:
            if isinstance(number, bool) or not isinstance(number, int | float):
                continue
            if not math.isfinite(number):
                yield Violation(path, number, "a finite number")
            elif name not in SIGNED and not (number > 0 or (number == 0 and name in MAY_BE_ZERO)):
                yield Violation(path, value, ">= 0" if name in MAY_BE_ZERO else "> 0")
            else:
                yield from _limit_violations(path, name, number)


def _limit_violations(path: str, name: str, number: float) -> Iterator[Violation]:
    """Checks the magnitude of a number of an allowed sign."""
    either = name in SIGNED or name in MAY_BE_ZERO
    low, high, unit = LIMITS.get(path, (0.0 if either else MIN_POSITIVE, MAX_MAGNITUDE, ""))
    if not low <= abs(number) <= high:
        low = -high if name in SIGNED else low
        yield Violation(path, f"{number} {unit}".rstrip(), f"between {low:g} and {high:g} {unit}".rstrip())


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
        raise ValueError(f"{where}: {path or 'the file'} is {brief(document)}, expected keys with values")
    known = {field.name: field.type for field in fields(schema)}
    for key, value in document.items():
        name = f"{path}.{key}" if path else str(key)
        if key not in known:
            raise ValueError(f"{where}: unknown key {brief(name)}, expected one of {sorted(known)}")
        kind = known[key]
        if isinstance(kind, type) and is_dataclass(kind):
            check_document(value, kind, where, name)
        elif not _has_type(value, kind):
            raise ValueError(f"{where}: {name} is {brief(value)}, expected {TYPE_NAMES[kind]}")


def _has_type(value: Any, kind: Any) -> bool:
    """Returns whether a YAML value fits a field of type ``kind``; an int fits a float field."""
    kinds = get_args(kind) if isinstance(kind, UnionType) else (kind,)
    if value is None:
        return type(None) in kinds
    if list[float] in kinds:
        return isinstance(value, list) and all(_has_type(v, float) for v in value)
    if float in kinds:
        return isinstance(value, int | float) and not isinstance(value, bool)
    if type(value) is int and abs(value) >= 2**63:
        return False
    return any(isinstance(k, type) and type(value) is k for k in kinds)


def _leaves(node: Any, prefix: str = "") -> Iterator[tuple[str, str, Any]]:
    """Yields path, field name and value of every field of the tree that is not a dataclass instance."""
    for field in fields(node):
        value = getattr(node, field.name)
        if is_dataclass(value):
            yield from _leaves(value, f"{prefix}{field.name}.")
        else:
            yield f"{prefix}{field.name}", field.name, value
