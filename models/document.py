"""Reads YAML text, such as a scenario, into plain values, and refuses what would be lost."""

from __future__ import annotations

import re
import reprlib
from pathlib import Path
from typing import Any

import yaml

MAX_SIZE = 32_000
"""Maximum size of a document, in bytes of a file and in characters of a text; the largest in use has 4,000."""

NUMBERS = ("tag:yaml.org,2002:int", "tag:yaml.org,2002:float")
"""Tags of numbers."""

_OTHER_BASE = re.compile(r"[-+]?(?:0[0-7_]+|[0-9_]+:.*)")

_BRIEF = reprlib.Repr()
_BRIEF.maxstring = _BRIEF.maxother = _BRIEF.maxlong = 60


def brief(value: Any) -> str:
    """Returns ``repr(value)`` for a message: on one line, with the middle of a long value left out."""
    return _BRIEF.repr(value)


def read_text(path: Path, where: str) -> str:
    """Returns the text of a file.

    Args:
        path: The file.
        where: Name of the file in error messages.

    Raises:
        ValueError: If the file is larger than `MAX_SIZE` or is not UTF-8.
        OSError: If it cannot be read.
    """
    with path.open("rb") as file:
        data = file.read(MAX_SIZE + 1)
    _check_size(len(data), "bytes", where)
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        found = f"byte 0x{data[error.start]:02x} (at {error.start})"
        raise ValueError(f"{where}: line {line}: found {found}, expected text in UTF-8") from error


def read_document(text: str, where: str) -> Any:
    """Returns the values of a YAML text: mappings, lists, strings, numbers, booleans and None.

    Numbers such as 1e10, which YAML 1.1 takes for strings, are numbers. Numbers such as 010 and 1:30, which it reads to
    base 8 and 60, are errors.

    Args:
        text: YAML text of one document.
        where: Name of the source in error messages.

    Raises:
        ValueError: Naming ``where``, the line and the problem: invalid YAML, a duplicate key, a tag, a number to
            base 8 or 60, deep nesting, or a text of more than `MAX_SIZE` characters.
    """
    _check_size(len(text), "characters", where)
    try:
        return yaml.load(text, Loader=_Loader)  # a SafeLoader: it makes plain values only
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line = f"line {mark.line + 1}: " if mark is not None else ""
        problem = "; ".join(part for part in (error.problem, error.context) if part)
        raise ValueError(f"{where}: {line}{_explained(problem)}") from error
    except RecursionError:
        raise ValueError(f"{where}: invalid YAML: nested too deeply") from None
    except (yaml.YAMLError, ValueError) as error:  # a character, a date or a number that there is not
        raise ValueError(f"{where}: invalid YAML: {_explained(str(error))}") from error


class _Loader(yaml.SafeLoader):
    """The safe loader with numbers such as 1e10, and without duplicate keys and tags."""

    def __init__(self, stream: str) -> None:
        super().__init__(stream)
        self._path: list[str] = []

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        """Composes one value; ``index`` is the node of its key, if it has one."""
        event: Any = self.peek_event()  # type: ignore[no-untyped-call]
        if not isinstance(event, yaml.AliasEvent) and event.tag is not None:
            raise _problem(f"found the tag {brief(event.tag)}, expected plain values without tags", event)
        self._path.append(index.value if isinstance(index, yaml.ScalarNode) else "")
        node = super().compose_node(parent, index)
        self._path.pop()
        if isinstance(node, yaml.ScalarNode) and node.tag in NUMBERS and _OTHER_BASE.fullmatch(node.value):
            found = f"found {brief(node.value)}, which YAML reads to base 8 or 60"
            raise _problem(f"{found}, expected a decimal number without leading zeros or colons", node)
        return node

    def compose_mapping_node(self, anchor: Any) -> yaml.MappingNode:
        """Composes a mapping; refuses a key that it has twice."""
        node: yaml.MappingNode = super().compose_mapping_node(anchor)
        lines: dict[tuple[str, str], int] = {}
        for key, _ in node.value:
            if not isinstance(key, yaml.ScalarNode):
                continue
            first = lines.get((key.tag, key.value))
            if first is not None:
                name = ".".join([*filter(None, self._path), key.value])
                raise _problem(f"found the key {brief(name)} again, expected it once; it is on line {first}", key)
            lines[key.tag, key.value] = key.start_mark.line + 1
        return node


_Loader.add_implicit_resolver(
    "tag:yaml.org,2002:float", re.compile(r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)[eE][-+]?[0-9]+\Z"), list("-+.0123456789")
)


def _problem(text: str, place: Any) -> yaml.MarkedYAMLError:
    """Returns the error about an event or a node."""
    return yaml.MarkedYAMLError(problem=text, problem_mark=place.start_mark)


def _explained(problem: str) -> str:
    """Returns the parser's description of a problem on one line, with a hint about tabs."""
    line = " ".join(problem.split())
    return f"{line}; indent with spaces, not with tabs" if r"'\t'" in problem else line


def _check_size(size: int, unit: str, where: str) -> None:
    if size > MAX_SIZE:
        raise ValueError(f"{where}: found more than {MAX_SIZE} {unit}, expected a document of a few thousand")
