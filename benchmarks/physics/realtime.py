"""Whether a whole contact-rich demonstration keeps up with the clock, on one core.

A demonstration from a large tilt is simulated one contact step after another, and each step's processor time is taken
(not the wall's, which another program on the machine would spoil). `missed_deadlines` replays these times on a clock:
a step may begin when its period begins, and its deadline is the period's end, so that one slow step can make the next
ones late. `servo_ticks_late` does the same for every tick of the 1 kHz servo, all in one thread.

What the slower contact costs is shown beside it: the same hand is led along the same path at 1 ms, and the contact
forces are compared.

    python -m benchmarks.physics.realtime --json out/realtime.json
"""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from numpy.typing import NDArray
from pydrake.systems.analysis import Simulator

from models.bore import facet_sagitta
from models.hardware import DEVICE_PRESETS
from models.scenario import DEMONSTRATION_STREAM, Scenario, load_scenario, resolve_scenario
from systems.haptics.coupling_margins import coupling_margins
from systems.virtual_environment import MakeVirtualEnvironment

TILT = [0.05, 0.03]  # in units of rad: 3.3 degrees
TOUCHING = 0.05  # in units of N
REFERENCE_STEP = 1e-3  # in units of s


def timed(scenario: Scenario, duration: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Processor seconds of every servo tick until full depth, and the samples of the recorder (20 rows of channels)."""
    environment = MakeVirtualEnvironment(scenario)
    simulator = Simulator(environment.diagram)
    environment.set_start(simulator.get_mutable_context())
    simulator.Initialize()
    period = DEVICE_PRESETS[scenario.device].servo_period
    ticks = []
    for k in range(round(duration / period)):
        began = time.process_time()
        simulator.AdvanceTo((k + 1) * period)
        ticks.append(time.process_time() - began)
        if k % 20 == 0 and -environment.peg_pose(simulator.get_context()).translation()[2] >= scenario.full_depth:
            break
    return np.array(ticks), np.array(environment.log.FindLog(simulator.get_context()).data())


def late(costs: NDArray[np.float64], period: float) -> int:
    """How many steps end after their period's end, when none begins before its own."""
    free, missed = 0.0, 0
    for k, cost in enumerate(costs):
        free = max(free, k * period) + cost
        missed += int(free > (k + 1) * period)
    return int(missed)


def measure(name: str, seed: int) -> dict[str, float]:
    """All keys of the report."""
    scenario = load_scenario(name)
    scenario.start.tilt = list(TILT)
    resolved = resolve_scenario(scenario, seed=seed, stream=DEMONSTRATION_STREAM)
    ticks, samples = timed(resolved, 8.0)
    servo = DEVICE_PRESETS[resolved.device].servo_period
    per_step = max(1, round(resolved.contact.time_step / servo))
    steps = ticks[: len(ticks) // per_step * per_step].reshape(-1, per_step).sum(axis=1)
    force = np.linalg.norm(samples[3:6], axis=0)
    resolved.contact.time_step = REFERENCE_STEP
    _, exact = timed(resolved, 8.0)
    reference = np.linalg.norm(exact[3:6], axis=0)
    shared = min(len(force), len(reference))
    return {
        "realtime_rate": float(len(ticks) * servo / ticks.sum()),
        "step_ms_p50": float(1e3 * np.percentile(steps, 50)),
        "step_ms_p99": float(1e3 * np.percentile(steps, 99)),
        "step_ms_max": float(1e3 * steps.max()),
        "missed_deadlines": late(steps, per_step * servo),
        "steps": len(steps),
        "facets": resolved.geometry.facets,
        "contact_fraction": float((force > TOUCHING).mean()),
        "sagitta_over_clearance": facet_sagitta(resolved.geometry.hole_radius, resolved.geometry.facets)
        / resolved.geometry.clearance,
        "contact_step_ms": 1e3 * per_step * servo,
        "servo_ms": 1e3 * servo,
        "servo_ticks_late": late(ticks, servo),
        "duration_s": float(len(ticks) * servo),
        "reference_duration_s": float(0.02 * (len(reference) - 1)),
        "peak_force_N": float(force.max()),
        "reference_peak_force_N": float(reference.max()),
        "mean_force_N": float(force[:shared].mean()),
        "reference_mean_force_N": float(reference[:shared].mean()),
        "force_error_rms_N": float(np.sqrt(np.mean((force[:shared] - reference[:shared]) ** 2))),
        "smallest_margin": min(m.factor for m in coupling_margins(scenario) if m.required),
    }


def main(
    json_file: Annotated[Path | None, typer.Option("--json", help="Where to write the figures.")] = None,
    scenario: Annotated[str, typer.Option(help="Name or path of a scenario.")] = "nominal",
    seed: Annotated[int, typer.Option(min=0, help="Of the operator.")] = 1,
) -> None:
    """Measures the real-time rate of a demonstration, and what the separated rates cost in force."""
    figures = measure(scenario, seed)
    for key, value in figures.items():
        print(f"{key:24s} {value:.4g}")
    if json_file is not None:
        json_file.parent.mkdir(parents=True, exist_ok=True)
        json_file.write_text(json.dumps(figures, indent=1) + "\n")


if __name__ == "__main__":
    typer.run(main)
