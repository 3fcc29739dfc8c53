"""Typesets paper/paper.md, which has the form of the Journal of Open Source Software.

pip install pypandoc_binary typst
python docs/_tools/paper_pdf.py out/release/files/paper.pdf
"""

from __future__ import annotations

import sys
from pathlib import Path

import pypandoc
import typst

PAPER = Path(__file__).resolve().parents[2] / "paper"


def typeset(out: Path) -> None:
    """Writes the paper to ``out``."""
    source = PAPER / "paper.typ"  # beside the text, because its pictures are found from there
    options = ["--citeproc", "--standalone", f"--bibliography={PAPER / 'paper.bib'}"]
    pypandoc.convert_file(str(PAPER / "paper.md"), "typst", outputfile=str(source), extra_args=options)
    try:
        typst.compile(str(source), output=str(out), root=str(PAPER.parent))
    finally:
        source.unlink()


if __name__ == "__main__":
    typeset(Path(sys.argv[1]))
