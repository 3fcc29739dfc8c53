"""Fills the HTML templates of the report pages; every page is one self-contained file."""

from __future__ import annotations

import json
from importlib.resources import files
from string import Template
from typing import Any


def fill_page(name: str, **values: str) -> str:
    """Returns the page ``name``.html with its style, its script and ``values`` inserted.

    The template holds placeholders ``$key``. ``$style`` and ``$script`` are the contents of ``name``.css and
    ``name``.js. Inserted text is not searched for placeholders, so a ``$`` in it is safe.

    Args:
        name: name of the template, without its ending.
        **values: HTML for the other placeholders; the caller escapes text that users can choose.

    Raises:
        KeyError: if the template has a placeholder without a value.
    """
    page, style, script = (_read(f"{name}.{ending}") for ending in ("html", "css", "js"))
    return Template(page).substitute(values, style=style, script=script)


def script_value(value: Any) -> str:
    """Returns ``value`` as a JavaScript expression that can stand in a script element.

    JSON with every ``<`` escaped, so that no text in it can end or reopen the element.
    """
    return json.dumps(value, separators=(",", ":")).replace("<", "\\u003c")


def _read(name: str) -> str:
    return files("interfaces.reports").joinpath(name).read_text(encoding="utf-8")
