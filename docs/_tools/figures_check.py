"""Compares the figures of README and docs with the published rows.

    make figures-check

A line for each figure of `docs/_tools/figures.py` that its page does not say, and for each figure such as "3 of 40" or
"p 0.01", or row of a table of such figures, of which `docs/_tools/figures.py` does not say where it comes from.
"""

from __future__ import annotations

import re
import string
import sys
from collections.abc import Iterator
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import pandas as pd

from docs._tools.figures import ELSEWHERE, ROWS
from docs._tools.published_rows import ROOT

FIGURE = re.compile(r"(?<![\w,.])\d[\d,]*(?: [a-z]+)? of (?:the |all )?\d[\d,]*\b(?!\.\d)|\bp (?:< ?)?[01]\.\d+")
HEAD = re.compile(r"\|[^\n]*\bof \d[^\n]*\n\|[ :|-]+\n")
HEADING = re.compile(r"^#+ .*$", re.MULTILINE)


def main() -> None:
    """Prints what is wrong; exits with 1 if anything is."""
    found = problems(ROOT)
    print("\n".join(found) or "all figures are those of the rows")
    sys.exit(bool(found))


def problems(root: Path) -> list[str]:
    """Returns a line for each figure of the pages in ``root`` that is not that of the rows, or has no origin."""
    found = []
    for path in [root / "README.md", *sorted((root / "docs").glob("*.md"))]:
        page, text = path.relative_to(root).as_posix(), path.read_text(encoding="utf-8")
        known: list[tuple[int, int]] = []
        for template, value in ROWS.get(page, ()):
            for expected in texts(template, value):
                spans = places(text, expected)
                known += spans
                if not spans:
                    found.append(f"{page}: {said(template, expected, text)}; the rows say '{expected}'")
        for place, command in ELSEWHERE.get(page, {}).items():
            spans = places(text, place)
            known += spans
            if not spans or not places(text, command):
                found.append(f"{page}: has no '{command if spans else place}', which docs/_tools/figures.py names")
        for start, figure in figures(text):
            if not any(first <= start < last for first, last in known):
                line = text.count("\n", 0, start) + 1
                found.append(f"{page}:{line}: '{figure}' has neither a query nor a command in docs/_tools/figures.py")
    return found


def texts(template: str, value: Any) -> list[str]:
    """Returns the texts that a page has to contain: of a DataFrame one for each row, else one."""
    if isinstance(value, pd.DataFrame):
        return [template.format(*row) for row in value.reset_index().itertuples(index=False)]
    return [template.format(*(value if isinstance(value, (tuple, list, pd.Series)) else [value]))]


def places(text: str, place: str) -> list[tuple[int, int]]:
    """Returns where a text stands; of a heading such as "## Limits", where what is below it stands."""
    if not place.startswith("#"):
        return [match.span() for match in re.finditer(pattern(place), text)]
    heads = list(HEADING.finditer(text))
    ends = [head.start() for head in heads[1:]] + [len(text)]
    return [(head.start(), end) for head, end in zip(heads, ends, strict=True) if head.group() == place]


def pattern(text: str) -> str:
    """Returns an expression of a text in which lines may end anywhere, and which is no part of a word or number."""
    return r"(?<![\w,.])" + r"\s+".join(map(re.escape, text.split())) + r"(?!\w|[.,]\d)"


def said(template: str, expected: str, text: str) -> str:
    """Returns what the page says in place of what is expected."""
    parts = string.Formatter().parse(template)
    like = pattern("".join(f"{before}{'' if field is None else '@'}" for before, field, *_ in parts))
    found = [" ".join(match.group().split()) for match in re.finditer(like.replace("@", r"[^|\n]{1,40}?"), text)]
    close = get_close_matches(expected, found, n=1, cutoff=0.0)
    return f"says '{close[0]}'" if close else f"has no text '{template}'"


def figures(text: str) -> Iterator[tuple[int, str]]:
    """Yields where a figure stands, and it: counts, p-values, and the rows of a table whose head says "of 40"."""
    for match in FIGURE.finditer(text):
        yield match.start(), " ".join(match.group().split())
    for head in HEAD.finditer(text):
        start = head.end()
        for line in text[start:].split("\n"):
            if not line.startswith("|"):
                break
            if re.search(r"\d", line):
                yield start, line
            start += len(line) + 1


if __name__ == "__main__":
    main()
