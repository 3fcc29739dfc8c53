"""Trains a skill from folders of recordings, and writes it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from experiments.exact_states import give_names
from experiments.outputs.folder_lock import locked_file
from experiments.outputs.output_checks import check_file, named_errors
from experiments.outputs.own_folder import remove_unfinished
from experiments.outputs.recordings import find_recordings
from interfaces.reports.result_tables import context_line, state_table
from interfaces.terminal import busy, console, say
from skill.data.demonstration import read_demonstration
from skill.manipulation_skill import ManipulationSkill
from skill.states.context_mixture import MAX_CONTEXTS, ContextMixture


def train(
    *,
    demonstrations: Sequence[Path],
    out: Path,
    seed: int,
    max_contexts: int = MAX_CONTEXTS,
    policy: str = "imitate",
) -> ManipulationSkill:
    """Fits a skill to the recordings in some folders, writes it to the file ``out``, and returns it.

    Args:
        demonstrations: the folders.
        out: file of the skill.
        seed: of the random draws of the learner.
        max_contexts: largest number of contexts that is discovered.
        policy: one of ``skill.skill_schema.POLICIES``.

    Raises:
        ValueError: if a folder holds no valid demonstrations, none of all inserts, or a folder is given twice.
        OSError: if the file cannot be written.
    """
    check_file(out, ".npz")
    folders = [folder.resolve() for folder in demonstrations]
    for folder in demonstrations:
        if folders.count(folder.resolve()) > 1:
            raise ValueError(f"{folder}: given twice; expected each folder of demonstrations once")
    recordings = []
    for folder in demonstrations:
        found = find_recordings(folder)
        if found.note:
            say(found.note)
        recordings += [read_demonstration(path) for path in found.paths]
    with locked_file(out):
        remove_unfinished(out.parent, [out.name])
        with busy(f"learning from {len(recordings)} demonstrations"):
            contexts = ContextMixture(max_contexts=max_contexts, random_state=seed)
            skill = ManipulationSkill(contexts=contexts, policy=policy, random_state=seed).fit(recordings)
            skill.metadata_["max_contexts"] = max_contexts
            give_names(skill, recordings)
        with named_errors(out, "the recordings are unchanged"):
            skill.save(out)
    console.print(state_table(skill))
    say(context_line(skill))
    say(f"{skill.n_states} contact states, {len(skill.sources_)} remembered samples, in {out}")
    return skill
