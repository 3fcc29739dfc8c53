"""Performs the trials of a sweep."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from scripts.command_line import Jobs, parse_path, path_option

if TYPE_CHECKING:
    from experiments.sweep.cell_files import CellFile
    from experiments.sweep.cells import DemonstrationSet, PolicyRecipe
    from experiments.sweep.policy_store import PolicyStore
    from experiments.sweep.specification import Specification

ROW_SIZE = 1000  # bytes of a row on disk, about

REFERENCE_SPEED = 105.0
"""`machine_speed` of the machine with these CPU times, ms."""

LOOP = "exact, in the compiled loop"
TRIAL_CPU = {LOOP: 0.085, "exact": 1.1, "drake": 2.6}  # s
DEMONSTRATION_CPU, POLICY_CPU = 2.4, 10.0  # s


def main(
    specification: Annotated[
        Path, typer.Argument(parser=parse_path, metavar="SPEC.yaml", help="What to try; see docs/sweeps.md.")
    ],
    out: Annotated[
        Path | None,
        path_option("RESULTS", "Folder to write into; results that are there are kept.", shown="out/sweeps/SPEC"),
    ] = None,
    jobs: Jobs = 2,
    dask: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS",
            help="Address of a Dask scheduler, such as tcp://node:8786, whose workers perform it.",
            show_default="processes of this machine",
        ),
    ] = None,
    plan: Annotated[
        bool, typer.Option("--plan", help="Say how many trials are missing and what they cost; no more.")
    ] = False,
) -> None:
    """Performs many trials: a grid or random design over scenario, training, policies, trials and engines.

    Reads a specification. Writes one row for each trial into a Parquet data set in RESULTS/trials, which pandas and
    DuckDB read, and keeps the demonstrations and skills that it makes beside it. A row is identified by all that
    decides it: scenario, skill, seed, versions and code. So a sweep that is given again performs only what is missing,
    after an interruption or an extension; after a changed line of code all trials are, and old rows stay beside the
    new ones.

    For example:

        haptic-skill sweep benchmarks/sweeps/friction.yaml --plan
        haptic-skill sweep benchmarks/sweeps/friction.yaml --jobs 8
    """
    import sys
    from contextlib import ExitStack

    from experiments.outputs.folder_lock import locked_folder
    from experiments.outputs.output_checks import check_folder
    from experiments.sweep.policy_store import PolicyStore
    from experiments.sweep.sweep_run import SweepRun
    from experiments.sweep.trial_files import TRIALS
    from experiments.worker_pool import dask_pool, local_pool
    from interfaces.terminal import progress, say

    out = out or Path("out/sweeps") / specification.stem
    _check_results(out)
    if str(Path.cwd()) not in sys.path:
        sys.path.append(str(Path.cwd()))  # import paths of a specification may name modules in the current folder
    with ExitStack() as stack:
        stack.enter_context(locked_folder(out))
        store = PolicyStore(out)
        found = plan_sweep(specification, out, store)
        check_folder(out, size=found.missing * ROW_SIZE)
        done = found.wanted - found.missing
        say(f"{found.specification.title}: {found.wanted:,} trials, {done:,} of them done already")
        if plan or found.missing:
            say(cost_text(found, jobs))
        if plan:
            return
        pool = local_pool(jobs) if dask is None else stack.enter_context(dask_pool(dask))
        kept = keep_specification(specification, found.specification.text, out)
        if found.unrecorded:
            with progress("demonstrations", found.unrecorded) as advance:
                store.record(found.sets, pool, advance)
        if found.recipes:
            with progress("policies", len(found.recipes)) as advance:
                store.make(found.recipes, pool, advance)
        with progress("trials", found.missing) as advance:
            run = SweepRun(found.todo, store, pool, advance)
            run.run()
    say(f"{run.written:,} trials written; results in {out / TRIALS}, the sweep in {kept}")
    say(f"compare the policies: haptic-skill scoreboard {out}")
    if run.failures:
        reason, _ = run.failures.most_common(1)[0]
        count = run.failures.total()
        raise ValueError(f"{count} trials could not be performed and have no row; most often: {reason}")


@dataclass(frozen=True)
class SweepPlan:
    """What a sweep will do.

    Attributes:
        specification: of the sweep.
        wanted: number of trials that it asks for.
        todo: files of cells that lack trials.
        missing: number of these trials.
        recipes: of the policies that perform them and have to be made first.
        sets: of demonstrations that those need.
        unrecorded: number of these demonstrations that are not there.
    """

    specification: Specification
    wanted: int
    todo: list[CellFile]
    missing: int
    recipes: list[PolicyRecipe]
    sets: list[DemonstrationSet]
    unrecorded: int


def plan_sweep(path: Path, out: Path, store: PolicyStore) -> SweepPlan:
    """Reads a specification and finds what is missing; changes nothing.

    Raises:
        ValueError: if the specification is not valid, or a file of the results is damaged.
        OSError: if the specification cannot be read.
    """
    from experiments.sweep.cell_files import files_of
    from experiments.sweep.cells import cells_of
    from experiments.sweep.specification import read_specification

    specification = read_specification(path)
    cells = cells_of(specification, f"sweep {path}")
    todo = [file for cell in cells for file in files_of(cell, out) if file.missing]
    recipes = [recipe for recipe in _distinct(file.cell.recipe for file in todo) if not store.is_made(recipe)]
    sets = _distinct(recipe.demonstrations for recipe in recipes if recipe.demonstrations is not None)
    return SweepPlan(
        specification=specification,
        wanted=sum(len(cell.numbers) for cell in cells),
        todo=todo,
        missing=sum(len(file.missing) for file in todo),
        recipes=recipes,
        sets=sets,
        unrecorded=store.unrecorded(sets),
    )


def cost_text(plan: SweepPlan, jobs: int) -> str:
    """Returns what is missing and about what it costs on this machine, as one line."""
    from experiments.machine_speed import machine_speed

    made = [recipe for recipe in plan.recipes if recipe.plan.make is None]
    cpu = DEMONSTRATION_CPU * plan.unrecorded + POLICY_CPU * len(made)
    for file in plan.todo:
        is_looped = file.cell.engine == "exact" and file.cell.recipe.plan.imitates
        cpu += TRIAL_CPU[LOOP if is_looped else file.cell.engine] * len(file.missing)
    minutes = cpu * machine_speed() / REFERENCE_SPEED / 60.0
    counts = {"trials": plan.missing, "demonstrations": plan.unrecorded, "policies": len(plan.recipes)}
    parts = [f"{count:,} {name}" for name, count in counts.items() if count]
    unknown = len(plan.recipes) - len(made)
    rest = f", without the making of {unknown:,} policies by functions" if unknown else ""
    return (
        f"to do: {', '.join(parts) or 'nothing'}; about {minutes:.1f} min of CPU, {minutes / jobs:.1f} min with {jobs}"
        f" idle cores{rest}"
    )


def keep_specification(path: Path, text: str, out: Path) -> Path:
    """Writes a copy of a specification into the results, and returns its path; another one of its name stays."""
    from itertools import count

    from experiments.sweep.trial_files import SWEEPS
    from skill.data.files import write_atomically

    (out / SWEEPS).mkdir(parents=True, exist_ok=True)
    for k in count(1):
        copy = out / SWEEPS / f"{path.stem}{'' if k == 1 else f'_{k}'}.yaml"
        if not copy.exists():
            write_atomically(copy, text.encode())
        if copy.read_bytes() == text.encode():
            break
    return copy


def _check_results(out: Path) -> None:
    """Refuses a folder that holds something else than results of sweeps."""
    from experiments.sweep.trial_files import PUBLISHED, SETS, SKILLS, SWEEPS, TRIALS

    if not out.exists():
        return
    if not out.is_dir():
        raise NotADirectoryError(f"--out {out}: is not a folder; choose another place")
    own = {TRIALS, SWEEPS, SETS, SKILLS}
    others = sorted(p.name for p in out.iterdir() if p.name not in own and p.suffix not in {".html", ".lock"})
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
