"""Groups of channels of the same quantity, and the units in which people read them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from skill.recordings.columns import QUATERNION, channel_quantity

_READ_IN = {  # quantity: name of the group, unit, size of the SI unit in it
    "force": ("force", "N", 1.0),
    "torque": ("moment", "N m", 1.0),
    "length": ("position", "mm", 1e3),
    "angle": ("rotation", "rad", 1.0),
}
_ORIENTATION, _OTHER = ("orientation", "", 1.0), ("other", "", 1.0)


@dataclass(frozen=True)
class ChannelGroup:
    """Channels of one quantity.

    Attributes:
        name: of the quantity, such as "force".
        unit: in which people read it, such as "N"; empty for numbers whose unit is not known.
        factor: number in this unit = factor x number in SI units.
        channels: names of the channels.
    """

    name: str
    unit: str
    factor: float
    channels: tuple[str, ...]


def channel_groups(channels: Sequence[str]) -> list[ChannelGroup]:
    """Returns the groups of the channels: forces, moments, positions, rotations, orientation, then all others."""
    members: dict[tuple[str, str, float], list[str]] = {key: [] for key in (*_READ_IN.values(), _ORIENTATION, _OTHER)}
    for channel in channels:
        known = _READ_IN.get(channel_quantity(channel) or "")
        members[known or (_ORIENTATION if channel in QUATERNION else _OTHER)].append(channel)
    return [ChannelGroup(*key, tuple(found)) for key, found in members.items() if found]
