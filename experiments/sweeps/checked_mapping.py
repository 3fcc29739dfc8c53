"""Takes the values of a parsed YAML mapping one by one, with their types, and names what is wrong."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, TypeVar

from models.document import brief

T = TypeVar("T")

TYPE_NAMES: dict[type, str] = {
    bool: "true or false",
    int: "a whole number",
    float: "a number",
    str: "a text",
    list: "a list",
    dict: "keys with values",
}
"""Names of types, for messages."""


class CheckedMapping:
    """A mapping whose values are taken by name; `finish` refuses what was not taken.

    Args:
        values: the mapping.
        where: name of the file, for messages.
        path: of the mapping within the file; "" for the whole.

    Raises:
        ValueError: if ``values`` is no mapping, or one of its keys is no text.
    """

    def __init__(self, values: Any, where: str, path: str = "") -> None:
        self.where, self.path = where, path
        if not isinstance(values, Mapping):
            raise ValueError(f"{where}: {path or 'the file'} is {brief(values)}, expected keys with values")
        self.values: Mapping[Any, Any] = values
        self._taken: list[str] = []

    def name(self, key: str) -> str:
        """Returns the path of a key within the file."""
        return f"{self.path}.{key}" if self.path else key

    def take(self, key: str, kind: type[T], default: T | None = None) -> T:
        """Returns the value of a key, or ``default`` where it is missing; a whole number serves as a number.

        Raises:
            ValueError: naming the key, if it is missing and has no default, or its value has another type.
        """
        self._taken.append(key)
        if key not in self.values:
            if default is None:
                raise ValueError(f"{self.where}: {self.name(key)} is missing, expected {TYPE_NAMES[kind]}")
            return default
        value = self.values[key]
        if kind is float and type(value) is int:
            value = float(value)
        if type(value) is not kind:
            raise self.error(key, brief(value), TYPE_NAMES[kind])
        return value

    def optional(self, key: str, kind: type[T]) -> T | None:
        """Returns the value of a key as `take` does, or None where it is missing."""
        self._taken.append(key)
        return self.take(key, kind) if key in self.values else None

    def section(self, key: str) -> CheckedMapping:
        """Returns the mapping at a key; an empty one where it is missing."""
        self._taken.append(key)
        return CheckedMapping(self.values.get(key, {}), self.where, self.name(key))

    def choices(self, key: str, allowed: Iterable[str], default: str) -> tuple[str, ...]:
        """Returns the distinct names in the list at a key, each one of ``allowed``.

        Raises:
            ValueError: naming the key, if the list is empty, or a name is unknown or there twice.
        """
        names = self.take(key, list, [default])
        known = list(allowed)
        if not names or not all(isinstance(name, str) and name in known for name in names):
            raise self.error(key, brief(names), f"a list of some of {known}")
        if len(set(names)) < len(names):
            raise self.error(key, brief(names), "each name once")
        return tuple(names)

    def numbers(self, key: str, default: Iterable[int]) -> tuple[int, ...]:
        """Returns the distinct non-negative whole numbers in the list at a key.

        Raises:
            ValueError: naming the key, if the list is empty, or an element is another value or there twice.
        """
        found = self.take(key, list, list(default))
        if not found or not all(type(number) is int and number >= 0 for number in found):
            raise self.error(key, brief(found), "a list of whole numbers of at least 0")
        if len(set(found)) < len(found):
            raise self.error(key, brief(found), "each number once")
        return tuple(found)

    def count(self, key: str, default: int | None = None, *, least: int, most: int) -> int:
        """Returns the whole number between two limits at a key.

        Raises:
            ValueError: naming the key, if it lies outside.
        """
        number = self.take(key, int, default)
        if not least <= number <= most:
            raise self.error(key, str(number), f"{least} to {most}")
        return number

    def error(self, key: str, found: str, expected: str) -> ValueError:
        """Returns the error about the value of a key."""
        return ValueError(f"{self.where}: {self.name(key)} is {found}, expected {expected}")

    def finish(self) -> None:
        """Refuses the keys that were not taken.

        Raises:
            ValueError: naming the first of them and the known ones.
        """
        for key in self.values:
            if key not in self._taken:
                known = sorted(set(self._taken))
                raise ValueError(f"{self.where}: unknown key {brief(self.name(str(key)))}, expected one of {known}")
