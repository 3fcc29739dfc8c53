"""Performs the trials of a sweep."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from scripts.command_line import command, make_app
from scripts.options import Jobs, parse_path

app = make_app()


@app.command()
@command
def main(
    specification: Annotated[
        Path, typer.Argument(parser=parse_path, metavar="SPEC.yaml", help="What to try; see docs/sweeps.md.")
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            parser=parse_path,
            metavar="RESULTS",
            help="Folder to write into; results that are there are kept.",
            show_default="out/sweeps/SPEC",
        ),
    ] = None,
    engine: Annotated[
        Literal["local", "dask", "ray"],
        typer.Option(help="Where it runs: processes of this machine, a Dask cluster or a Ray cluster."),
    ] = "local",
    address: Annotated[
        str | None,
        typer.Option(
            metavar="TEXT",
            help="Address of a running cluster, such as tcp://node:8786 (Dask) or node:6379 (Ray).",
            show_default="starts one on this machine",
        ),
    ] = None,
    jobs: Jobs = 2,
    plan: Annotated[
        bool, typer.Option("--plan", help="Say how many trials are missing and what they cost; no more.")
    ] = False,
) -> None:
    """Performs many trials: a grid or random design over scenario, training, policies, arms and physics engines.

    Reads a specification. Writes one row for each trial into a Parquet data set in RESULTS/trials, which pandas and
    DuckDB read, and keeps the demonstrations and skills that it makes beside it. A row is identified by all that
    decides it: scenario, skill, seed, versions and code. So a sweep that is given again performs only what is missing,
    after an interruption or an extension; after a changed line of code all trials are, and old rows stay beside the
    new ones. Two sweeps may fill the same folder at the same time.

    For example:

        haptic-skill sweep benchmarks/sweeps/friction.yaml --plan
        haptic-skill sweep benchmarks/sweeps/friction.yaml --jobs 8
    """
    from scripts.sweep_session import sweep

    if address is not None and engine == "local":
        raise ValueError("--address is given, but --engine is local; expected --engine dask or ray")
    sweep(
        path=specification,
        out=out or Path("out/sweeps") / specification.stem,
        backend=engine,
        address=address,
        jobs=jobs,
        plan_only=plan,
    )


if __name__ == "__main__":
    app()
