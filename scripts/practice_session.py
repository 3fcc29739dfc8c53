"""Practises a skill, compares it with the first one, and goes on with both after an interruption."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from experiments.outputs.folder_lock import locked_file
from experiments.outputs.output_checks import RECORDING_SIZE, REPORT_SIZE, check_file, named_errors, require_distinct
from experiments.outputs.output_set import OutputSet, open_set
from experiments.outputs.own_folder import check_own_folder, remove_own_folder, remove_unfinished
from experiments.outputs.set_index import PRACTICE, SetIndex, find_set
from experiments.practice_rounds import Practice, Round, Trial, practise, run_stored, trial_names
from experiments.provenance import versions
from experiments.trial import run_trial, trial_scenario
from experiments.trial_result import TrialResult
from interfaces.reports.practice_report import MEASURES, change_table, check_costs, practice_record, round_table
from interfaces.terminal import console, progress, say, write_json
from models.scenario import Scenario, dump_scenario, load_scenario
from skill.data.outcome import Outcome
from skill.data.rig_run import write_rig_run
from skill.figures.paper_figures import save_figure
from skill.figures.practice_figure import plot_practice
from skill.manipulation_skill import ManipulationSkill
from skill.practice.paired_comparison import PairedChange, paired_change
from systems.control.faults import Fault

BEST = "best.npz"


def run(
    *, skill: Path, out: Path, practice: Practice, held_out: int, held_out_seed: int, scenario: str, jobs: int
) -> None:
    """Practises, compares the best skill with the first one on held-out trials, and writes the three files.

    Until all is complete the finished trials and the best skill so far are in the folder `unfinished_folder`, and a
    file at ``out`` is not changed. A call with the same arguments goes on from there.

    Raises:
        ValueError: if the skill file or the scenario is not valid, two files would have the same name, or the folder
            holds a practice with other arguments, or files that this program did not write.
        OSError: if another process practises into ``out``, or a file cannot be written.
    """
    first = ManipulationSkill.load(skill)
    chosen = load_scenario(scenario)
    outputs = {"the skill": out, "the trials": out.with_suffix(".json"), "the figure": out.with_suffix(".png")}
    require_distinct({"--skill": skill, "--out": out})
    require_distinct(outputs)
    size = (practice.n_trials + 2 * held_out) * RECORDING_SIZE + REPORT_SIZE
    for path, suffix in zip(outputs.values(), (".npz", ".json", ".png"), strict=True):
        check_file(path, suffix, size=size)
    about = {"versions": versions(), "scenario": dump_scenario(chosen), "practice": asdict(practice)}
    digest = hashlib.sha256(skill.read_bytes()).hexdigest()
    request = {**about, "skill": digest, "held_out": held_out, "held_out_seed": held_out_seed}
    held_out_names = {when: held_out_trial_names(when, held_out) for when in ("before", "after")}
    names = (*trial_names(practice), *held_out_names["before"], *held_out_names["after"], BEST)
    index = SetIndex(PRACTICE, request, names)
    work = unfinished_folder(out)
    with locked_file(out):
        remove_unfinished(out.parent, [path.name for path in outputs.values()])
        remove_own_folder(_finished_folder(out), PRACTICE)
        check_own_folder(work, PRACTICE)
        _refuse_other(work, index)
        with open_set(work, index, overwrite=False) as files:
            store = FolderStore(files)
            if files.finished:
                say(f"{len(files.finished)} of {len(index.items)} trials are there already")
            rounds = _practise(chosen, first, practice, jobs, files)
            numbers = range(held_out_seed, held_out_seed + held_out)
            with progress("held-out trials", 2 * held_out) as advance:
                before, after = (
                    _run_held_out(chosen, candidate, numbers, held_out_names[when], store, jobs, advance)
                    for when, candidate in (("before", first), ("after", rounds[-1].skill))
                )
            kept = files.kept()
            changes = _changes(before, after)
            with named_errors(outputs["the trials"], kept):
                write_json(outputs["the trials"], about | practice_record(rounds, before, after, changes))
            tables = [pd.DataFrame([r.record() for r in results]) for results in (before, after)]
            with named_errors(outputs["the figure"], kept):
                save_figure(plot_practice(check_costs(rounds), *tables), outputs["the figure"])
            with named_errors(out, kept):
                rounds[-1].skill.save(out)  # last, so that a failure leaves the old skill
            work.rename(_finished_folder(out))  # at once, so that no half of it can be taken for an unfinished practice
        remove_own_folder(_finished_folder(out), PRACTICE)
    console.print(round_table(rounds))
    console.print(change_table(changes, before, after))
    say(f"skill in {out}; all trials in {outputs['the trials']}; figure in {outputs['the figure']}")


class FolderStore:
    """A `TrialStore` in an output set."""

    def __init__(self, files: OutputSet) -> None:
        self._files = files

    def load(self, name: str) -> Trial | None:
        """Returns the trial that was saved under a name, or None."""
        run = self._files.finished.get(name)
        if run is None:
            return None
        metadata = dict(run.metadata)
        return exact_result(metadata.pop("exact")), replace(run, metadata=metadata)

    def save(self, name: str, trial: Trial) -> None:
        """Saves a trial with its result in full precision."""
        result, run = trial
        exact = asdict(result) | {"outcome": result.outcome.value, "fault": result.fault.value}
        self._files.write(name, partial(write_rig_run, replace(run, metadata={**run.metadata, "exact": exact})))


def exact_result(values: dict[str, Any]) -> TrialResult:
    """Returns the result whose fields are stored as JSON values."""
    pitch, yaw = values["tilt"]
    return TrialResult(
        **values
        | {"tilt": (pitch, yaw), "states": tuple(values["states"])}
        | {"outcome": Outcome(values["outcome"]), "fault": Fault(values["fault"])}
    )


def unfinished_folder(out: Path) -> Path:
    """The folder of the practice that will write ``out``, until it is complete."""
    return out.with_name(f"{out.name}.unfinished")


def held_out_trial_names(when: str, held_out: int) -> list[str]:
    """The names of the held-out trials before or after the practice."""
    return [f"held_out_{when}_{k:04d}.parquet" for k in range(held_out)]


def _finished_folder(out: Path) -> Path:
    return out.with_name(f".{out.name}.finished")


def _refuse_other(work: Path, index: SetIndex) -> None:
    """Refuses to mix with an interrupted practice that has other arguments."""
    old = find_set(work, PRACTICE)
    if old is not None and old.request != index.request and old.finished(work):
        raise ValueError(
            f"{work}: holds {len(old.finished(work))} trials {old.difference(index.request or {})}; give its command"
            " again to go on with it, remove the folder, or choose another --out"
        )


def _practise(
    scenario: Scenario, skill: ManipulationSkill, practice: Practice, jobs: int, files: OutputSet
) -> list[Round]:
    """Practises; the best skill so far is on disk after each round."""
    rounds: list[Round] = []
    with progress("practice", practice.n_trials) as advance:
        for r in practise(scenario, skill, practice, jobs=jobs, advance=advance, store=FolderStore(files)):
            rounds.append(r)
            files.write(BEST, r.skill.save)
            cost = np.mean(r.check.costs)
            say(f"round {len(rounds) - 1}: cost of the check {cost:.2f} s; best skill so far in {files.path(BEST)}")
    return rounds


def _run_held_out(
    scenario: Scenario,
    skill: ManipulationSkill,
    numbers: range,
    names: Sequence[str],
    store: FolderStore,
    jobs: int,
    advance: Callable[[str], None],
) -> list[TrialResult]:
    tasks = [partial(run_trial, trial_scenario(scenario, number=n), skill, seed=n) for n in numbers]
    return [result for result, _ in run_stored(tasks, names, store, jobs=jobs, advance=advance)]


def _changes(before: Sequence[TrialResult], after: Sequence[TrialResult]) -> dict[str, PairedChange]:
    """The change of each measure; one that cannot be compared is left out, with a message."""
    changes = {}
    for name, (field, title) in MEASURES.items():
        try:
            changes[name] = paired_change([getattr(r, field) for r in before], [getattr(r, field) for r in after])
        except ValueError as error:
            say(f"{title} is not compared ({error})")
    return changes
