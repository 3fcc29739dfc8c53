"""Rolls out the skill, collects corrections where it gets stuck, and trains again."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from scripts.command_line import (
    Driver,
    Engine,
    Host,
    Jobs,
    OutFile,
    Overwrite,
    Port,
    ScenarioName,
    Seed,
    SkillFile,
    Verbose,
    counted,
    path_option,
    read_scenario,
)
from scripts.compilation import compile_loop

if TYPE_CHECKING:
    from experiments.corrections import CorrectionPlan, StuckTrial
    from models.scenario import Scenario
    from skill.data.demonstration import Demonstration
    from skill.manipulation_skill import ManipulationSkill
    from skill.policy.query_state import QueryState


def main(
    skill: SkillFile = Path("out/skill.npz"),
    demonstrations: Annotated[Path, path_option("FOLDER", "Recordings that the skill was trained with.")] = Path(
        "out/demonstrations"
    ),
    corrections: Annotated[
        Path | None,
        path_option(
            "FOLDER", "Folder to write the corrections into.", shown="out/corrections, with --live out/live_corrections"
        ),
    ] = None,
    out: OutFile = Path("out/corrected.npz"),
    rounds: Annotated[
        int | None,
        typer.Option(
            min=1, max=100, help="Rounds of practice, corrections and training.", show_default="2, with --live 1"
        ),
    ] = None,
    practice: Annotated[int, typer.Option(min=1, max=10_000, help="Practice trials in each round.")] = 24,
    most: Annotated[
        int | None,
        typer.Option(min=1, max=1000, help="Corrections in each round, at most.", show_default="10, with --live 3"),
    ] = None,
    live: Annotated[
        bool, typer.Option("--live", help="Show the corrections yourself, in the browser, and see the rig do it.")
    ] = False,
    ask: Annotated[
        bool, typer.Option("--ask", help="Only say in which query states the skill gets stuck; write nothing.")
    ] = False,
    json: Annotated[
        Path | None, path_option("FILE", "With --ask: write what it asks for, for `record --live --asked FILE`.")
    ] = None,
    seed: Seed = 0,
    scenario: ScenarioName = "nominal",
    engine: Engine = None,
    jobs: Jobs = 2,
    overwrite: Overwrite = False,
    driver: Driver = None,
    host: Host = None,
    port: Port = None,
    verbose: Verbose = False,
) -> None:
    """Rolls out the skill, collects corrections where it gets stuck, and trains again.

    A skill that imitates gets into query states that nobody has shown. In each round it performs practice trials on
    the rig. Where it backs off for the first time in a trial, the simulated operator takes over in the virtual
    environment, in the same pose and with the same senses as in a demonstration. These corrections become part of the
    demonstrations, from which a skill of the same policy is trained.
    The seed is that of the demonstrations, whose operators take over, of the practice, and of the clustering.

    Reads a skill, its demonstrations and a scenario. Writes the corrections of round k into the folder round_k
    of `--corrections`, and the skill to the file of `--out` after each round. Given again after an interruption, it
    repeats the practice trials and keeps the corrections.

    With `--live` all happens on one page in the browser: the skill practises; you demonstrate from each pose in which
    it was stuck (Space starts, G/B/X, N skips, Q quits); it is trained again; and the rig performs those trials with
    the new skill. Live corrections have a folder of their own, which no command replaces; the skill learns from all.

    For example:

        haptic-skill correct --rounds 1 --practice 12 --out out/quick.npz

        haptic-skill correct --live --out out/better.npz
    """
    if live and (ask or overwrite):
        raise typer.BadParameter("--ask and --overwrite are not for --live: live recordings are never deleted")
    if not live and {driver, host, port} != {None}:
        raise typer.BadParameter("--driver, --host and --port need --live")
    if json is not None and not ask:
        raise typer.BadParameter("--json needs --ask")
    from experiments.corrections import CorrectionPlan
    from interfaces.terminal import say

    plan = CorrectionPlan(
        rounds=rounds or (1 if live else 2), trials=practice, most=most or (3 if live else 10), seed=seed
    )
    if ask:
        ask_only(skill, plan, scenario=scenario, engine=engine, json=json, jobs=jobs)
        return
    folder = corrections or Path("out/live_corrections" if live else "out/corrections")
    files = (skill, demonstrations, folder, out, plan)
    if live:
        page: dict[str, Any] = {"driver": driver, "host": host, "port": port, "verbose": verbose}
        correct_live(*files, scenario=scenario, engine=engine, jobs=jobs, **page)
    else:
        correct_simulated(*files, scenario=scenario, engine=engine, jobs=jobs, overwrite=overwrite)
    if out.is_file():
        say(f"try it: haptic-skill rig --skill {out}")


def ask_only(
    skill: Path, plan: CorrectionPlan, *, scenario: str, engine: str | None, json: Path | None, jobs: int
) -> None:
    """Performs the practice trials of the first round and prints in which query states the skill was stuck.

    Writes them into the file ``json``, if there is one, for `skill.policy.query_state.read_query_states`.
    """
    from experiments.outputs.output_checks import check_file, named_errors, require_distinct
    from interfaces.terminal import say, write_json
    from skill.manipulation_skill import ManipulationSkill

    if json is not None:
        require_distinct({"--skill": skill, "--json": json})
        check_file(json, "query_states.json", option="--json")
    chosen = read_scenario(scenario, engine)
    stuck = practise(chosen, ManipulationSkill.load(skill), plan, 1, jobs=jobs)
    if json is not None:
        with named_errors(json, "the skill is unchanged"):
            write_json(json, [trial.query_state.record() for trial in stuck])
        say(
            f"{counted(len(stuck), 'query state')} in {json};"
            f" demonstrate them: haptic-skill record --live --asked {json}"
        )


def practise(
    scenario: Scenario,
    skill: ManipulationSkill,
    plan: CorrectionPlan,
    number: int,
    *,
    jobs: int,
    after_trial: Callable[[int, int], None] = lambda performed, stuck: None,
) -> list[StuckTrial]:
    """Performs the practice trials of a round and prints where the skill was stuck.

    Args:
        scenario: with ranges.
        skill: that practises.
        plan: of the practice.
        number: of the round, from 1.
        jobs: number of processes.
        after_trial: receives how many trials have been performed, and in how many the skill was stuck.

    Returns:
        The first trials in which the skill was stuck, at most ``plan.most``.
    """
    import numpy as np

    from experiments.corrections import StuckTrial, run_practice
    from interfaces.reports.result_tables import query_state_table
    from interfaces.terminal import progress, say, show

    compile_loop(scenario, skill)
    results, stuck = [], []
    with progress(f"round {number}: practice", plan.trials) as advance:
        for result, query_state in run_practice(scenario, skill, plan.numbers(number), jobs=jobs):
            results.append(result)
            stuck += [StuckTrial(query_state, result)] if query_state is not None else []
            advance(result.reason)
            after_trial(len(results), len(stuck))
    inserted, time = sum(r.inserted for r in results), np.median([r.time for r in results])
    outcome = f"{inserted} of {len(results)} practice trials inserted, median {time:.2f} s"
    say(f"round {number}: {outcome}; stuck in {len(stuck)}")
    if stuck:
        show(query_state_table([trial.query_state for trial in stuck[: plan.most]]))
    return stuck[: plan.most]


def begin(
    skill: Path,
    demonstrations: Path,
    corrections: Path,
    out: Path,
    plan: CorrectionPlan,
    scenario: str,
    engine: str | None = None,
) -> tuple[Scenario, ManipulationSkill, Callable[[Sequence[Path]], ManipulationSkill]]:
    """Reads and checks what both kinds of correction need, and returns it.

    Returns:
        The scenario; the skill; and what trains a skill of its policy, as `scripts.train` does,
        from some folders, into the file ``out``.
    """
    from functools import partial

    from experiments.outputs.output_checks import REPORT_SIZE, check_file, require_distinct
    from experiments.outputs.output_set import find_recordings
    from scripts.train import train
    from skill.manipulation_skill import ManipulationSkill

    chosen, learnt = read_scenario(scenario, engine), ManipulationSkill.load(skill)
    require_distinct({"--demonstrations": demonstrations, "--corrections": corrections})
    check_file(out, ".npz", size=REPORT_SIZE)
    find_recordings(demonstrations)
    return chosen, learnt, partial(train, out=out, seed=plan.seed, policy=learnt.policy)


def save_unchanged(skill: ManipulationSkill, out: Path) -> None:
    """Writes a skill that was never stuck to the file ``out``, and says so."""
    from experiments.outputs.folder_lock import locked_file
    from experiments.outputs.output_checks import named_errors
    from interfaces.terminal import say

    with locked_file(out), named_errors(out, "the skill is unchanged"):
        skill.save(out)
    say(f"no corrections are needed; the same skill is in {out}")


# ------------------------------------------------------------------ simulated operators


def correct_simulated(
    skill: Path,
    demonstrations: Path,
    corrections: Path,
    out: Path,
    plan: CorrectionPlan,
    *,
    scenario: str,
    jobs: int,
    engine: str | None = None,
    overwrite: bool = False,
) -> ManipulationSkill:
    """Rolls out a skill, collects corrections by simulated operators, and trains again; returns the last skill.

    The corrections of round k are in the folder ``corrections``/round_k, a set like that of `haptic-skill record`;
    those that an interrupted call with the same arguments has finished are kept. The skill of each round replaces the
    file ``out``. Folders of later rounds that an earlier call has filled stay; a message names them.

    Raises:
        ValueError: if the skill file, the scenario or the folder of demonstrations is not valid, or a folder of
            corrections holds what may not be replaced (see `experiments.outputs.output_set.check_set`).
        OSError: if another process writes into a folder, or a file cannot be written. What is finished stays.
    """
    from functools import partial

    from experiments.corrections import MAX_ROUNDS, correct, demonstrate_corrections, habit_of
    from experiments.outputs.output_checks import RECORDING_SIZE, check_folder
    from experiments.outputs.output_set import DEMONSTRATIONS, SetIndex, check_set, open_set, read_index
    from experiments.provenance import versions
    from interfaces.terminal import progress, say
    from models.scenario import dump_scenario
    from skill.data.demonstration import write_demonstration

    def folder_of(number: int) -> Path:
        return corrections / f"round_{number}"

    def index_of(query_states: object, count: int) -> SetIndex:
        names = tuple(f"{k:03d}_correction_{habit_of(k)}.parquet" for k in range(count))
        return SetIndex(DEMONSTRATIONS, {**request, "query_states": query_states}, names)

    chosen, learnt, train = begin(skill, demonstrations, corrections, out, plan, scenario, engine)
    request = {"seed": plan.seed, "scenario": dump_scenario(chosen), "versions": versions()}
    folders = [demonstrations]
    check_folder(corrections, size=plan.rounds * plan.most * RECORDING_SIZE)
    for number in range(1, plan.rounds + 1):  # before anything is simulated; other query states are found out later
        old = read_index(folder_of(number))
        index = index_of(None, plan.most) if old is None else index_of(old.request.get("query_states"), len(old.files))
        check_set(folder_of(number), index, overwrite=overwrite)

    def demonstrate(query_states: Sequence[QueryState], number: int) -> bool:
        index = index_of([query_state.record() for query_state in query_states], len(query_states))
        with open_set(folder_of(number), index, overwrite=overwrite) as files:
            if files.finished:
                say(f"{len(files.finished)} of {len(query_states)} corrections are there already")
            missing = {k: query_states[k] for k, name in enumerate(index.files) if name not in files.finished}
            with progress("corrections", len(missing)) as advance:
                for k, shown in demonstrate_corrections(chosen, missing, seed=plan.seed, jobs=jobs):
                    files.write(index.files[k], partial(write_demonstration, shown))
                    advance(f"{shown.reason}, {shown.duration:.1f} s")
            files.complete()
        say(f"{counted(len(query_states), 'correction')} in {folder_of(number)}")
        folders.append(folder_of(number))
        return True

    learnt = correct(
        learnt,
        plan.rounds,
        practise=lambda policy, number: practise(chosen, policy, plan, number, jobs=jobs),
        demonstrate=demonstrate,
        train=lambda policy, stuck, number: train(folders),
    )
    if len(folders) == 1:
        save_unchanged(learnt, out)
    for number in range(len(folders), MAX_ROUNDS + 1):
        if folder_of(number).exists():
            say(f"{folder_of(number)} is of an earlier call; this skill has not learnt from it")
    return learnt


# ------------------------------------------------------------------ live


def correct_live(
    skill: Path,
    demonstrations: Path,
    corrections: Path,
    out: Path,
    plan: CorrectionPlan,
    *,
    scenario: str,
    engine: str | None,
    jobs: int,
    verbose: bool,
    driver: str | None,
    host: str | None,
    port: int | None,
) -> None:
    """Does on one page what `correct_simulated` does, with a person who demonstrates; then shows the rig.

    The arguments are those of the command. Demonstrations take the values that the scenario ``live``, or ``device``
    with a driver or the exact engine, states instead of those of the rig. Kept corrections are written at once into the
    folder ``corrections``, which `open_live_folder` protects; the skill learns from all that are there. A query state
    that a good recording there begins in is not asked for again.

    Raises:
        ValueError: if the skill file, the scenario, the driver or a folder is not valid, or the recordings have not all
            the same peg and hole.
        OSError: if another process writes into the folder, a file cannot be written, or the page cannot listen.
    """
    from contextlib import suppress

    from experiments.corrections import begins_in, correct
    from experiments.outputs.output_set import find_recordings, open_live_folder
    from experiments.self_test import hold_pace
    from interfaces.live.correction_session import CorrectionSession, PersonLeftError
    from interfaces.terminal import say
    from models.scenario import load_scenario
    from scripts.record import announced_page, live_margins, live_scenario_name
    from skill.data.demonstration import read_demonstration
    from skill.data.geometry import common_geometry
    from systems.law.wiring import check_geometry

    chosen, learnt, train = begin(skill, demonstrations, corrections, out, plan, scenario, engine)
    shown_in = load_scenario(live_scenario_name(driver, chosen.contact.engine), defaults=chosen)
    margins = live_margins(shown_in, driver)
    check_geometry(chosen, learnt)
    pace = hold_pace(shown_in)
    shown_in = pace.scenario
    learnt_from = 0  # number of the corrections kept in this session that the last training had

    def recorded() -> list[Demonstration]:
        return [read_demonstration(path) for path in sorted(corrections.glob("*.parquet"))]

    def practise_watched(policy: ManipulationSkill, number: int) -> list[StuckTrial]:
        def show(performed: int, stuck: int) -> None:
            session.show_note(f"the skill practises: {performed} of {plan.trials} trials done, stuck in {stuck}")

        session.begin_work(f"the skill practises: {plan.trials} trials")
        stuck = practise(chosen, policy, plan, number, jobs=jobs, after_trial=show)
        if not stuck:
            session.say(f"never stuck in {plan.trials} practice trials: no corrections are needed")
            if number == 1:
                save_unchanged(policy, out)
        return stuck

    def demonstrate(query_states: Sequence[QueryState], number: int) -> bool:
        good = [d for d in recorded() if d.good]
        missing = [s for s in query_states if not any(begins_in(d, s, shown_in) for d in good)]
        if len(missing) < len(query_states):
            session.say(f"{len(query_states) - len(missing)} of {len(query_states)} query states are shown already")
        if missing:
            session.show_query_states(missing)
        is_shown = any(d.good for d in recorded())
        if not is_shown:
            session.say("nothing was shown: the skill stays as it is")
        return is_shown

    def train_and_show(policy: ManipulationSkill, stuck: Sequence[StuckTrial], number: int) -> ManipulationSkill:
        nonlocal learnt_from
        kept = len(session.kept)
        session.begin_work("the skill learns from what you have shown")
        policy = train([demonstrations, corrections])
        learnt_from = kept
        session.perform_all(stuck, chosen, policy, again=number == plan.rounds)
        return policy

    with open_live_folder(corrections):
        earlier, taught = recorded(), read_demonstration(find_recordings(demonstrations)[0][0])
        common_geometry([(d.source, d.metadata) for d in [taught, *earlier]])
        if earlier:
            good = sum(d.good for d in earlier)
            say(f"{corrections} holds {len(earlier)} corrections, {good} good; the skill learns from them too")
        with announced_page(margins, pace, host=host, port=port, verbose=verbose) as page:
            session = CorrectionSession(
                scenario=shown_in, seed=plan.seed, out=corrections, page=page, announce=say, driver=driver
            )
            with suppress(PersonLeftError):
                correct(learnt, plan.rounds, practise=practise_watched, demonstrate=demonstrate, train=train_and_show)
        say(f"{len(session.kept)} corrections kept in {corrections}")
        if session.kept and learnt_from < len(session.kept):
            say("not all are learnt yet: give the same command again to go on")
