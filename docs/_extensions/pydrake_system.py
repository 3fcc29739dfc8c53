"""The directive ``.. pydrake_system::`` of docstrings: the ports of a LeafSystem as a table."""

from __future__ import annotations

from typing import Any

import yaml
from docutils import nodes
from docutils.parsers.rst import Directive
from sphinx.application import Sphinx


class PydrakeSystem(Directive):
    """Shows the inputs, the name and the outputs of a system."""

    has_content = True

    def run(self) -> list[nodes.Node]:
        """Returns a table with one row: inputs, name, outputs."""
        ports = yaml.safe_load("\n".join(self.content))
        cells = [ports.get("input_ports") or [], [ports["name"]], ports.get("output_ports") or []]
        group = nodes.tgroup(cols=3)
        group += [nodes.colspec(colwidth=1) for _ in cells]
        group += nodes.thead("", row([["input ports"], ["system"], ["output ports"]]))
        group += nodes.tbody("", row([[str(name) for name in cell] for cell in cells]))
        return [nodes.table("", group, classes=["ports"])]


def row(cells: list[list[str]]) -> nodes.row:
    """A row of a table, whose cells have a line for each text."""
    found = nodes.row()
    for lines in cells:
        found += nodes.entry("", *(nodes.paragraph("", "", nodes.literal(text=line)) for line in lines))
    return found


def setup(app: Sphinx) -> dict[str, Any]:
    """Registers the directive."""
    app.add_directive("pydrake_system", PydrakeSystem)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
