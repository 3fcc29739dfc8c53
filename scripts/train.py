"""Trains a skill from recorded demonstrations."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from scripts.command_line import OutFile, Seed, path_option

if TYPE_CHECKING:
    from skill.manipulation_skill import ManipulationSkill


def main(
    demonstrations: Annotated[
        list[Path],
        path_option(
            "FOLDER", "Folder of recordings by `haptic-skill record` or `correct`; may be given several times."
        ),
    ] = [Path("out/demonstrations")],  # noqa: B006
    out: OutFile = Path("out/skill.npz"),
    seed: Seed = 0,
    policy: Annotated[
        Literal["imitate", "plan"],
        typer.Option(help="Act as the good demonstrations do, or plan the way to the desired next contact state."),
    ] = "imitate",
) -> None:
    """Learns a manipulation skill from recorded demonstrations.

    Reads the recordings that the index of each folder lists, or all of a folder without an index. Discovers the contact
    states in all of them, and fits the local regressions to the actions of the good ones. Writes the skill to the file
    of `--out`. Prints one row per state: how often and how long it was visited, and what follows it. The seed is that
    of the random draws of the learner.

    With `--policy plan` the skill also learns how the forces answer to each motion, and which forces the good
    demonstrations keep to in each state. It then chooses the motion that leads to the desired next state.

    For example:

        haptic-skill train --demonstrations out/few --out out/few.npz
    """
    from interfaces.terminal import say

    train(demonstrations, out=out, seed=seed, policy=policy)
    say(f"try it: haptic-skill rig --skill {out}")


def train(
    demonstrations: Sequence[Path],
    *,
    out: Path,
    seed: int,
    policy: str = "imitate",
) -> ManipulationSkill:
    """Fits a skill to the recordings in some folders, writes it to the file ``out``, and returns it.

    Args:
        demonstrations: the folders.
        out: file of the skill.
        seed: of the random draws of the learner.
        policy: one of ``skill.skill_file.POLICIES``.

    Raises:
        ValueError: if a folder holds no valid demonstrations, none of all inserts, or a folder is given twice.
        OSError: if the file cannot be written.
    """
    from experiments.exact_states import give_names
    from experiments.outputs.folder_lock import locked_file
    from experiments.outputs.output_checks import check_file, named_errors
    from experiments.outputs.output_set import find_recordings
    from interfaces.reports.result_tables import state_table
    from interfaces.terminal import busy, say, show
    from skill.data.demonstration import read_demonstration
    from skill.manipulation_skill import ManipulationSkill

    check_file(out, ".npz")
    folders = [folder.resolve() for folder in demonstrations]
    recordings = []
    for folder in demonstrations:
        if folders.count(folder.resolve()) > 1:
            raise ValueError(f"{folder}: given twice; expected each folder of demonstrations once")
        paths, note = find_recordings(folder)
        if note:
            say(note)
        recordings += [read_demonstration(path) for path in paths]
    with locked_file(out):
        with busy(f"learning from {len(recordings)} demonstrations"):
            skill = ManipulationSkill(policy=policy, random_state=seed).fit(recordings)
            give_names(skill, recordings)
        with named_errors(out, "the recordings are unchanged"):
            skill.save(out)
    show(state_table(skill))
    say(f"{skill.n_states} contact states, {len(skill.sources_)} remembered samples, in {out}")
    return skill
