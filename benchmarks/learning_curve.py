"""How many demonstrations a skill needs: insertions over the number of demonstrations, recoveries included.

    python -m benchmarks.learning_curve [--draws 4] [--trials 10] [--sizes N ...] [--jobs 2] [--json FILE]
                                        [--figure FILE.svg]

A draw is a set of sixty demonstrations of other operators, whose seed counts from --first on. Four in five are good. A
skill learns from N of them, the first good and the first bad ones in the same share; or, from five on, from fewer and
the recoveries that it asks for itself (`haptic-skill recover`): three fifths of N are demonstrated, and two rounds ask
for up to a fifth each, so that demonstrations and recoveries together are at most N. All skills of a draw perform the
same trials in both arms (`Arm`); each draw has its own, and those of the first begin at --first-trial. Everything is
kept in the folder of --out, and an interrupted run goes on there with the same --first, --first-trial and --trials.

Columns: the largest number of demonstrations and recoveries together; how many there are on average; insertions; their
95 % interval over the draws (bootstrap); the worst draw; the median time, where a failure counts as the whole time of
a trial; the largest measured load.
"""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks.extras import require_packages

if __name__ == "__main__":
    require_packages("pydrake", "yaml")

import numpy as np
from matplotlib.figure import Figure

from benchmarks.command_line import argument_parser, run
from benchmarks.rig.demonstration_sets import (
    DEMONSTRATIONS,
    SCENARIO,
    insertions,
    recover_in,
    recoveries,
    row_of,
    tried,
)
from benchmarks.rig.figures import BLUE, ORANGE
from skill.figures.paper_figures import save_figure
from systems.reports.result_tables import plain_table
from systems.reports.terminal import console, write_json
from systems.runs.demonstration_set import requests
from systems.runs.trial import Arm
from systems.sessions.record_session import record
from systems.sessions.train_session import train

FIRST_DRAW, FIRST_TRIAL = 750, 79000
"""Draws and trials that were used for no choice."""

SIZES = (1, 2, 3, 5, 10, 20, 30, 60)
LARGEST = max(SIZES)  # demonstrations of a draw
GOOD_SHARE = 0.8
SMALLEST_RECOVERED = 5
SHOWN, RECOVERED = "demonstrations", "demonstrations and recoveries"
KINDS = {SHOWN: BLUE, RECOVERED: ORANGE}


def split(size: int) -> tuple[int, int]:
    """How many of so many demonstrations are good and bad; at least one is good."""
    good = max(1, round(GOOD_SHARE * size))
    return good, size - good


def chosen(whole: Path, size: int, folder: Path) -> Path:
    """Copies the first good and bad demonstrations of a draw into a folder, and returns the folder."""
    if not folder.exists():
        part = folder.with_name(folder.name + "_part")
        shutil.rmtree(part, ignore_errors=True)
        part.mkdir(parents=True)
        for good, number in zip((True, False), split(size), strict=True):
            for request in [request for request in requests(*split(LARGEST)) if request.good == good][:number]:
                shutil.copy2(whole / request.file_name, part)
        part.rename(folder)
    return folder


def skill_of(kind: str, whole: Path, size: int, seed: int, folder: Path, *, jobs: int) -> Path:
    """Makes the skill of one point of one draw in a folder, unless it is there; returns its file."""
    file = folder / "skill.npz"
    if file.exists():
        return file
    each = round(size / 5) if kind == RECOVERED else 0
    shown = chosen(whole, size - 2 * each, folder / DEMONSTRATIONS)
    taught = folder / "taught.npz"
    train(demonstrations=[shown], out=taught, seed=seed)
    if kind == RECOVERED:
        recover_in(folder, taught, taught, most=each, seed=seed, jobs=jobs)
    taught.rename(file)  # complete
    return file


def points(sizes: Sequence[int]) -> list[tuple[str, int]]:
    """The kinds and sizes of the curve."""
    return [(kind, n) for kind in KINDS for n in sizes if kind == SHOWN or n >= SMALLEST_RECOVERED]


def summary(rows: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """One row for each kind, size and arm, over the draws."""
    found = []
    keys = dict.fromkeys((row["skill"], row["size"], row["arm"]) for row in rows)
    for kind, size, arm in keys:
        of = [row for row in rows if (row["skill"], row["size"], row["arm"]) == (kind, size, arm)]
        found.append(
            {
                **{"skill": kind, "size": size, "arm": arm, "draws": len(of)},
                **insertions(of),
                "learnt_from": float(np.mean([row["learnt_from"] for row in of])),
                "median_time_s": float(np.median(np.concatenate([row["times_s"] for row in of]))),
                "measured_max_n": max(row["measured_max_n"] for row in of),
            }
        )
    return found


def show(found: Sequence[dict[str, Any]]) -> None:
    """Prints one line for each point and arm."""
    for kind in KINDS:
        of = [row for row in found if row["skill"] == kind]
        if not of:
            continue
        table = plain_table(f"learnt from {kind}")
        counts = ("at\nmost", "mean\nnumber", "arm", "inserted", "95 %, over\nthe draws", "worst\ndraw")
        for title in (*counts, "time\n(s)", "load\n(N)"):
            table.add_column(title, justify="right", vertical="bottom", no_wrap=True)
        for row in of:
            table.add_row(
                *(str(row["size"]), f"{row['learnt_from']:.1f}", row["arm"]),
                f"{row['inserted']} of {row['trials']}",
                f"{100 * row['lower']:.0f}-{100 * row['upper']:.0f} %",
                f"{100 * row['worst']:.0f} %",
                f"{row['median_time_s']:.2f}",
                f"{row['measured_max_n']:.1f}",
            )
        console.print(table)


def draw(found: Sequence[dict[str, Any]], path: Path) -> None:
    """Draws the shares of insertions over the number of demonstrations, one panel for each arm."""
    figure = Figure(figsize=(8.6, 3.2), layout="constrained")
    panels = figure.subplots(1, len(Arm), sharey=True, squeeze=False)[0]
    for axis, arm in zip(panels, Arm, strict=True):
        for kind, colour in KINDS.items():
            of = sorted(
                (row for row in found if (row["skill"], row["arm"]) == (kind, arm.value)), key=lambda row: row["size"]
            )
            if of:
                sizes = [row["size"] for row in of]
                low, high = ([100 * row[name] for row in of] for name in ("lower", "upper"))
                marker = "o-" if kind == SHOWN else "s--"
                axis.fill_between(sizes, low, high, color=colour, alpha=0.2, lw=0)
                axis.plot(sizes, [100 * row["mean"] for row in of], marker, color=colour, label=kind)
        sizes = sorted({row["size"] for row in found})
        axis.set(xlabel="demonstrations and recoveries, at most", title=f"{arm.value} arm", xscale="log")
        axis.set_xticks(sizes, [str(size) for size in sizes])
        axis.set_xticks([], minor=True)
        axis.set_ylim(-2.0, 102.0)
        axis.grid(alpha=0.3)
        axis.spines[["top", "right"]].set_visible(False)
    panels[0].set_ylabel("inserted, %")
    panels[0].legend(frameon=False, loc="lower right")
    save_figure(figure, path)


def main() -> None:
    parser = argument_parser(__doc__)
    parser.add_argument("--first", type=int, default=FIRST_DRAW, help=f"seed of the first draw (default: {FIRST_DRAW})")
    parser.add_argument("--draws", type=int, default=4, help="number of draws (default: 4)")
    parser.add_argument(
        "--first-trial", type=int, default=FIRST_TRIAL, help=f"number of the first trial (default: {FIRST_TRIAL})"
    )
    parser.add_argument("--trials", type=int, default=10, help="trials of each skill and arm (default: 10)")
    parser.add_argument("--sizes", type=int, nargs="+", default=SIZES, metavar="N", help="numbers of demonstrations")
    parser.add_argument("--jobs", type=int, default=1, help="number of processes")
    parser.add_argument("--figure", type=Path, metavar="FILE", help="draw the curve into this .svg file")
    parser.add_argument("--out", type=Path, default=Path("out/benchmarks/curve"), metavar="FOLDER", help="kept results")
    arguments = parser.parse_args()
    counts = arguments.draws, arguments.trials, arguments.jobs, *arguments.sizes
    if min(arguments.first, arguments.first_trial) < 0 or min(counts) < 1 or max(arguments.sizes) > LARGEST:
        raise ValueError(
            "expected --first and --first-trial of at least 0; --draws, --trials, --sizes and --jobs of at least 1;"
            f" --sizes of at most {LARGEST}"
        )
    rows, jobs = [], arguments.jobs
    for number in range(arguments.draws):
        seed, first = arguments.first + number, arguments.first_trial + number * arguments.trials
        whole = arguments.out / str(seed) / f"whole_{LARGEST}"
        good, bad = split(LARGEST)
        record(out=whole, good=good, bad=bad, seed=seed, scenario=SCENARIO, jobs=jobs, overwrite=False)
        for kind, size in points(arguments.sizes):
            folder = arguments.out / str(seed) / f"{'recovered' if kind == RECOVERED else 'shown'}_{size}"
            skill = skill_of(kind, whole, size, seed, folder, jobs=jobs)
            asked = recoveries(folder)
            learnt_from = len(list((folder / DEMONSTRATIONS).glob("*.parquet"))) + asked
            for arm in Arm:
                results = tried(folder, skill, arm, first, arguments.trials, jobs=jobs)
                rows.append({**row_of(seed, kind, arm, asked, results), "size": size, "learnt_from": learnt_from})
        found = summary(rows)
        if arguments.json is not None:
            write_json(arguments.json, {"draws": rows, "summary": found})
    show(found)
    if arguments.figure is not None:
        draw(found, arguments.figure)


if __name__ == "__main__":
    run(main)
