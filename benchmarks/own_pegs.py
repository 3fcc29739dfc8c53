"""Pegs of any size that state their geometry only: do the laws of theory hold, and is the skill taught there inserted?

    python -m benchmarks.own_pegs OUT.csv [--seed 3] [--number 60] [--corners] [--trials 10] [--jobs 2]

A Latin hypercube over the logarithms of radius (3 to 30 mm), clearance C/r (0.002 to 0.2) and depth (0.5 to 5 radii);
``--corners`` takes the eight corners of that range instead. A scenario states these sizes, and the exact engine. A row
is written as soon as it is measured, and a file that has some is continued. Design, demonstrations and trials are drawn
from the seed: 1 and 2 chose the rules of `models.clearance`, 3 judges them and gave the radius that `record` warns of.

Laws at a friction of 0.2 in the exact engine, each where it applies (otherwise empty):

- depth: error of the depth at which a peg rests that is pushed into two-point contact above the floor, with 5 N or, at
  a clearance below the nominal one, less in proportion: then the bodies are rigid (`contact_theory.two_point_depth`);
- slide, jam: error of the axial force of a slowly sliding peg, and share of 20 loads, at least 5 % from the edges of
  Whitney's jamming diagram, that slid or stuck as predicted; at half the depth of the bore, if the tilt of two-point
  contact there, which the diagram leaves out, is at most a twentieth of the friction angle, and 2 mm are left to slide;
- wedge: error of the smallest tilt that wedges, to the exact planar condition;
- laws: whether depth and wedge are within 2 %, slide within 6 %, and jam is at least 0.9.

Skill: taught as by the defaults of `haptic-skill record` and `correct`. demonstrated is the number of demonstrations:
24 good ones, and 6 bad ones unless no bad habit does harm; corrected is that of corrections, of up to two rounds of 24
practice trials (`experiments.corrections`); inserted is of the trials; time (s) and load (N) are medians; ended says
how the others ended. warned is what `haptic-skill record` says before it begins. cpu is in s.
"""

from __future__ import annotations

import itertools
import time
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pandas as pd
import typer
from scipy.stats import qmc

from benchmarks.command_line import run
from benchmarks.physics.contact_measurements import (
    CRAWLING,
    PRESSED,
    PegTheory,
    converged,
    crawl,
    jamming_trials,
    measured_wedging_tilt,
    press,
)
from benchmarks.physics.exact_probe import ExactProbe
from experiments.corrections import CorrectionPlan, StuckTrial, correct, demonstrate_corrections, run_practice
from experiments.demonstration_set import demonstrate_all, requests
from experiments.trial.run_trial import run_trials
from interfaces.terminal import progress, say
from models.clearance import TRIED, doubts
from models.contact_theory import (
    exact_wedging_tilt,
    largest_entry_tilt,
    two_point_depth,
    two_point_tilt,
)
from models.scenario import Scenario, parse_scenario
from skill.arrays import Array
from skill.data.demonstration import Demonstration
from skill.data.outcome import Outcome
from skill.manipulation_skill import ManipulationSkill
from skill.practice.query_state import QueryState

LEAST, MOST = np.log(list(TRIED.values())).T
"""Logarithms of radius (m), C/r and depth/r."""

FRICTION, LOADS = 0.2, 20
PUSH, FULL_PUSH, CONTACT, ROOM = 5.0, 50e-6, 0.2, 2e-3
"""Push, N, and clearance from which it is full, m; force in each contact of a sliding peg, N; way that it needs, m."""

SMALL_TILT = 0.05
"""Tilt over the friction angle that Whitney's jamming diagram may leave out."""

GOOD, BAD = 24, 6
PRACTICE = {"rounds": 2, "trials": 24, "most": 10}

RUN = 1000
"""Demonstrations and trials of design s have the seeds from s RUN on, those of scenario k from there + k."""


def sizes_of(seed: int, number: int) -> Array:
    """Returns the design, (n, 3): radius (m), C/r and depth/r."""
    return np.asarray(np.exp(qmc.scale(qmc.LatinHypercube(3, seed=seed).random(number), LEAST, MOST)))


def corners() -> Array:
    """Returns the corners of the range, (8, 3)."""
    return np.asarray(np.exp(list(itertools.product(*zip(LEAST, MOST, strict=True)))))


def scenario_of(radius: float, ratio: float, depth: float) -> Scenario:
    """Returns the scenario of a file that states radius (m), C/r and depth/r, and nothing else."""
    sizes = f"peg_radius: {radius:.9g}, hole_radius: {radius * (1.0 + ratio):.9g}, hole_depth: {radius * depth:.9g}"
    return parse_scenario(f"geometry: {{{sizes}}}", "own peg", engine="exact")


def laws(scenario: Scenario, seed: int) -> dict[str, Any]:
    """Returns the errors of the laws of theory."""
    sizes, g = PegTheory.of(scenario), scenario.geometry
    size = {"peg_radius": sizes.r, "hole_radius": sizes.R}
    bore, largest = g.hole_depth - g.chamfer, largest_entry_tilt(**size)
    found: dict[str, Any] = {"depth": np.nan, "slide": np.nan, "jam": np.nan, "wedge": np.nan}
    tilts, middle = np.linspace(0.3, 0.9, 61) * largest, 0.5 * bore
    off_floor = tilts[two_point_depth(tilts, **size) + sizes.r * np.sin(tilts) < 0.95 * bore]
    if len(off_floor) > 0:
        probe, push = ExactProbe(converged(scenario, FRICTION), **PRESSED), PUSH * min(1.0, g.clearance / FULL_PUSH)
        found["depth"] = press(probe, sizes, g.assembly, float(off_floor[0]), push)["depth_error"]
    if two_point_tilt(middle, **size) < SMALL_TILT * np.arctan(FRICTION) and middle > ROOM:
        probe, moment = ExactProbe(converged(scenario, FRICTION), **CRAWLING), CONTACT * middle
        predicted, measured = crawl(probe, sizes, FRICTION, lateral=0.0, moment=moment, depth=middle)
        found["slide"] = float(np.mean(measured)) / predicted - 1.0
        loads = jamming_trials(scenario, FRICTION, depth=middle, count=LOADS, seed=seed, engine=ExactProbe)
        found["jam"] = loads.agreement()
    exact = exact_wedging_tilt(**size, friction=FRICTION)
    if two_point_tilt(bore, **size) < exact < 0.8 * largest:
        found["wedge"] = measured_wedging_tilt(scenario, FRICTION, engine=ExactProbe)[0] / exact - 1.0
    wrong = [abs(found[name]) > bound for name, bound in (("depth", 0.02), ("wedge", 0.02), ("slide", 0.06))]
    found["laws"] = not any(wrong) and not found["jam"] < 0.9
    return found


def demonstrated(scenario: Scenario, seed: int) -> list[Demonstration]:
    """Returns the good demonstrations and the bad ones, or only the good ones where no bad habit does harm.

    Raises:
        ValueError: if a good one is missing.
    """
    found: list[Demonstration] = []
    try:
        for _, demonstration in demonstrate_all(scenario, requests(GOOD, BAD), seed=seed, jobs=1):
            found.append(demonstration)
    except ValueError:
        if len(found) < GOOD:
            raise
        del found[GOOD:]  # the message asks for --bad 0
    return found


def skill(scenario: Scenario, trials: int, seed: int) -> dict[str, Any]:
    """Teaches a skill as the commands do, by demonstrations and corrections; returns how its trials ended."""
    shown: list[Demonstration] = []
    plan = CorrectionPlan(**PRACTICE, seed=seed)

    def learn() -> ManipulationSkill:
        return ManipulationSkill(random_state=0).fit(shown)

    def practise(policy: ManipulationSkill, number: int) -> list[StuckTrial]:
        tried = run_practice(scenario, policy, plan.numbers(number), jobs=1)
        return [StuckTrial(query_state, result) for result, query_state in tried if query_state is not None][
            : plan.most
        ]

    def show(query_states: Sequence[QueryState], number: int) -> bool:
        asked = dict(enumerate(query_states))
        shown.extend(d for _, d in demonstrate_corrections(scenario, asked, seed=seed, jobs=1))
        return True

    try:
        shown += demonstrated(scenario, seed)
        first = len(shown)
        learnt = correct(learn(), plan.rounds, practise=practise, demonstrate=show, train=lambda *_: learn())
    except ValueError as error:
        return {"demonstrated": len(shown), "inserted": 0, "ended": str(error)}
    results = [result for result, _ in run_trials(scenario, learnt, [100 * seed + k for k in range(trials)], jobs=1)]
    ended = Counter(result.reason for result in results if result.outcome is not Outcome.INSERTED)
    return {
        "demonstrated": first,
        "corrected": len(shown) - first,
        "inserted": trials - ended.total(),
        "time": float(np.median([result.time for result in results])),
        "load": float(np.median([result.peak_load for result in results])),
        "ended": "; ".join(f"{count} {reason}" for reason, count in ended.most_common()),
    }


def measure(sizes: Array, trials: int, seed: int) -> dict[str, Any]:
    """Returns one row."""
    begun = time.process_time()
    row = dict(zip(("radius", "ratio", "depth_ratio"), np.round(sizes, 6).tolist(), strict=True))
    try:
        scenario = scenario_of(*sizes)
    except ValueError as error:
        return {**row, "warned": f"refused: {error}"}
    row |= laws(scenario, seed) | skill(scenario, trials, seed)
    return {**row, "warned": "; ".join(doubts(scenario)), "cpu": time.process_time() - begun}


def main(
    out: Annotated[Path, typer.Argument(help="CSV file.")],
    seed: Annotated[int, typer.Option(min=1, help="Of design, demonstrations and trials.")] = 3,
    number: Annotated[int, typer.Option(min=1, help="Scenarios.")] = 60,
    at_corners: Annotated[bool, typer.Option("--corners", help="The corners of the range.")] = False,
    trials: Annotated[int, typer.Option(min=1, max=100, help="Trials.")] = 10,
    jobs: Annotated[int, typer.Option(min=1, help="Processes.")] = 2,
) -> None:
    design = corners() if at_corners else sizes_of(seed, number)
    done = set(pd.read_csv(out)["number"]) if out.exists() else set()
    missing = [k for k in range(len(design)) if k not in done]
    # A process for each scenario: Drake keeps the memory of its diagrams.
    workers = ProcessPoolExecutor(jobs, mp_context=get_context("spawn"), max_tasks_per_child=1)
    with progress("own pegs", len(missing)) as advance, workers:
        measured = {workers.submit(measure, design[k], trials, RUN * seed + k): k for k in missing}
        for done_now in as_completed(measured):
            row = {"number": measured[done_now], **done_now.result()}
            pd.DataFrame([row]).reindex(columns=COLUMNS).to_csv(out, mode="a", header=not out.exists(), index=False)
            advance(f"r {1e3 * row['radius']:.2f} mm, C/r {row['ratio']:.4f}")
    for line in summary(pd.read_csv(out), trials).splitlines():
        say(line)


COLUMNS = [
    *("number", "radius", "ratio", "depth_ratio", "depth", "slide", "jam", "wedge", "laws"),
    *("demonstrated", "corrected", "inserted", "time", "load", "ended", "warned", "cpu"),
]


def summary(rows: pd.DataFrame, trials: int) -> str:
    """Returns the summary of a file, a line each."""
    tried, refused = rows.dropna(subset="inserted"), rows["inserted"].isna().sum()
    lines = [
        f"{refused} of {len(rows)} scenarios refused; laws hold in {tried['laws'].astype(bool).sum()} of {len(tried)}"
    ]
    for name, some in (("without a warning", tried["warned"].isna()), ("with one", tried["warned"].notna())):
        counts = tried.loc[some, "inserted"].value_counts().sort_index()
        scenarios = ", ".join(f"{count} with {inserted:.0f}" for inserted, count in counts.items())
        lines.append(f"{name}, scenarios by insertions of {trials}: {scenarios or 'none'}")
    return "\n".join(lines)


if __name__ == "__main__":
    run(main)
