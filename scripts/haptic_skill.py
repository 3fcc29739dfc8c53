"""The command `haptic-skill`: one subcommand per task."""

from __future__ import annotations

import platform
from importlib.util import find_spec
from typing import Annotated

import typer

from experiments.provenance import version_of
from scripts import correct, demo, diagram, export, practise, record, replay, rig, scoreboard, states, sweep, train
from scripts.command_line import make_app

EXIT_CODES = (
    "Exit codes: 0 success; 1 error, with one line on stderr; 2 wrong usage; 130 interrupted with Ctrl-C;"
    " 143 ended by SIGTERM."
)

app = make_app(no_args_is_help=True, epilog=EXIT_CODES)
app.command("demo")(demo.main)
app.command("record")(record.main)
app.command("train")(train.main)
app.command("correct")(correct.main)
app.command("rig")(rig.main)
app.command("practise")(practise.main)
app.command("replay")(replay.main)
app.command("sweep")(sweep.main)
app.command("states")(states.main)
app.command("scoreboard")(scoreboard.main)
app.command("diagram")(diagram.main)
app.add_typer(export.app, name="export", help="Writes recordings for other programs: LeRobot, MCAP.")
app.add_typer(export.import_app, name="import", help="Reads exported recordings back.")


def print_versions(requested: bool) -> None:
    """Prints the versions and exits, if requested."""
    if requested:
        drake = version_of("drake") if find_spec("pydrake") else "not installed (install haptic-skill[sim])"
        print(f"haptic-skill {version_of('haptic-skill')}, Python {platform.python_version()}, Drake {drake}")
        raise typer.Exit


@app.callback()
def haptic_skill(
    version: Annotated[
        bool,
        typer.Option(
            "--version",
            is_eager=True,
            callback=print_versions,
            help="Print the versions of this package, Python and Drake, and exit.",
        ),
    ] = False,
) -> None:
    """Learns peg-in-hole insertion from haptic demonstrations, and inserts on a simulated rig.

    The usual order is record, train, correct, rig; `haptic-skill demo` runs them all. `haptic-skill states` needs only
    recordings of a force/torque sensor. Every option has a default; `haptic-skill COMMAND -h` explains a command with
    an example. In a checkout, `python -m scripts.rig` and the other modules of `scripts` are the same commands.
    """


def main() -> None:
    """Entry point of `haptic-skill`."""
    app()


if __name__ == "__main__":
    main()
