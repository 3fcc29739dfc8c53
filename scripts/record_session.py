"""Records a set of demonstrations into a folder, and goes on with it after an interruption."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path

from experiments.demonstration_set import Request, demonstrate_all, requests
from experiments.outputs.output_checks import RECORDING_SIZE, REPORT_SIZE, check_folder
from experiments.outputs.output_set import open_set
from experiments.outputs.set_index import DEMONSTRATIONS, SetIndex
from experiments.provenance import versions
from interfaces.terminal import progress, say
from models.scenario import Scenario, dump_scenario, load_scenario
from scripts.margin_table import print_margins
from skill.data.demonstration import Demonstration, write_demonstration
from skill.figures.demonstration_figure import plot_set
from skill.figures.paper_figures import save_figure
from systems.haptics.coupling_margins import Margin, require_margins

FIGURE = "demonstrations.png"


@dataclass(frozen=True)
class RecordingPlan:
    """What a recording will do, checked.

    Attributes:
        scenario: with ranges.
        requests: the requested demonstrations by the names of their files.
        margins: stability margins of the coupling.
        index: of the folder.
    """

    scenario: Scenario
    requests: dict[str, Request]
    margins: list[Margin]
    index: SetIndex


def plan_recording(*, out: Path, good: int, bad: int, seed: int, scenario: str) -> RecordingPlan:
    """Checks the arguments of `record` and changes nothing.

    Raises:
        ValueError: if no demonstration is requested, or the scenario is not valid or not stable.
        OSError: if the folder ``out`` cannot be written or has too little room.
    """
    chosen = load_scenario(scenario)
    requested = {request.file_name: request for request in requests(good, bad)}
    margins = require_margins(chosen)
    check_folder(out, size=len(requested) * RECORDING_SIZE + REPORT_SIZE)
    request = {"good": good, "bad": bad, "seed": seed, "scenario": dump_scenario(chosen), "versions": versions()}
    return RecordingPlan(
        chosen, requested, margins, SetIndex(DEMONSTRATIONS, request, tuple(requested), reports=(FIGURE,))
    )


def record(*, out: Path, good: int, bad: int, seed: int, scenario: str, jobs: int, overwrite: bool) -> list[Path]:
    """Records ``good`` + ``bad`` demonstrations into the folder ``out``, and returns the paths of their files.

    Demonstrations that an interrupted call with the same arguments has finished are kept and not repeated.

    Raises:
        ValueError: if no demonstration is requested, the scenario is not valid or not stable, or the folder holds what
            may not be replaced (see `open_set`).
        OSError: if another process writes into the folder, or a file cannot be written. What is finished stays.
    """
    plan = plan_recording(out=out, good=good, bad=bad, seed=seed, scenario=scenario)
    chosen, requested = plan.scenario, plan.requests
    with open_set(out, plan.index, overwrite=overwrite) as files:
        print_margins(plan.margins)
        if files.damaged:
            say(f"cannot be read and are recorded again: {', '.join(files.damaged)}")
        if files.finished:
            say(f"{len(files.finished)} of {len(requested)} demonstrations are there already")
        done: dict[str, Demonstration] = dict(files.finished)
        missing = [request for name, request in requested.items() if name not in done]
        with progress("demonstrations", len(missing)) as advance:
            for request, demonstration in demonstrate_all(chosen, missing, seed=seed, jobs=jobs):
                name = request.file_name
                files.write(name, partial(write_demonstration, demonstration))
                done[name] = demonstration
                advance(f"{request.habit}: {demonstration.reason}, {demonstration.duration:.1f} s")
        files.complete()
        ordered = [done[name] for name in requested]
        figure = plot_set(ordered, rough_force=chosen.recorder.rough_force)
        files.write(FIGURE, partial(save_figure, figure))
        say(f"{len(ordered)} demonstrations in {out}; outcomes, forces and times in {FIGURE}")
        lowest = 1e3 * min(d.metadata["lowest_probe_energy_J"] for d in ordered)
        say(f"minimum energy at the probe's port: {lowest:.3f} mJ (negative: the display produced energy)")
        return [out / name for name in requested]
