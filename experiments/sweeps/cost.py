"""What a sweep will cost, from what trials have cost so far."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from experiments.machine_speed import machine_speed
from experiments.sweeps.result_blocks import read_block
from experiments.sweeps.trial_files import partition

REFERENCE_SPEED = 105.0
"""`machine_speed` of the machine with these CPU times, ms."""

LOOP = "exact, in the compiled loop"
TRIAL_CPU = {LOOP: 0.085, "exact": 1.1, "drake": 2.6}  # s
DEMONSTRATION_CPU = {"exact": 1.1, "drake": 2.4}  # s
POLICY_CPU = 10.0  # s
START_CPU = 5.0  # s, until a process has imported what it needs

SAMPLED = 20
"""Number of blocks of a policy and an engine whose trials tell what a trial costs."""


@dataclass(frozen=True)
class TrialKind:
    """Trials that cost about the same.

    Attributes:
        policy: name of the policy.
        engine: that simulates.
        compiled: whether the compiled loop performs those of the exact engine.
    """

    policy: str
    engine: str
    compiled: bool


@dataclass(frozen=True)
class Cost:
    """The estimated cost of a sweep.

    Attributes:
        trials, demonstrations, policies: numbers that are missing.
        unknown: number of these policies that functions make, which may tune them for long.
        cpu: of all but those, on this machine, s.
        measured: whether the cost of a trial was measured in these results.
    """

    trials: int
    demonstrations: int
    policies: int
    unknown: int
    cpu: float
    measured: bool

    def text(self, workers: int) -> str:
        """Returns the cost as one line, for a number of processes."""
        parts = [f"{self.trials:,} trials"]
        parts += [f"{self.demonstrations:,} demonstrations"] if self.demonstrations else []
        parts += [f"{self.policies:,} policies"] if self.policies else []
        source = "trials cost what they did in these results" if self.measured else "from the speed of this machine"
        cpu = self.cpu + workers * START_CPU
        time = f"{duration(cpu)} of CPU, {duration(cpu / workers)} with {workers} idle cores"
        rest = f", without the making of {self.unknown:,} policies by functions" if self.unknown else ""
        return f"to do: {', '.join(parts)}; about {time} ({source}){rest}"


def cost_of(
    results: Path,
    *,
    trials: Mapping[TrialKind, int],
    demonstrations: Mapping[str, int],
    policies: int,
    unknown: int = 0,
) -> Cost:
    """Estimates a cost.

    Args:
        results: folder of the sweep; trials in it tell what a trial costs.
        trials: numbers of trials that are missing.
        demonstrations: numbers that have to be recorded, by their engines.
        policies: number that has to be made.
        unknown: number of them that functions make.

    Raises:
        ValueError: if a file of the data set is damaged.
    """
    measured = {kind: _measured(results, kind) for kind in trials}
    speed = machine_speed() / REFERENCE_SPEED
    cpu = speed * sum(number * DEMONSTRATION_CPU[engine] for engine, number in demonstrations.items())
    for kind, number in trials.items():
        host = LOOP if kind.compiled and kind.engine == "exact" else kind.engine
        cpu += number * (measured[kind] or speed * TRIAL_CPU[host])
    return Cost(
        trials=sum(trials.values()),
        demonstrations=sum(demonstrations.values()),
        policies=policies,
        unknown=unknown,
        cpu=cpu + speed * (policies - unknown) * POLICY_CPU,
        measured=all(measured.values()),
    )


def _measured(results: Path, kind: TrialKind) -> float | None:
    """The mean CPU time of a trial in some blocks, s; None without any."""
    paths = sorted(results.glob(f"{partition(Path(), kind.policy, '*', kind.engine)}/*.parquet"))
    chosen = [paths[k] for k in np.linspace(0, len(paths) - 1, min(SAMPLED, len(paths))).astype(int)]
    times = [read_block(path, ["cpu_s"])["cpu_s"].to_numpy() for path in chosen]
    return float(np.mean(np.concatenate(times))) if times else None


def duration(seconds: float) -> str:
    """Returns a time as text: seconds, minutes, hours or days."""
    for size, unit in ((86400.0, "days"), (3600.0, "h"), (60.0, "min")):
        if seconds >= 2 * size:
            return f"{seconds / size:.1f} {unit}"
    return f"{seconds:.0f} s"
