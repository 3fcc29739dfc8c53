"""Improves a skill by its own trials on the rig, and compares it with the first skill on held-out trials."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from scripts.command_line import (
    MAX_SEED,
    Engine,
    Jobs,
    OutFile,
    ScenarioName,
    Seed,
    SkillFile,
    read_scenario,
    trial_numbers,
)
from scripts.compilation import compile_loop

if TYPE_CHECKING:
    from experiments.outputs.output_set import OutputSet
    from experiments.practice_rounds import Perform, Trial
    from experiments.scoreboard.paired_statistics import PairedChange
    from experiments.trial.trial_result import TrialResult

MAX_NUMBER = 10_000  # of rounds and trials
BEST = "best.npz"
HELD_OUT = "held_out_{}_{:04d}.parquet"
"""Name of a held-out trial: "before" or "after" the practice, and its place."""


def main(
    skill: SkillFile = Path("out/skill.npz"),
    out: OutFile = Path("out/practised.npz"),
    rounds: Annotated[int, typer.Option(min=1, max=MAX_NUMBER, help="Number of rounds of practice.")] = 4,
    starts: Annotated[
        int,
        typer.Option(
            min=1, max=MAX_NUMBER, help="Starts per round; each is tried with a perturbation and its opposite."
        ),
    ] = 8,
    checks: Annotated[
        int,
        typer.Option(min=1, max=MAX_NUMBER, help="Trials on which a new skill must be better than the one before."),
    ] = 8,
    held_out: Annotated[
        int, typer.Option(min=2, max=MAX_NUMBER, help="Trials on which both skills are compared at the end.")
    ] = 20,
    held_out_seed: Annotated[
        int,
        typer.Option(
            min=0, max=MAX_SEED, help="Number of the first held-out trial, as `--seed` of `haptic-skill rig`."
        ),
    ] = 1000,
    seed: Seed = 0,
    scenario: ScenarioName = "nominal",
    engine: Engine = None,
    jobs: Jobs = 2,
) -> None:
    """Improves a skill by its own trials on the simulated rig.

    In each round the skill varies its turns and its feed, weights the trials by how much better they went than
    expected, and keeps the new skill only if it is better on separate trials. At the end the first and the last skill
    are compared on held-out trials, which share no random draw with practice or demonstrations. The seed is that of
    the practice; held-out trial k uses held-out seed + k.

    Reads a skill and a scenario. Writes the practised skill to the file of `--out`, and beside it a .json with every
    trial and a .png figure. Until then the finished trials and the best skill so far are in a folder beside it, whose
    name ends in .unfinished; given again after an interruption, it goes on from there.

    For example:

        haptic-skill practise --rounds 2 --starts 4 --held-out 10 --out out/quick.npz
    """
    import hashlib
    from dataclasses import asdict
    from functools import partial

    import numpy as np
    import pandas as pd

    from experiments.outputs.folder_lock import locked_file, remove_unfinished
    from experiments.outputs.output_checks import (
        RECORDING_SIZE,
        REPORT_SIZE,
        check_file,
        named_errors,
        require_distinct,
    )
    from experiments.outputs.output_set import PRACTICE, SetIndex, open_set, read_index, remove_set
    from experiments.practice_rounds import Practice, improve, trial_names
    from experiments.provenance import versions
    from experiments.trial.run_trial import run_trial
    from experiments.trial.trial_set import trial_scenario
    from interfaces.reports.practice_report import change_table, check_costs, practice_record, round_table
    from interfaces.terminal import progress, say, show, write_json
    from models.scenario import dump_scenario
    from skill.figures.paper_figures import save_figure
    from skill.figures.practice_figure import plot_practice
    from skill.manipulation_skill import ManipulationSkill

    numbers = trial_numbers(held_out_seed, held_out, option="--held-out-seed")
    first, chosen = ManipulationSkill.load(skill), read_scenario(scenario, engine)
    practice = Practice(rounds=rounds, starts=starts, checks=checks, seed=seed)
    trials_file, figure_file = out.with_suffix(".json"), out.with_suffix(".png")
    require_distinct({"--skill": skill, "--out": out})
    require_distinct({"the skill": out, "the trials": trials_file, "the figure": figure_file})
    for path, suffix in ((out, ".npz"), (trials_file, "practice.json"), (figure_file, ".png")):
        check_file(path, suffix, size=(practice.n_trials + 2 * held_out) * RECORDING_SIZE + REPORT_SIZE)
    about = {"versions": versions(), "scenario": dump_scenario(chosen), "practice": asdict(practice)}
    digest = hashlib.sha256(skill.read_bytes()).hexdigest()
    request = {**about, "skill": digest, "held_out": held_out, "held_out_seed": held_out_seed}
    held_out_names = [HELD_OUT.format(when, k) for when in ("before", "after") for k in range(held_out)]
    index = SetIndex(PRACTICE, request, (*trial_names(practice), *held_out_names, BEST))
    work, finished = out.with_name(f"{out.name}.unfinished"), out.with_name(f".{out.name}.finished")
    with locked_file(out):
        remove_unfinished(out.parent, [trials_file.name, figure_file.name])
        remove_set(finished)
        old = read_index(work)
        if old is not None and old.kind is PRACTICE and old.request != request and old.finished(work):
            raise ValueError(
                f"{work}: holds {len(old.finished(work))} trials {old.difference(request)}; give its command again to"
                " go on with it, remove the folder, or choose another --out"
            )
        if old != index:
            remove_set(work)
        with open_set(work, index, overwrite=False) as files:
            if files.finished:
                say(f"{len(files.finished)} of {len(index.items)} trials are there already")
            compile_loop(chosen, first)
            done = []
            with progress("practice", practice.n_trials) as advance:
                for r in improve(chosen, first, practice, perform=kept_trials(files, jobs, advance)):
                    done.append(r)
                    files.write(BEST, r.skill.save)
                    cost = f"cost of the check {np.mean(r.check.costs):.2f} s"
                    say(f"round {len(done) - 1}: {cost}; best skill so far in {files.path(BEST)}")
            tasks = [
                partial(run_trial, trial_scenario(chosen, number=number), policy, seed=number)
                for policy in (first, done[-1].skill)
                for number in numbers
            ]
            with progress("held-out trials", 2 * held_out) as advance:
                runs = kept_trials(files, jobs, advance)(dict(zip(held_out_names, tasks, strict=True)))
            results = [result for result, _ in runs]
            before, after = results[:held_out], results[held_out:]
            changes = compare(before, after)
            with named_errors(trials_file, files.kept()):
                write_json(trials_file, about | practice_record(done, before, after, changes))
            tables = [pd.DataFrame([r.record() for r in part]) for part in (before, after)]
            with named_errors(figure_file, files.kept()):
                save_figure(plot_practice(check_costs(done), *tables), figure_file)
            with named_errors(out, files.kept()):
                done[-1].skill.save(out)  # last, so that a failure leaves the old skill
            work.rename(finished)  # at once, so that no half of it can be taken for an unfinished practice
        remove_set(finished)
    show(round_table(done))
    show(change_table(changes, before, after))
    say(f"all trials in {trials_file}; skill in {out}")
    say(f"open {figure_file}; try the skill: haptic-skill rig --skill {out}")


def kept_trials(files: OutputSet, jobs: int, advance: Callable[[str], None]) -> Perform:
    """Returns what performs trials and keeps each in a folder as it ends; it does not repeat those that are there."""
    from dataclasses import asdict, replace
    from functools import partial

    from experiments.worker_pool import run_in_processes
    from skill.data.rig_run import write_rig_run

    def perform(tasks: Mapping[str, Callable[[], Trial]]) -> list[Trial]:
        done: dict[str, Trial] = {}
        for name in tasks:
            if name in files.finished:
                run = files.finished[name]
                metadata = dict(run.metadata)
                done[name] = exact_result(metadata.pop("exact")), replace(run, metadata=metadata)
                advance(f"{name}: there already")
        missing = {name: task for name, task in tasks.items() if name not in done}
        for name, (result, run) in zip(missing, run_in_processes(missing.values(), jobs=jobs), strict=True):
            exact = asdict(result) | {"outcome": result.outcome.value, "fault": result.fault.value}
            files.write(name, partial(write_rig_run, replace(run, metadata={**run.metadata, "exact": exact})))
            done[name] = result, run
            advance(f"{name.removesuffix('.parquet').replace('_', ' ')}: {result.reason}, {result.time:.1f} s")
        return [done[name] for name in tasks]

    return perform


def exact_result(values: dict[str, Any]) -> TrialResult:
    """Returns the result whose fields are stored as JSON values, in full precision."""
    from experiments.trial.trial_result import TrialResult
    from skill.data.outcome import Outcome
    from systems.law.faults import Fault

    pitch, yaw = values["tilt"]
    return TrialResult(
        **values
        | {"tilt": (pitch, yaw), "states": tuple(values["states"])}
        | {"outcome": Outcome(values["outcome"]), "fault": Fault(values["fault"])}
    )


def compare(before: Sequence[TrialResult], after: Sequence[TrialResult]) -> dict[str, PairedChange]:
    """The change of each measure; one that cannot be compared is left out, with a message."""
    from experiments.scoreboard.paired_statistics import paired_change
    from interfaces.reports.practice_report import MEASURES
    from interfaces.terminal import say

    changes = {}
    for name, (field, title) in MEASURES.items():
        try:
            changes[name] = paired_change([getattr(r, field) for r in before], [getattr(r, field) for r in after])
        except ValueError as error:
            say(f"{title} is not compared ({error})")
    return changes
