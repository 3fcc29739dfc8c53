"""The command `haptic-skill`: one subcommand per task."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from interfaces.terminal import report_errors
from scripts import (
    arm,
    correct,
    demo,
    diagram,
    export,
    part,
    practise,
    record,
    replay,
    rig,
    scoreboard,
    states,
    sweep,
    train,
    twin,
)

EXIT_CODES = (
    "Exit codes: 0 success; 1 error, with one line on stderr; 2 wrong usage; 130 interrupted with Ctrl-C;"
    " 143 ended by SIGTERM."
)


def make_app(**settings: Any) -> typer.Typer:
    """A Typer application with the settings of all commands; ``settings`` adds to them."""
    return typer.Typer(
        add_completion=False,
        no_args_is_help=True,
        rich_markup_mode="markdown",
        context_settings={"help_option_names": ["-h", "--help"]},
        pretty_exceptions_show_locals=False,
        **settings,
    )


app = make_app(epilog=EXIT_CODES)
for name, module in {
    **{"demo": demo, "record": record, "train": train, "correct": correct, "rig": rig, "practise": practise},
    **{"replay": replay, "sweep": sweep, "states": states, "scoreboard": scoreboard, "diagram": diagram, "part": part},
    **{"arm": arm, "twin": twin},
}.items():
    app.command(name)(report_errors(module.main))
export_app, import_app = make_app(), make_app()
export_app.command("lerobot")(report_errors(export.export_lerobot))
export_app.command("mcap")(report_errors(export.export_mcap))
import_app.command("lerobot")(report_errors(export.import_lerobot))
import_app.callback()(lambda: None)  # a single command would not need its name
app.add_typer(export_app, name="export", help="Writes recordings for other programs: LeRobot, MCAP.")
app.add_typer(import_app, name="import", help="Reads exported recordings back.")


def print_versions(requested: bool) -> None:
    """Prints the versions and exits, if requested."""
    import platform
    from importlib.util import find_spec

    from experiments.provenance import version_of

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
    an example.
    """


if __name__ == "__main__":
    app(prog_name="haptic-skill")
