"""Discovers contact states in recordings of any force/torque sensor, without Drake and without labels."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from scripts.command_line import command, make_app
from scripts.options import Seed, parse_path, parse_text

app = make_app()


@app.command()
@command
def main(
    files: Annotated[
        list[Path],
        typer.Argument(
            parser=parse_path,
            metavar="FILES",
            help="Recordings: .csv .parquet .npz .mcap .db3 files, or folders of a rosbag2 or a LeRobot data set.",
            show_default=False,
        ),
    ],
    out: Annotated[
        Path,
        typer.Option(parser=parse_path, metavar="FILE", help="HTML page to write; replaces an existing page."),
    ] = Path("states.html"),
    labels: Annotated[
        Path | None,
        typer.Option(
            parser=parse_path,
            metavar="FOLDER",
            help="Folder for the tables of states, NAME.states.csv for each of FILES.",
            show_default="beside each of FILES",
        ),
    ] = None,
    columns: Annotated[
        list[str],
        typer.Option(
            parser=parse_text,
            metavar="CHANNEL=COLUMN:UNIT",
            help="Column of a channel, such as fx=ati_1:N; may be given several times. Usual names need none.",
        ),
    ] = [],  # noqa: B006
    trial_column: Annotated[
        str | None,
        typer.Option(
            parser=parse_text,
            metavar="COLUMN",
            help="Column with the trial of each row.",
            show_default="trial, episode, episode_index or run, if it is there",
        ),
    ] = None,
    phase_column: Annotated[
        str | None,
        typer.Option(
            parser=parse_text,
            metavar="COLUMN",
            help="Column with the known phase of each row, to compare with; '' for none.",
            show_default="phase or label, if it is there",
        ),
    ] = None,
    topic: Annotated[
        str | None,
        typer.Option(
            parser=parse_text,
            metavar="TOPIC",
            help="Topic of a rosbag2 or of MCAP files.",
            show_default="the only WrenchStamped",
        ),
    ] = None,
    feature: Annotated[
        str | None,
        typer.Option(
            parser=parse_text, metavar="NAME", help="Feature of a LeRobot data set.", show_default="the one with forces"
        ),
    ] = None,
    rate: Annotated[float, typer.Option(help="Sampling rate, Hz; faster recordings are averaged.")] = 50.0,
    seed: Seed = 0,
) -> None:
    """Discovers the contact states in recordings of a force/torque sensor.

    Reads the recordings, at least two of the same task: several files, or one with a column of trials. They need a time
    and forces, moments if there are any, and no labels. Finds how many contact states there are, and in which of them
    each sample is. If the recordings have phases, it says how well the states agree with them; the learner does not
    see the phases. Prints one row per state.

    Writes one page with the states and every recording over them, which needs neither a network nor this program, and a
    table beside each file, with the columns trial, time, state and probability. The data are never changed. The seed is
    that of the random draws of the learner.

    For example (in a checkout also `python -m scripts.states`):

        haptic-skill states insert_1.csv insert_2.csv insert_3.csv

        haptic-skill states runs.csv --columns fz=load:N --columns time=clock:ms --trial-column part --out runs.html
    """
    from scripts.states_session import ReadOptions, discover_states

    options = ReadOptions(tuple(columns), trial_column, phase_column, topic, feature)
    discover_states(files=files, out=out, labels=labels, options=options, rate=rate, seed=seed)


if __name__ == "__main__":
    app()
