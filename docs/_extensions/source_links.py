"""Links to source files, which a checkout can follow, lead to the reference and the gallery on the site."""

from __future__ import annotations

import re
from typing import Any

from sphinx.application import Sphinx

SOURCE = re.compile(r"\]\(\.\./((?:models|skill|systems|experiments|interfaces)(?:/\w+?)*?)(?:/__init__)?\.py\)")
TUTORIAL = re.compile(r"\]\(tutorials/(\w+)\.py\)")


def on_the_site(text: str) -> str:
    """Returns Markdown in which links of modules and tutorials lead to their pages."""
    text = SOURCE.sub(lambda link: f"](reference/{link[1].replace('/', '.')}.rst)", text)
    return TUTORIAL.sub(r"](gallery/\1.rst)", text)


def setup(app: Sphinx) -> dict[str, Any]:
    """Registers the change of the pages."""

    def read(app: Sphinx, name: str, source: list[str]) -> None:
        source[0] = on_the_site(source[0])

    app.connect("source-read", read)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
