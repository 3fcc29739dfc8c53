"""Trains a skill from recorded demonstrations."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from scripts.command_line import command, make_app, run_app
from scripts.options import OutFile, Seed, parse_path

if TYPE_CHECKING:
    from skill.manipulation_skill import ManipulationSkill

app = make_app()


def train(*, demonstrations: Path, out: Path, seed: int) -> ManipulationSkill:
    """Fits a skill to the recordings in a folder, writes it to the file ``out``, and returns it.

    Raises:
        ValueError: if the folder holds no valid demonstrations, or none that inserts.
        OSError: if the file cannot be written.
    """
    from skill.data.demonstration import read_demonstration
    from skill.manipulation_skill import ManipulationSkill
    from systems.outputs.folder_lock import locked_file
    from systems.outputs.output_checks import check_file, named_errors
    from systems.outputs.own_folder import remove_unfinished
    from systems.outputs.recordings import find_recordings
    from systems.reports.result_tables import state_table
    from systems.reports.terminal import busy, console, say
    from systems.runs.exact_states import give_names

    check_file(out, ".npz")
    found = find_recordings(demonstrations)
    if found.note:
        say(found.note)
    recordings = [read_demonstration(path) for path in found.paths]
    with locked_file(out):
        remove_unfinished(out.parent, [out.name])
        with busy(f"learning from {len(recordings)} demonstrations"):
            skill = ManipulationSkill(random_state=seed).fit(recordings)
            give_names(skill, recordings)
        with named_errors(out, "the recordings are unchanged"):
            skill.save(out)
    console.print(state_table(skill))
    say(f"{skill.n_states} contact states, {len(skill.sources_)} remembered samples, in {out}")
    return skill


@app.command()
@command
def main(
    demonstrations: Annotated[
        Path, typer.Option(parser=parse_path, metavar="FOLDER", help="Folder of recordings by `haptic-skill record`.")
    ] = Path("out/demonstrations"),
    out: OutFile = Path("out/skill.npz"),
    seed: Seed = 0,
) -> None:
    """Learns a manipulation skill from recorded demonstrations.

    Reads the recordings that the index of the folder lists, or all of a folder without an index. Discovers the contact
    states in all of them, and fits the local regressions to the actions of the good ones. Writes the skill to the file
    of `--out`. Prints one row per state: how often and how long it was visited, and the probability that it leads to
    insertion. The seed is that of the clustering.

    For example:

        haptic-skill train --demonstrations out/few --out out/few.npz
    """
    train(demonstrations=demonstrations, out=out, seed=seed)


if __name__ == "__main__":
    run_app(app)
