"""Real-time rate of a demonstration with much contact, on one core.

    python -m benchmarks.physics.realtime [--scenario nominal] [--seed 1] [--json FILE]

A demonstration from a tilt of 3.3 degrees is simulated twice, with the scenario's contact step and with one of 1 ms.
The CPU time of each step is measured; unlike the wall time it does not depend on other programs. Main results:

- realtime_rate: simulated time over CPU time;
- step_ms_p50, step_ms_p99, step_ms_max: percentiles of the CPU time of a contact step;
- missed_deadlines: number of steps that would end after their period, if each starts at the beginning of its period or
  after the step before it, whichever is later; servo_ticks_late: the same for the ticks of the servo;
- contact_fraction: share of samples in contact;
- peak_force_N, mean_force_N: contact force with the scenario's step, beside those with 1 ms (reference_...);
  force_error_rms_N: root mean square of their difference;
- smallest_margin: smallest required stability margin of the virtual coupling.
"""

from __future__ import annotations

import copy
import time
from collections.abc import Sequence

from benchmarks.extras import require_packages

if __name__ == "__main__":
    require_packages("pydrake", "yaml")

import numpy as np
from pydrake.systems.analysis import Simulator

from benchmarks.command_line import argument_parser, run
from interfaces.terminal import progress, write_json
from models.bore import play_error
from models.hardware import DEVICE_PRESETS
from models.scenario import DEMONSTRATION_STREAM, Scenario, load_scenario, resolve_scenario
from skill.arrays import Array
from systems.haptics.coupling_margins import coupling_margins
from systems.virtual_environment import MakeVirtualEnvironment

TILT = [0.05, 0.03]  # rad; 3.3 degrees together
TOUCHING_FORCE = 0.05  # N; a larger force counts as contact
REFERENCE_STEP = 1e-3  # s
MAX_DURATION = 8.0  # s


def timed(scenario: Scenario, duration: float) -> tuple[Array, Array]:
    """Simulates until full depth or for ``duration`` (s).

    Returns:
        The CPU time of every servo tick (n,), s, and the samples of the recorder (20, m), one row per channel.
    """
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


def late(costs: Array, period: float) -> int:
    """Number of steps that end after their period, if no step starts before its period or before the last one ends.

    Args:
        costs: (n,), duration of each step, s.
        period: s.
    """
    free, missed = 0.0, 0
    for k, cost in enumerate(costs):
        free = max(free, k * period) + cost
        missed += int(free > (k + 1) * period)
    return int(missed)


def measure(name: str, seed: int) -> dict[str, float]:
    """All results for a scenario (name or path) and a seed."""
    scenario = load_scenario(name)
    scenario.start.tilt = list(TILT)
    resolved = resolve_scenario(scenario, seed=seed, stream=DEMONSTRATION_STREAM)
    with progress("real-time rate", 2) as advance:
        ticks, samples = timed(resolved, MAX_DURATION)
        advance("contact step of the scenario")
        reference_scenario = copy.deepcopy(resolved)
        reference_scenario.contact.time_step = REFERENCE_STEP
        _, exact = timed(reference_scenario, MAX_DURATION)
        advance("reference contact step")
    servo = DEVICE_PRESETS[resolved.device].servo_period
    per_step = max(1, round(resolved.contact.time_step / servo))
    steps = ticks[: len(ticks) // per_step * per_step].reshape(-1, per_step).sum(axis=1)
    force = np.linalg.norm(samples[3:6], axis=0)
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
        "contact_fraction": float((force > TOUCHING_FORCE).mean()),
        "play_error": play_error(resolved.geometry.facets),
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


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argument_parser(__doc__)
    parser.add_argument("--scenario", default="nominal", help="name or path of a scenario (default: nominal)")
    parser.add_argument("--seed", type=int, default=1, help="seed of the operator (default: 1)")
    options = parser.parse_args(arguments)
    if options.seed < 0:
        parser.error(f"--seed is {options.seed}; expected at least 0")
    results = measure(options.scenario, options.seed)
    for key, value in results.items():
        print(f"{key:24s} {value:.4g}")
    if options.json is not None:
        write_json(options.json, results)


if __name__ == "__main__":
    run(main)
