"""CPU time of rig trials, compared with another checkout of this project and with MuJoCo.

    python -m benchmarks.rig_cost --against CHECKOUT [--skill FILE] [--against-skill FILE] [--trials 6] [--seed 0]
                                  [--rounds 2] [--scenario nominal] [--json FILE]

Every run is a process of its own with one thread, and with the modules and the scenarios of its checkout. The runs
alternate (this, other, other, this, ...) after one run of each that is not counted, so that a machine that slows down
slows both. Imports are not counted; the building of the rig is. Each checkout uses a skill of its own: one that is
given, or one that it trains with its own default demonstrations and keeps in out/rig_cost. Trials differ in length
between skills, so that CPU time per simulated second is printed too.

With the extra [peers], the trials of this checkout are performed in MuJoCo as well, in the same run.

Keys of the file: ratio (CPU time of all trials, this over other), cpu_per_sim_s and other_cpu_per_sim_s (CPU time per
simulated second), mujoco_cpu_per_sim_s (None without the extra), and this, other, mujoco: one row per trial with its
CPU time (cpu_s, the median of the rounds), its simulated time and whether it inserted.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path
from statistics import median
from typing import Any

if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parent.parent))  # also if it is started as a file

from benchmarks.command_line import argument_parser, run
from interfaces.terminal import progress, write_json

HERE = Path(__file__).resolve().parent
WORKER = HERE / "rig_cost_worker.py"
THIS, OTHER, MUJOCO = "this", "other", "mujoco"

Rows = list[dict[str, Any]]


def call(checkout: Path, *arguments: str | Path) -> str:
    """Returns what this interpreter prints in a checkout, with the modules of that checkout and one thread.

    Raises:
        ValueError: naming the checkout, with the last line of the error, if the process fails.
    """
    own = {"PYTHONPATH": str(checkout), "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    command = [sys.executable, "-P", *map(str, arguments)]
    done = subprocess.run(command, cwd=checkout, env=os.environ | own, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        last = (done.stderr.strip() or "no message").splitlines()[-1]
        raise ValueError(f"checkout {checkout}: {' '.join(map(str, arguments[:2]))} failed: {last}")
    return done.stdout


def skill_of(checkout: Path) -> Path:
    """Returns the skill of a checkout, which is trained with the checkout's default demonstrations if it is missing."""
    folder = checkout / "out" / "rig_cost"
    skill, demonstrations = folder / "skill.npz", folder / "demonstrations"
    if not skill.is_file():
        call(checkout, "-m", "scripts.record", "--out", demonstrations, "--overwrite")
        call(checkout, "-m", "scripts.train", "--demonstrations", demonstrations, "--out", skill)
    return skill


def order(rounds: int) -> list[str]:
    """The sides of the runs: this, other, other, this, and so on."""
    return [side for k in range(rounds) for side in ((THIS, OTHER) if k % 2 == 0 else (OTHER, THIS))]


def combine(runs: list[Rows]) -> Rows:
    """The rows of a side: CPU times are medians over its runs; everything else is equal in all of them.

    Raises:
        ValueError: if a trial differs between runs, so that times of different work would be compared.
    """
    combined = []
    for rows in zip(*runs, strict=True):
        if any(row | {"cpu_s": 0} != rows[0] | {"cpu_s": 0} for row in rows):
            raise ValueError(f"trial {rows[0]['trial']} is {rows}, expected the same trial in every run")
        combined.append(rows[0] | {"cpu_s": median(row["cpu_s"] for row in rows)})
    return combined


def cpu(rows: Rows) -> float:
    """CPU time of all trials, s."""
    return float(sum(row["cpu_s"] for row in rows))


def cpu_per_second(rows: Rows) -> float:
    """CPU time per simulated second."""
    return cpu(rows) / float(sum(row["simulated_s"] for row in rows))


def measure(this: Path, other: Path, skills: dict[str, Path], options: list[str], *, rounds: int) -> dict[str, Rows]:
    """Performs all runs and returns the rows of each side; there are none of MuJoCo if it is not installed.

    Args:
        this: folder of this checkout.
        other: folder of the other one.
        skills: skill of each side.
        options: further options of the worker.
        rounds: runs of each checkout that count.
    """
    checkouts = {THIS: this, OTHER: other, MUJOCO: this}
    sides = order(rounds)
    if find_spec("mujoco") is not None:
        sides = [side for each in sides for side in ((each, MUJOCO) if each == THIS else (each,))]
    counted: dict[str, list[Rows]] = {THIS: [], OTHER: [], MUJOCO: []}
    warm_up = [THIS, OTHER]
    with progress("rig cost", len(warm_up) + len(sides)) as advance:
        for k, side in enumerate([*warm_up, *sides]):
            engine = ["--mujoco"] if side == MUJOCO else []
            rows = json.loads(call(checkouts[side], WORKER, "--skill", skills[side], *options, *engine))
            if k >= len(warm_up):
                counted[side].append(rows)
            advance(f"{side}: {cpu(rows):.2f} s")
    return {side: combine(runs) for side, runs in counted.items()}


def report(found: dict[str, Rows]) -> dict[str, Any]:
    """The results as they are written to the file; see the module."""
    mujoco = found[MUJOCO]
    return {
        "ratio": cpu(found[THIS]) / cpu(found[OTHER]),
        "cpu_per_sim_s": cpu_per_second(found[THIS]),
        "other_cpu_per_sim_s": cpu_per_second(found[OTHER]),
        "mujoco_cpu_per_sim_s": cpu_per_second(mujoco) if mujoco else None,
        **found,
    }


def print_table(results: dict[str, Any]) -> None:
    """Prints one row per side, and one row per trial."""
    print(f"{'':8}{'CPU s':>8}{'simulated s':>13}{'CPU a simulated s':>19}{'inserted':>10}")
    for side in (THIS, OTHER, MUJOCO):
        rows = results[side]
        if rows:
            simulated, inserted = sum(r["simulated_s"] for r in rows), sum(r["inserted"] for r in rows)
            share = f"{inserted} of {len(rows)}"
            print(f"{side:8}{cpu(rows):8.2f}{simulated:13.2f}{cpu_per_second(rows):19.3f}{share:>10}")
    if not results[MUJOCO]:
        print("mujoco: not installed (extra [peers])")
    for side in (THIS, OTHER, MUJOCO):
        if results[side]:
            print(f"{side}, CPU s of each trial: {'  '.join(format(r['cpu_s'], '.2f') for r in results[side])}")
    print(f"ratio {results['ratio']:.3f}")


def main() -> None:
    parser = argument_parser(__doc__)
    parser.add_argument("--against", type=checkout, required=True, metavar="CHECKOUT", help="folder of the other one")
    parser.add_argument("--skill", type=Path, metavar="FILE", help="skill of this checkout (default: trained)")
    parser.add_argument("--against-skill", type=Path, metavar="FILE", help="skill of the other one (default: trained)")
    parser.add_argument("--trials", type=positive, default=6, help="number of trials (default: 6)")
    parser.add_argument("--seed", type=int, default=0, help="number of the first trial (default: 0)")
    parser.add_argument("--rounds", type=positive, default=2, help="runs of each checkout that count (default: 2)")
    parser.add_argument("--scenario", default="nominal", help="name of a scenario of each checkout, or a file")
    arguments = parser.parse_args()
    if Path(arguments.scenario).is_file():
        arguments.scenario = Path(arguments.scenario).resolve()
    this, other = HERE.parent, arguments.against
    own = (arguments.skill or skill_of(this)).resolve()
    skills = {THIS: own, MUJOCO: own, OTHER: (arguments.against_skill or skill_of(other)).resolve()}
    options = [f"--{name}={getattr(arguments, name)}" for name in ("trials", "seed", "scenario")]
    results = report(measure(this, other, skills, options, rounds=arguments.rounds))
    print_table(results)
    if arguments.json:
        write_json(arguments.json, results)


def checkout(text: str) -> Path:
    """Reads the folder of a checkout."""
    folder = Path(text).resolve()
    if not any((folder / "systems" / name).is_file() for name in ("runs/trial.py", "trial.py")):
        raise argparse.ArgumentTypeError(
            f"{text}: no experiments/trial.py or systems/trial.py there, expected a checkout of this project"
        )
    return folder


def positive(text: str) -> int:
    """Reads a whole number of at least 1."""
    if not (text.isdecimal() and int(text) > 0):
        raise argparse.ArgumentTypeError(f"{text}: expected a whole number of at least 1")
    return int(text)


if __name__ == "__main__":
    run(main)
