"""Records demonstrations by the simulated operator in the virtual environment."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from models.scenario import load_scenario
from scripts.console import console, progress, says_what_is_wrong
from skill.demonstration import write_demonstration
from systems.demonstration_set import demonstrate_all, requests

app = typer.Typer(add_completion=False)


@says_what_is_wrong
def record(*, out: Path, good: int, bad: int, seed: int, scenario: str, jobs: int, overwrite: bool) -> list[Path]:
    """Records ``good`` + ``bad`` demonstrations into the folder ``out``, one Parquet file each; returns their paths."""
    chosen = load_scenario(scenario)
    wanted = requests(good, bad)
    if not wanted:
        raise ValueError("0 demonstrations asked for; expected --good or --bad to be at least 1")
    stale = sorted(out.glob("*.parquet"))
    if stale and not overwrite:
        raise ValueError(f"{out}: holds {len(stale)} recordings already; choose another --out, or give --overwrite")
    for path in stale:
        path.unlink()
    made: list[Path] = []
    with progress("demonstrations", len(wanted)) as advance:
        for request, demonstration in demonstrate_all(chosen, wanted, seed=seed, jobs=jobs):
            path = out / f"{request.number:03d}_{'good' if request.good else 'bad'}_{request.habit}.parquet"
            write_demonstration(demonstration, path)
            made.append(path)
            advance(f"{request.habit}: {demonstration.outcome}, {demonstration.duration:.1f} s")
    console.print(f"{len(made)} demonstrations in {out}")
    return made


@app.command()
def main(
    out: Annotated[Path, typer.Option(help="Folder for the recordings, one .parquet file each.")] = Path(
        "out/demonstrations"
    ),
    good: Annotated[int, typer.Option(min=0, help="Good examples: they insert gently.")] = 24,
    bad: Annotated[int, typer.Option(min=0, help="Bad examples: they jam, slam, give up or over-correct.")] = 6,
    seed: Annotated[int, typer.Option(min=0, help="Another seed, other operators and starts.")] = 0,
    scenario: Annotated[
        str, typer.Option(help="Name of a scenario in models/scenarios, or the path of your own YAML file.")
    ] = "nominal",
    jobs: Annotated[int, typer.Option(min=1, help="Processes to use.")] = 2,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Remove what the folder holds first.")] = False,
) -> None:
    """Record demonstrations of peg-in-hole insertion in the virtual environment.

    A simulated person moves a haptic probe that is coupled to the peg, sees its tilt (late and inexactly) and feels the
    contact. Each demonstration holds the fourteen channels and the action, sampled at 50 Hz.

    Example: python -m scripts.record_demonstrations --good 8 --bad 2 --out out/few
    """
    record(out=out, good=good, bad=bad, seed=seed, scenario=scenario, jobs=jobs, overwrite=overwrite)


if __name__ == "__main__":
    app()
