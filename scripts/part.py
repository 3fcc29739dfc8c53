"""Makes a scenario of a peg and a hole from CAD."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from scripts.command_line import parse_path, path_option


def main(
    peg: Annotated[Path, typer.Argument(parser=parse_path, metavar="PEG", help="STEP or STL file of the peg.")],
    hole: Annotated[
        Path, typer.Argument(parser=parse_path, metavar="HOLE", help="STEP or STL file of the block with the hole.")
    ],
    out: Annotated[
        Path, path_option("FILE.yaml", "File to write, a scenario; its picture has the same name, and the suffix .png.")
    ] = Path("out/part.yaml"),
    unit: Annotated[
        Literal["mm", "inch", "m"], typer.Option(help="Unit of STL files; STEP files state theirs.")
    ] = "mm",
) -> None:
    """Makes a scenario of a peg and a hole from CAD.

    Both files hold one closed body each, drawn as they are assembled; the peg may be shifted along the axis of the
    hole. Finds axis, depth, cross-section, clearance over depth and angle, lead-in and symmetry, says what the
    simulation leaves out, and refuses parts that are no peg and hole.

    Reads a STEP or STL file of each. Writes a scenario for `haptic-skill record`, `train` and `rig`, and a picture of
    the fit.

    For example:

        haptic-skill part shaft.step block.step --out out/shaft.yaml
        haptic-skill record --scenario out/shaft.yaml
    """
    from experiments.outputs.output_checks import check_file
    from interfaces.reports.part_figure import plot_part
    from interfaces.terminal import say
    from models.cad.pair import fit
    from models.cad.scenario_file import part_text, remarks
    from models.cad.solid_file import read_solid
    from skill.data.files import write_atomically
    from skill.figures.paper_figures import save_figure

    picture = out.with_suffix(".png")
    check_file(out, ".yaml")
    check_file(picture, ".png")
    if picture.exists() and not out.exists():
        raise ValueError(f"--out {out}: its picture would replace {picture}; choose another --out")
    found = fit(read_solid(peg, unit), read_solid(hole, unit))
    text = part_text(found)
    write_atomically(out, text.encode())
    save_figure(plot_part(found), picture)
    for line in remarks(found):
        say(line)
    say(f"open {picture}; use the part with --scenario {out}")
