"""Lets a skill practise, says in which query states it was stuck, has them shown, and trains it again."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from experiments.corrections import StuckTrial, ask, demonstrate_corrections, habit_of
from experiments.outputs.folder_lock import locked_file
from experiments.outputs.output_checks import (
    RECORDING_SIZE,
    REPORT_SIZE,
    check_file,
    check_folder,
    named_errors,
    require_distinct,
)
from experiments.outputs.output_set import check_set, open_set
from experiments.outputs.recordings import find_recordings
from experiments.outputs.set_index import DEMONSTRATIONS, SetIndex, find_set
from experiments.provenance import versions
from interfaces.reports.result_tables import query_state_table
from interfaces.terminal import console, progress, say, write_json
from models.scenario import Scenario, dump_scenario, load_scenario
from scripts.train_session import train
from skill.data.demonstration import write_demonstration
from skill.manipulation_skill import ManipulationSkill
from skill.practice.query_state import QueryState
from skill.states.context_mixture import MAX_CONTEXTS

MAX_ROUNDS, MAX_TRIALS = 100, 10_000  # so that the number of a practice trial is unique


@dataclass(frozen=True)
class CorrectionPlan:
    """How much is practised and shown.

    Attributes:
        rounds: of practice, corrections and training.
        trials: practice trials in each round.
        most: corrections in each round, at most.
        seed: of the demonstrations, whose operators take over, and of the practice trials.
    """

    rounds: int
    trials: int
    most: int
    seed: int

    def numbers(self, round_number: int) -> range:
        """The numbers of the practice trials of a round; the first round is 1."""
        first = (self.seed * MAX_ROUNDS + round_number - 1) * MAX_TRIALS
        return range(first, first + self.trials)


def ask_only(*, skill: Path, plan: CorrectionPlan, scenario: str, json: Path | None, jobs: int) -> list[QueryState]:
    """Performs the practice trials of the first round and prints in which query states the skill was stuck.

    Args:
        skill: file of the skill.
        plan: of the practice; only one round is performed.
        scenario: name or file.
        json: file to write the query states into, for `read_query_states`; None writes nothing.
        jobs: number of processes.

    Raises:
        ValueError: if the skill file or the scenario is not valid, or ``json`` is a file of another kind.
        OSError: if the file cannot be written.
    """
    if json is not None:
        require_distinct({"--skill": skill, "--json": json})
        check_file(json, ".json", option="--json")
    found = practise(load_scenario(scenario), ManipulationSkill.load(skill), plan, 1, jobs=jobs)
    query_states = [stuck.query_state for stuck in found]
    if json is not None:
        with named_errors(json, "the skill is unchanged"):
            write_json(json, [query_state.record() for query_state in query_states])
        say(f"{len(query_states)} query states in {json}")
    return query_states


def correct(
    *,
    skill: Path,
    demonstrations: Path,
    corrections: Path,
    out: Path,
    plan: CorrectionPlan,
    scenario: str,
    jobs: int,
    overwrite: bool,
) -> ManipulationSkill:
    """Practises, has the query states shown in which the skill was stuck, and trains it again, once a round.

    The training is that of `train`, with the policy and the largest number of contexts of the given skill.

    The corrections of round k are in the folder ``corrections``/round_k, which this function fills like any other set
    of demonstrations; those that an interrupted call with the same arguments has finished are kept. The skill of each
    round replaces the file ``out``. A round in which the skill is never stuck is the last. Folders of later
    rounds that an earlier call has filled stay; a message names them.

    Raises:
        ValueError: if the skill file, the scenario or the folder of demonstrations is not valid, or a folder of
            corrections holds what may not be replaced (see `open_set`).
        OSError: if another process writes into a folder, or a file cannot be written. What is finished stays.
    """
    chosen, learnt = load_scenario(scenario), ManipulationSkill.load(skill)
    require_distinct({"--demonstrations": demonstrations, "--corrections": corrections})
    check_file(out, ".npz", size=REPORT_SIZE)
    check_folder(corrections, size=plan.rounds * plan.most * RECORDING_SIZE)
    find_recordings(demonstrations)
    _check_rounds(corrections, plan, chosen, overwrite=overwrite)
    contexts = learnt.metadata_.get("max_contexts", MAX_CONTEXTS)
    folders = [demonstrations]
    for number in range(1, plan.rounds + 1):
        found = practise(chosen, learnt, plan, number, jobs=jobs)
        if not found:
            break
        folder = _folder_of(corrections, number)
        _show(chosen, [stuck.query_state for stuck in found], folder, plan, jobs=jobs, overwrite=overwrite)
        folders.append(folder)
        learnt = train(demonstrations=folders, out=out, seed=plan.seed, max_contexts=contexts, policy=learnt.policy)
    if len(folders) == 1:
        save_unchanged(learnt, out)
    for number in range(len(folders), MAX_ROUNDS + 1):
        if (folder := _folder_of(corrections, number)).exists():
            say(f"{folder} is of an earlier call; this skill has not learnt from it")
    return learnt


def file_name(number: int) -> str:
    """The name of the file of a correction."""
    return f"{number:03d}_correction_{habit_of(number)}.parquet"


def practise(
    scenario: Scenario,
    skill: ManipulationSkill,
    plan: CorrectionPlan,
    number: int,
    *,
    jobs: int,
    tell: Callable[[int, int], None] = lambda performed, stuck: None,
) -> list[StuckTrial]:
    """Performs the practice trials of a round and prints where the skill was stuck.

    Args:
        scenario: with ranges.
        skill: that practises.
        plan: of the practice.
        number: of the round, from 1.
        jobs: number of processes.
        tell: receives after each trial how many have been performed, and in how many the skill was stuck.

    Returns:
        The first trials in which the skill was stuck, at most ``plan.most``.
    """
    results, found = [], []
    with progress(f"round {number}: practice", plan.trials) as advance:
        for result, query_state in ask(scenario, skill, plan.numbers(number), jobs=jobs):
            results.append(result)
            found += [StuckTrial(query_state, result)] if query_state is not None else []
            advance(result.reason)
            tell(len(results), len(found))
    inserted, time = sum(r.inserted for r in results), np.median([r.time for r in results])
    say(
        f"round {number}: {inserted} of {len(results)} practice trials inserted, median {time:.2f} s;"
        f" stuck in {len(found)}"
    )
    asked = found[: plan.most]
    if asked:
        console.print(query_state_table([stuck.query_state for stuck in asked]))
    return asked


def save_unchanged(skill: ManipulationSkill, out: Path) -> None:
    """Writes a skill that was never stuck to the file ``out``, and says so.

    Raises:
        OSError: if it cannot be written.
    """
    with locked_file(out), named_errors(out, "the skill is unchanged"):
        skill.save(out)
    say(f"nothing has to be shown; the same skill is in {out}")


def _folder_of(corrections: Path, number: int) -> Path:
    return corrections / f"round_{number}"


def _check_rounds(corrections: Path, plan: CorrectionPlan, scenario: Scenario, *, overwrite: bool) -> None:
    """Checks, before anything is simulated, that the folders of the rounds may be filled; changes nothing.

    Which query states will be asked for is not known yet; those of a folder may still turn out to be others.

    Raises:
        ValueError: see `open_set`.
    """
    for number in range(1, plan.rounds + 1):
        folder = _folder_of(corrections, number)
        old = find_set(folder, DEMONSTRATIONS)
        asked = None if old is None or old.request is None else old.request.get("query_states")
        files = tuple(file_name(k) for k in range(plan.most)) if old is None else old.files
        request = {**_request(scenario, plan), "query_states": asked}
        check_set(folder, SetIndex(DEMONSTRATIONS, request, files), overwrite=overwrite)


def _request(scenario: Scenario, plan: CorrectionPlan) -> dict[str, Any]:
    """What the corrections of all rounds are made for."""
    return {"seed": plan.seed, "scenario": dump_scenario(scenario), "versions": versions()}


def _show(
    scenario: Scenario,
    query_states: Sequence[QueryState],
    folder: Path,
    plan: CorrectionPlan,
    *,
    jobs: int,
    overwrite: bool,
) -> None:
    """Has query states shown, and stores the corrections in a folder."""
    names = {file_name(number): number for number in range(len(query_states))}
    request = {**_request(scenario, plan), "query_states": [query_state.record() for query_state in query_states]}
    with open_set(folder, SetIndex(DEMONSTRATIONS, request, tuple(names)), overwrite=overwrite) as files:
        if files.finished:
            say(f"{len(files.finished)} of {len(names)} corrections are there already")
        missing = {number: query_states[number] for name, number in names.items() if name not in files.finished}
        with progress("corrections", len(missing)) as advance:
            for number, shown in demonstrate_corrections(scenario, missing, seed=plan.seed, jobs=jobs):
                files.write(file_name(number), partial(write_demonstration, shown))
                advance(f"{shown.reason}, {shown.duration:.1f} s")
        files.complete()
    say(f"{len(names)} corrections in {folder}")
