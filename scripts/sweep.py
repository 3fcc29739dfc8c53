"""Performs the trials of a sweep."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from scripts.command_line import Jobs, parse_path, path_option

if TYPE_CHECKING:
    from experiments.sweeps.assignments import Assignment, DemonstrationSource, PolicySource
    from experiments.sweeps.cost import Cost
    from experiments.sweeps.policy_store import PolicyStore
    from experiments.sweeps.result_blocks import Block
    from experiments.sweeps.specification import Specification
    from experiments.sweeps.trial_stream import Ended

ROW_SIZE = 1000  # bytes of a row on disk, about


def main(
    specification: Annotated[
        Path, typer.Argument(parser=parse_path, metavar="SPEC.yaml", help="What to try; see docs/sweeps.md.")
    ],
    out: Annotated[
        Path | None,
        path_option("RESULTS", "Folder to write into; results that are there are kept.", shown="out/sweeps/SPEC"),
    ] = None,
    executor: Annotated[
        Literal["local", "dask", "ray"],
        typer.Option(help="Where it runs: processes of this machine, a Dask cluster or a Ray cluster."),
    ] = "local",
    address: Annotated[
        str | None,
        typer.Option(
            metavar="TEXT",
            help="Address of a running cluster, such as tcp://node:8786 (Dask) or node:6379 (Ray).",
            show_default="starts one on this machine",
        ),
    ] = None,
    jobs: Jobs = 2,
    plan: Annotated[
        bool, typer.Option("--plan", help="Say how many trials are missing and what they cost; no more.")
    ] = False,
) -> None:
    """Performs many trials: a grid or random design over scenario, training, policies, trials and engines.

    Reads a specification. Writes one row for each trial into a Parquet data set in RESULTS/trials, which pandas and
    DuckDB read, and keeps the demonstrations and skills that it makes beside it. A row is identified by all that
    decides it: scenario, skill, seed, versions and code. So a sweep that is given again performs only what is missing,
    after an interruption or an extension; after a changed line of code all trials are, and old rows stay beside the
    new ones. Two sweeps may fill the same folder at the same time.

    For example:

        haptic-skill sweep benchmarks/sweeps/friction.yaml --plan
        haptic-skill sweep benchmarks/sweeps/friction.yaml --jobs 8
    """
    if address is not None and executor == "local":
        raise ValueError("--address is given, but --executor is local; expected --executor dask or ray")
    import sys

    from experiments.outputs.output_checks import check_folder
    from experiments.sweeps.executors import make_pool
    from experiments.sweeps.policy_store import PolicyStore
    from experiments.sweeps.trial_stream import TrialStream
    from interfaces.terminal import progress, say

    out = out or Path("out/sweeps") / specification.stem
    _check_results(out)
    if str(Path.cwd()) not in sys.path:
        sys.path.append(str(Path.cwd()))  # import paths of a specification may name modules in the current folder
    store = PolicyStore(out)
    found = plan_sweep(specification, out, store)
    missing = sum(lacking for _, _, lacking in found.todo)
    check_folder(out, size=missing * ROW_SIZE)

    say(f"{found.specification.title}: {found.wanted:,} trials, {found.wanted - missing:,} of them done already")
    with make_pool(executor, jobs=jobs, address=address, tell=say) as pool:
        if missing:
            say(found.cost.text(pool.workers))
        if plan:
            return
        name = keep_specification(specification, found.specification.text, out)
        if not missing:
            return
        unrecorded = store.unrecorded(found.sets)
        if unrecorded:
            with progress("demonstrations", unrecorded) as advance:
                store.record(found.sets, pool, advance)
        if found.policies:
            with progress("policies", len(found.policies)) as advance:
                store.make(found.policies, pool, advance)
        with progress("trials", missing) as advance:
            ended = TrialStream(found.todo, store, pool, advance).run()
    _report(ended, out, name)


@dataclass(frozen=True)
class SweepPlan:
    """What a sweep will do.

    Attributes:
        specification: of the sweep.
        wanted: number of trials that it asks for.
        todo: assignments and blocks that lack trials, with the number of trials that each lacks.
        policies: that perform these trials and have to be made first.
        sets: of demonstrations that those need.
        cost: estimated.
    """

    specification: Specification
    wanted: int
    todo: list[tuple[Assignment, Block, int]]
    policies: list[PolicySource]
    sets: list[DemonstrationSource]
    cost: Cost


def plan_sweep(path: Path, out: Path, store: PolicyStore) -> SweepPlan:
    """Reads a specification and finds what is missing; changes nothing.

    Raises:
        ValueError: if the specification is not valid, or a file of the results is damaged.
        OSError: if the specification cannot be read.
    """
    from experiments.sweeps.assignments import assignments
    from experiments.sweeps.cost import TrialKind, cost_of
    from experiments.sweeps.specification import read_specification

    specification = read_specification(path)
    found = assignments(specification, out, f"sweep {path}")
    blocks = [(assignment, block) for assignment in found for block in assignment.blocks]
    todo = [(assignment, block, len(missing)) for assignment, block in blocks if (missing := block.missing())]
    policies = _distinct(a.policy for a, _, _ in todo)
    unmade = [policy for policy in policies if not store.is_made(policy)]
    sets = _distinct(policy.demonstrations for policy in unmade if policy.demonstrations is not None)
    trials: Counter[TrialKind] = Counter()
    for assignment, _, lacking in todo:
        plan = assignment.policy.plan
        trials[TrialKind(plan.name, assignment.source.engine, plan.imitates)] += lacking
    demonstrations: Counter[str] = Counter()
    for source in sets:
        demonstrations[source.scenario.contact.engine] += store.unrecorded([source])
    cost = cost_of(
        out,
        trials=trials,
        demonstrations=demonstrations,
        policies=len(unmade),
        unknown=sum(policy.plan.make is not None for policy in unmade),
    )
    return SweepPlan(specification, sum(len(block.numbers) for _, block in blocks), todo, unmade, sets, cost)


def keep_specification(path: Path, text: str, out: Path) -> Path:
    """Writes a copy of a specification into the results, and returns its path."""
    import time

    from experiments.outputs.folder_lock import BusyError, locked_file
    from experiments.sweeps.trial_files import SWEEPS
    from skill.data.files import write_atomically

    k = 1
    while k < 1000:
        copy = out / SWEEPS / (path.stem + ("" if k == 1 else f"_{k}") + ".yaml")
        try:
            with locked_file(copy):
                if not copy.exists():
                    write_atomically(copy, text.encode())
                if copy.read_bytes() == text.encode():
                    return copy
            k += 1
        except BusyError:  # another sweep keeps its own
            time.sleep(0.05)
    raise ValueError(f"{out / SWEEPS}: holds a thousand sweeps named {path.stem}; choose another --out")


def _check_results(out: Path) -> None:
    """Refuses a folder that holds something else than results of sweeps."""
    import os

    from experiments.sweeps.trial_files import PUBLISHED, SETS, SKILLS, SWEEPS, TRIALS

    if not os.path.lexists(out):
        return
    if not out.is_dir():
        raise NotADirectoryError(f"--out {out}: is not a folder; choose another place")
    others = sorted(
        p.name for p in out.iterdir() if p.name not in {TRIALS, SWEEPS, SETS, SKILLS} and p.suffix != ".html"
    )
    if others and not (out / TRIALS).is_dir():
        raise ValueError(f"--out {out}: holds {others[0]}, but no results of sweeps; choose another --out")
    if any((out / TRIALS).rglob(PUBLISHED)):
        raise ValueError(
            f"--out {out}: holds a published copy of results, with which no sweep goes on; choose another --out"
        )


def _distinct(items: Iterable[Any]) -> list[Any]:
    """Returns the items whose digests differ, in order."""
    found: dict[str, Any] = {}
    for item in items:
        found.setdefault(item.digest, item)
    return list(found.values())


def _report(ended: Ended, out: Path, name: Path) -> None:
    from experiments.sweeps.trial_files import TRIALS
    from interfaces.terminal import say

    elsewhere = f", {ended.elsewhere:,} by another sweep at the same time" if ended.elsewhere else ""
    say(f"{ended.written:,} trials written{elsewhere}; results in {out / TRIALS}, the sweep in {name}")
    say(f"compare the policies: haptic-skill scoreboard {out}")
    if ended.failures:
        reason, _ = ended.failures.most_common(1)[0]
        count = sum(ended.failures.values())
        raise ValueError(f"{count} trials could not be performed and have no row; most often: {reason}")
