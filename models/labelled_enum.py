"""An enumeration whose members have a number for files and a label for people."""

from __future__ import annotations

from enum import IntEnum
from typing import Self


class LabelledEnum(IntEnum):
    """Base class; a member is written ``NAME = number, "label"``."""

    label: str

    def __new__(cls, value: int, label: str = "") -> Self:
        """Creates a member with a number and a label."""
        member = int.__new__(cls, value)
        member._value_ = value
        member.label = label
        return member
