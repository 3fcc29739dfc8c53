"""Trains a skill from recorded demonstrations."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.box import SIMPLE
from rich.table import Table

from skill.data.demonstration import read_demonstrations
from skill.manipulation_skill import ManipulationSkill
from systems.reports.terminal import console, report_errors
from systems.runs.exact_states import give_names

app = typer.Typer(add_completion=False)


def state_table(skill: ManipulationSkill) -> Table:
    """The graph of contact states, a row a state."""
    frame = skill.graph_.to_frame()
    table = Table(
        title="contact states",
        box=SIMPLE,
        padding=(0, 1, 0, 0),
    )
    table.add_column("state", overflow="fold")
    for column in ("visits", "dwell", "phase", "P(ins.)", "next"):
        table.add_column(column, justify="right", min_width=len(column))
    for k, (name, row) in enumerate(zip(skill.state_names(), frame.itertuples(index=False), strict=True)):
        visits, dwell, _, phase, reach, following = row
        table.add_row(f"{k} {name}", str(visits), f"{dwell:.2f}", f"{phase:.2f}", f"{reach:.2f}", str(following))
    table.caption = (
        "dwell in s; phase 0 is the start; P(ins.) of insertion; next: the state that mostly follows on the way"
    )
    return table


@report_errors
def train(*, demonstrations: Path, out: Path, seed: int) -> ManipulationSkill:
    """Reads the folder, fits the skill, saves it."""
    recorded = read_demonstrations(demonstrations)
    with console.status(f"learning from {len(recorded)} demonstrations"):
        skill = ManipulationSkill(random_state=seed).fit(recorded)
        give_names(skill, recorded)
    skill.save(out)
    console.print(state_table(skill))
    console.print(f"{skill.n_states} contact states, {len(skill.sources_)} remembered samples, in {out}")
    return skill


@app.command()
def main(
    demonstrations: Annotated[Path, typer.Option(help="Folder of recorded demonstrations.")] = Path(
        "out/demonstrations"
    ),
    out: Annotated[Path, typer.Option(help="The skill's file.")] = Path("out/skill.npz"),
    seed: Annotated[int, typer.Option(min=0, help="Of the clustering's random draws.")] = 0,
) -> None:
    """Learn a manipulation skill: refine, discover contact states, fit the local regressions, draw the graph.

    The states come from all demonstrations, the actions from the good ones. Prints one row a state: how often it was
    visited, how long, and how probably it leads to insertion.

    Example: python -m scripts.train_skill --demonstrations out/few --out out/few.npz
    """
    train(demonstrations=demonstrations, out=out, seed=seed)


if __name__ == "__main__":
    app()
