"""Links the files of the published trials in the scoreboard, the ladder and the curves as downloads.

The names of their folders contain percent signs, which MyST cannot follow in a link.
"""

from __future__ import annotations

import re
from typing import Any
from urllib.parse import unquote

from sphinx.application import Sphinx

PAGES = ("scoreboard", "ladder", "curves", "sets")
LINK = re.compile(rf"\[((?:\\.|[^\]\\])*)\]\(((?:{'|'.join(PAGES)})/trials/[^)]*)\)")
ESCAPED = re.compile(r"\\(.)")


def with_downloads(text: str) -> str:
    """Returns Markdown in which links of trials are download roles."""

    def download(link: re.Match[str]) -> str:
        name = ESCAPED.sub(r"\1", link[1])
        return f"{{download}}`{name} <{unquote(link[2])}>`"

    return LINK.sub(download, text)


def _read(app: Sphinx, name: str, source: list[str]) -> None:
    if name in PAGES:
        source[0] = with_downloads(source[0])


def setup(app: Sphinx) -> dict[str, Any]:
    """Registers the change of the page."""
    app.connect("source-read", _read)
    return {"parallel_read_safe": True}
