"""Runs a sweep into a folder of results, and goes on with it after an interruption."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from experiments.outputs.folder_lock import BusyError, locked_file
from experiments.outputs.output_checks import check_folder
from experiments.scoreboard.result_store import PUBLISHED
from experiments.sweeps.assignments import Assignment, DemonstrationSource, PolicySource, assignments
from experiments.sweeps.cost import Cost, cost_of
from experiments.sweeps.executors import Executor
from experiments.sweeps.policy_store import SETS, SKILLS, PolicyStore
from experiments.sweeps.result_blocks import TRIALS, Block
from experiments.sweeps.specification import Specification, read_specification
from experiments.sweeps.trial_engines import require_engine
from experiments.sweeps.trial_stream import Ended, TrialStream
from interfaces.terminal import progress, say
from skill.data.tables import write_atomically

SWEEPS = "sweeps"
"""The folder of the specifications within the results."""

ROW_SIZE = 1000  # bytes of a row on disk, about


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
    specification = read_specification(path)
    for engine in specification.engines:
        require_engine(engine)
    found = assignments(specification, out, f"sweep {path}")
    blocks = [(assignment, block) for assignment in found for block in assignment.blocks]
    todo = [(assignment, block, len(missing)) for assignment, block in blocks if (missing := block.missing())]
    policies = _distinct(a.policy for a, _, _ in todo)
    unmade = [policy for policy in policies if not store.is_made(policy)]
    sets = _distinct(policy.demonstrations for policy in unmade if policy.demonstrations is not None)
    cost = cost_of(
        out / TRIALS,
        trials=[(assignment.source.engine, lacking) for assignment, _, lacking in todo],
        demonstrations=store.unrecorded(sets),
        policies=len(unmade),
        unknown=sum(policy.plan.make is not None for policy in unmade),
    )
    return SweepPlan(specification, sum(len(block.numbers) for _, block in blocks), todo, unmade, sets, cost)


def sweep(
    *, path: Path, out: Path, backend: str, address: str | None, jobs: int, plan_only: bool = False
) -> Ended | None:
    """Performs the trials of a specification that have no row yet; with ``plan_only`` says what they are.

    Raises:
        ValueError: if the specification is not valid, or a policy cannot be made.
        OSError: if the results cannot be written, or the cluster does not answer. What is finished stays.
    """
    _check_results(out)
    if str(Path.cwd()) not in sys.path:
        sys.path.append(str(Path.cwd()))  # import paths of a specification may name modules in the current folder
    store = PolicyStore(out)
    plan = plan_sweep(path, out, store)
    missing = sum(lacking for _, _, lacking in plan.todo)
    check_folder(out, size=missing * ROW_SIZE)

    say(f"{plan.specification.title}: {plan.wanted:,} trials, {plan.wanted - missing:,} of them done already")
    with Executor(backend, jobs=jobs, address=address, tell=say) as executor:
        if missing:
            say(plan.cost.text(executor.workers))
        if plan_only:
            return None
        name = keep_specification(path, plan.specification.text, out)
        if not missing:
            return None
        unrecorded = store.unrecorded(plan.sets)
        if unrecorded:
            with progress("demonstrations", unrecorded) as advance:
                store.record(plan.sets, executor, advance)
        if plan.policies:
            with progress("policies", len(plan.policies)) as advance:
                store.make(plan.policies, executor, advance)
        with progress("trials", missing) as advance:
            ended = TrialStream(plan.todo, store, executor, advance).run()
    _report(ended, out, name)
    return ended


def keep_specification(path: Path, text: str, out: Path) -> Path:
    """Writes a copy of a specification into the results, and returns its path."""
    for k in range(1, 1000):
        copy = out / SWEEPS / (path.stem + ("" if k == 1 else f"_{k}") + ".yaml")
        with _held(copy):
            if not copy.exists():
                write_atomically(copy, text.encode())
            if copy.read_bytes() == text.encode():
                return copy
    raise ValueError(f"{out / SWEEPS}: holds a thousand sweeps named {path.stem}; choose another --out")


@contextmanager
def _held(path: Path) -> Iterator[None]:
    """Holds a file; waits while another sweep does."""
    with ExitStack() as stack:
        while True:
            try:
                stack.enter_context(locked_file(path))
                break
            except BusyError:
                time.sleep(0.05)
        yield


def _check_results(out: Path) -> None:
    """Refuses a folder that holds something else than results of sweeps."""
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
            f"--out {out}: holds a published copy of results, with which no sweep goes on; choose another --out, or"
            " restore it with docs/_tools/restored_results.py"
        )


def _distinct(items: Iterable[Any]) -> list[Any]:
    """Returns the items whose digests differ, in order."""
    found: dict[str, Any] = {}
    for item in items:
        found.setdefault(item.digest, item)
    return list(found.values())


def _report(ended: Ended, out: Path, name: Path) -> None:
    elsewhere = f", {ended.elsewhere:,} by another sweep at the same time" if ended.elsewhere else ""
    say(f"{ended.written:,} trials written{elsewhere}; results in {out / TRIALS}, the sweep in {name}")
    if ended.failures:
        reason, _ = ended.failures.most_common(1)[0]
        count = sum(ended.failures.values())
        raise ValueError(f"{count} trials could not be performed and have no row; most often: {reason}")
