"""Fills the HTML templates of the report pages; every page is one self-contained file."""

from __future__ import annotations

import html
import io
import json
import re
from collections.abc import Mapping, Sequence
from importlib.resources import files
from string import Template
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def fill_page(name: str, *, title: str, assets: Sequence[str], style: str = "", script: str = "", **values: str) -> str:
    """Returns a page: page.html around ``name``.html, with its styles, its script and ``values`` inserted.

    The template holds placeholders ``$key``. Inserted text is not searched for placeholders, so a ``$`` in it is safe.

    Args:
        name: name of the template, without its ending.
        title: of the page, escaped as ``values``.
        assets: names of the styles, the last of which is that of the script too.
        style: rules that come before them.
        script: statements that come before the script.
        **values: HTML for the placeholders; the caller escapes text that users can choose.

    Raises:
        KeyError: if the template has a placeholder without a value.
    """
    return Template(_read("page.html")).substitute(
        title=title,
        style="".join([style, *(_read(f"{asset}.css") for asset in assets)]),
        body=Template(_read(f"{name}.html")).substitute(values, title=title),
        script=script + _read(f"{assets[-1]}.js"),
    )


def definitions(values: Mapping[str, str]) -> str:
    """Returns the rows of a list of names and texts as HTML."""
    return "".join(f"<dt>{html.escape(name)}</dt><dd>{html.escape(text)}</dd>" for name, text in values.items())


def script_value(value: Any) -> str:
    """Returns ``value`` as a JavaScript expression that can stand in a script element.

    JSON with every ``<`` escaped, so that no text in it can end or reopen the element.
    """
    return json.dumps(value, separators=(",", ":")).replace("<", "\\u003c")


def svg_element(figure: Figure) -> str:
    """Returns a figure of Matplotlib as an SVG element that is as wide as there is room; its texts stay texts."""
    from matplotlib import rc_context

    file = io.StringIO()
    with rc_context({"svg.fonttype": "none", "svg.hashsalt": "haptic-skill"}):
        figure.savefig(file, format="svg", transparent=True)
    element = file.getvalue()
    element = re.sub(r"<metadata>.*?</metadata>", "", element[element.index("<svg") :], flags=re.DOTALL)
    return re.sub(r' (?:width|height)="[\d.]+pt"', "", element, count=2)


def _read(name: str) -> str:
    return files("interfaces.reports").joinpath(name).read_text(encoding="utf-8")
