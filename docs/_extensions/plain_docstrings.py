"""Docstrings are plain text with backticks: prepares them for reStructuredText before they are parsed.

Indented blocks, such as equations, examples and the ports of a system, are shown as they are. Elsewhere the characters
that reStructuredText would take for markup are escaped, except within backticks.
"""

from __future__ import annotations

import re
from typing import Any

from sphinx.application import Sphinx

KEPT = re.compile(r"(``.*?``|`[^`]*`|^\s*\* |(?<![\w*])\*\w[^*]*\*(?![\w*]))")
"""Quoted names, the sign of an item of a list, and emphasis."""
MARKUP = re.compile(r"(?<!\\)[|*]|(?<=\w)_(?!\w)")
SECTION = re.compile(r"[A-Z]\w+:")
GENERATED = re.compile(r"set_\w+_request|get_metadata_routing")
"""Methods that scikit-learn adds; their docstrings refer to its own pages."""


def prepare(app: Sphinx, what: str, name: str, obj: object, options: object, lines: list[str]) -> None:
    """Prepares the lines of a docstring in place."""
    lines[:] = prepared(lines)


def prepared(lines: list[str]) -> list[str]:
    """Returns the lines of a docstring with blocks marked and text escaped."""
    found: list[str] = []
    last, block, directive = "", None, None
    for line in lines:
        line = line.replace(".. pydrake_system::", ".. code-block:: yaml")
        text, indent = line.strip(), len(line) - len(line.lstrip())
        before = len(last) - len(last.lstrip())
        if text and block is not None and indent < block:
            block = None
        if text and directive is not None and indent <= directive:
            directive = None
        if text.startswith(".. "):
            directive = indent
        begins = text and last and not found[-1].strip() and indent > before and not SECTION.fullmatch(last.strip())
        if directive is None and block is None and begins:
            block = indent
            found += [" " * before + "::", ""]
        found.append(line if block is not None or directive is not None else escaped(line))
        last = line if text else last
    return found


def escaped(line: str) -> str:
    """Returns a line of text without markup other than what is kept."""
    parts = KEPT.split(line)
    return "".join(part if k % 2 else MARKUP.sub(r"\\\g<0>", part) for k, part in enumerate(parts))


def skip(app: Sphinx, what: str, name: str, obj: object, skipped: bool, options: object) -> bool | None:
    """Leaves out what scikit-learn generates."""
    return True if GENERATED.fullmatch(name) else None


def setup(app: Sphinx) -> dict[str, Any]:
    """Connects the preparation before that of Google's sections."""
    app.connect("autodoc-process-docstring", prepare, priority=400)
    app.connect("autodoc-skip-member", skip)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
