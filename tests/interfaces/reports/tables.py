"""Reads a table of the terminal as text."""

import io

from rich.console import Console
from rich.table import Table


def text_of(table: Table) -> str:
    """The table as one line, with single spaces between its words."""
    console = Console(file=io.StringIO(), width=140)
    console.print(table)
    return " ".join(console.file.getvalue().split())
