"""Which numbers a scenario may hold: finite, of the right count, and positive unless their meaning allows otherwise."""

import math
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from types import UnionType
from typing import Any, get_args

# A length, a mass, a rate, a gain is positive. These alone may also be zero ...
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
# ... and these may be negative too.
SIGNED = {"tilt", "offset", "sight_bias", "offset_bias", "pivot_height"}

COUNTS = {
    **dict.fromkeys(("tilt", "offset", "sight_bias", "offset_bias"), 2),
    **dict.fromkeys(("force_range", "torque_range", "force_noise", "torque_noise"), 3),
}
"""How many numbers a list holds."""


def check_numbers(tree: Any, where: str) -> None:
    """Checks every number of a tree of dataclasses.

    Raises:
        ValueError: naming ``where``, the field, what was found and what was expected.
    """
    for path, name, value in _leaves(tree):
        if isinstance(value, list) and name in COUNTS and len(value) != COUNTS[name]:
            raise ValueError(f"{where}: {path} is {value}, expected {COUNTS[name]} numbers")
        for number in value if isinstance(value, list) else [value]:
            if isinstance(number, bool) or not isinstance(number, int | float):
                continue
            if not math.isfinite(number):
                raise ValueError(f"{where}: {path} is {number}, expected a finite number")
            if name in SIGNED or number > 0 or (number == 0 and name in MAY_BE_ZERO):
                continue
            least = ">= 0" if name in MAY_BE_ZERO else "> 0"
            raise ValueError(f"{where}: {path} is {value}, expected {least}")


def check_document(document: Any, schema: type, where: str, path: str = "") -> None:
    """Checks the keys and kinds of a parsed YAML document against a dataclass, before it is loaded.

    Raises:
        ValueError: naming ``where``, the key, what was found and what was expected.
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
        elif not _fits(value, kind):
            raise ValueError(f"{where}: {name} is {value!r}, expected {getattr(kind, '__name__', kind)}")


def _fits(value: Any, kind: Any) -> bool:
    kinds = get_args(kind) if isinstance(kind, UnionType) else (kind,)
    if value is None:
        return type(None) in kinds
    if list[float] in kinds:
        return isinstance(value, list) and all(_fits(v, float) for v in value)
    if float in kinds:
        return isinstance(value, int | float) and not isinstance(value, bool)
    return any(isinstance(k, type) and type(value) is k for k in kinds)


def _leaves(node: Any, prefix: str = "") -> Iterator[tuple[str, str, Any]]:
    for field in fields(node):
        value = getattr(node, field.name)
        if is_dataclass(value):
            yield from _leaves(value, f"{prefix}{field.name}.")
        else:
            yield f"{prefix}{field.name}", field.name, value
