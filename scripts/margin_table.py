"""Prints the stability margins of the coupling."""

from __future__ import annotations

from collections.abc import Sequence

from rich.box import SIMPLE_HEAD
from rich.table import Table

from interfaces.terminal import console
from systems.haptics.coupling_margins import Margin


def print_margins(margins: Sequence[Margin]) -> None:
    """Prints the stability conditions of the coupling, one row each: value, limit, and the factor between them."""
    table = Table(title="stability margins of the coupling", box=SIMPLE_HEAD)
    for column in ("condition", "value", "below", "unit", "margin"):
        table.add_column(column, justify="left" if column in ("condition", "unit") else "right")
    for m in margins:
        note = f"x{m.factor:.2g}" if m.required else f"x{m.factor:.2g}, for comparison"
        table.add_row(m.name, f"{m.value:.3g}", f"{m.limit:.3g}", m.unit, note)
    console.print(table)
