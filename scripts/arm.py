"""Inserts the peg with an arm, real or simulated, through its own protocol."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from scripts.command_line import (
    DefaultSkillFile,
    OptionalScenarioName,
    OutFolder,
    Overwrite,
    Trials,
    find_skill,
    path_option,
    text_option,
)
from scripts.rig import (
    REPLAY,
    REPORT,
    RESULTS,
    RUN,
    copy_of_results,
    finish,
    show_results,
    write_results,
)

if TYPE_CHECKING:
    from interfaces.robots.insertion import ArmSession

RAISED = 0.06
"""Height by which a dry run is above the hole, m."""


def main(
    address: Annotated[str, text_option("HOST", "Address of the arm.")] = "127.0.0.1",
    sensor: Annotated[
        str,
        text_option("URL", "The force/torque sensor: netft://HOST[:PORT[:HTTPPORT]], or arm: for the arm's estimate."),
    ] = "netft://127.0.0.1:49152:8049",
    robot: Annotated[Literal["fr3", "ur5e"], typer.Option(help="Which arm.")] = "fr3",
    skill: DefaultSkillFile = None,
    trials: Trials = 10,
    scenario: OptionalScenarioName = None,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Move in free air only, 60 mm above the hole, and ask for a few pushes.")
    ] = False,
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask before the arm moves, nor for pushes.")] = False,
    out: OutFolder = Path("out/arm"),
    json: Annotated[
        Path | None, path_option("FILE", "JSON file for a copy of results.json, one object per trial.", shown="no copy")
    ] = None,
    overwrite: Overwrite = False,
) -> None:
    """Inserts the peg with an arm that a program moves through its own protocol, and a sensor that people have.

    Turns the tool to find its weight, moves over the hole, takes the bias of the sensor in free air, inserts, and draws
    the peg out again. The skill sees a wrench and a depth, as on the rig. The hole is where the scenario says (its
    arm.hole), within a millimetre. Nothing moves before you have confirmed the address.

    The default is the simulated arm of `haptic-skill twin fr3`. **Not tried on a real arm yet**: read docs/arm.md, and
    begin with `--dry-run`.

    Reads a skill and a scenario. Writes what `haptic-skill rig` writes into the folder of `--out`.

    For example:

        haptic-skill arm --address 172.16.0.2 --sensor netft://192.168.1.1 --dry-run
    """
    import contextlib
    import hashlib
    from functools import partial

    from experiments.outputs.output_checks import RECORDING_SIZE, REPORT_SIZE, check_folder
    from experiments.outputs.output_set import RUNS, SetIndex, open_set
    from experiments.provenance import versions
    from experiments.trial.trial_result import TrialResult
    from interfaces.robots.arm_wrench import ArmWrench
    from interfaces.robots.insertion import ArmSession
    from interfaces.robots.open_arm import open_arm
    from interfaces.sensors.open_sensor import open_sensor
    from interfaces.terminal import progress, say
    from models.scenario import dump_scenario, load_scenario
    from skill.data.outcome import Outcome
    from skill.data.rig_run import write_rig_run
    from skill.manipulation_skill import ManipulationSkill
    from systems.arm.kinematics import ArmKinematics

    skill = find_skill(skill)
    policy, chosen = ManipulationSkill.load(skill), load_scenario(scenario or robot)
    numbers = range(trials)
    request = {
        **{"trials": trials, "scenario": dump_scenario(chosen), "versions": versions()},
        **{"skill": hashlib.sha256(skill.read_bytes()).hexdigest(), "address": address, "sensor": sensor},
    }
    files = (*map(RUN.format, numbers), RESULTS)
    index = SetIndex(RUNS, request, files, reports=(REPORT, *map(REPLAY.format, numbers)))
    if not dry_run:
        check_folder(out, size=trials * (RECORDING_SIZE + REPORT_SIZE))
    copy = copy_of_results(json, out, skill, index) if json is not None else None
    if not yes:
        typer.confirm(
            f"Move the {chosen.carrier} at {address}? Is its way free, and the emergency stop at hand", abort=True
        )
    with contextlib.ExitStack() as stack:
        arm = open_arm(address, chosen)
        stack.callback(arm.close)
        stream = open_sensor(sensor, ArmWrench(arm, ArmKinematics(chosen)))
        stack.callback(stream.close)
        stack.callback(arm.stop)  # first of all, whatever happens
        session = ArmSession(arm, stream, chosen)
        if dry_run and not yes:
            ask_for_pushes(session)
        if sensor != "arm:":  # an arm takes the weight that it was told out of its estimate
            say("the arm turns the tool, to find its weight")
            tool = session.find_tool()
            say(f"{1e3 * tool.mass:.0f} g, {1e3 * abs(tool.centre[2]):.0f} mm from the sensor")
        if dry_run:
            session.approach(RAISED)
            found = session.insert(policy, 0).result
            session.retreat()
            say(f"dry run, {1e3 * RAISED:g} mm above the hole: {found.reason} after {found.time:.1f} s")
            say(f"largest load in free air: {found.peak_measured_load:.1f} N; sensor: {stream.counts().text()}")
            return
        with open_set(out, index, overwrite=overwrite) as runs:
            done: dict[int, TrialResult] = {result.seed: result for result in runs.finished.values()}
            missing = [number for number in numbers if number not in done]
            with progress("insertions", len(missing)) as advance:
                for number in missing:
                    session.approach()
                    ended = session.insert(policy, number)
                    runs.write(RUN.format(number), partial(write_rig_run, ended.record(policy)))
                    done[number] = ended.result
                    write_results(runs, done)
                    if ended.outcome is Outcome.FAILED:
                        raise ConnectionError(f"insertion {number}: {ended.detail}")
                    session.retreat()
                    advance(f"insertion {number}: {ended.result.reason}, {ended.result.time:.1f} s")
            made_by = {"skill": str(skill), "address": address, "sensor": sensor, **versions()}
            results = finish(runs, done, out, copy, made_by=made_by, scenario=dump_scenario(chosen))
        say(f"sensor: {stream.counts().text()}")
    show_results(results, out)


def ask_for_pushes(session: ArmSession) -> None:
    """Has the user push the tool along three axes, and checks what the sensor measures."""
    import numpy as np

    from interfaces.sensors.tool import check_pushes

    pushes = {}
    rest = session.reading_along_base()
    for direction, words in (("+x", "away from the base"), ("+y", "to the left of the base"), ("+z", "upwards")):
        typer.prompt(f"Push the peg {words} ({direction} of the base), hold it, and press Enter", default="")
        pushes[direction] = np.asarray(session.reading_along_base() - rest)
    check_pushes(pushes)
