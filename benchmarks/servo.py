"""How well the servo keeps 1 kHz on this machine, beside the simulation on the wall's clock.

    python -m benchmarks.servo [--scenario device] [--seconds 10] [--contact-step MS] [--json FILE]

The servo's process has the loopback device. Keys of the file: ``tick_ms_p50``, ``tick_ms_p999`` and ``tick_ms_max``,
the time between two ticks; ``late_share``, ticks of all that end after their period; ``late_steps_share``, contact
steps of all that begin late; ``model_age_ms_p99``, age of the local model of the contact; ``realtime_rate``, the
simulated time over the CPU time of the simulation; ``priority``, whether the system grants the servo a real-time
priority.
"""

from __future__ import annotations

import time
from typing import Annotated, Any

import numpy as np
import typer

from benchmarks.command_line import JsonFile, finish, run
from experiments.demonstration_run import ServedRun
from interfaces.reports.result_tables import plain_table
from interfaces.terminal import show
from models.scenario import LIVE_STREAM, Scenario, load_scenario, resolve_scenario
from skill.arrays import Array
from systems.operators.device_operator import LOOPBACK
from systems.servo.servo_client import ServoClient

SEED = 774


def timing(scenario: Scenario, seconds: float) -> dict[str, Any]:
    """The pace of the servo over insertions that together last so long."""
    periods: list[Array] = []
    ages: list[float] = []
    late = ticks = late_steps = steps = 0
    simulated = cpu = 0.0
    with ServoClient(LOOPBACK) as servo:
        while ticks < 1e3 * seconds:
            served = ServedRun(scenario, servo)
            began = time.process_time()
            while served.step() is None and served.time < seconds:
                ages.append(1e3 * served.probe.age)
            simulated, cpu = simulated + served.time, cpu + time.process_time() - began
            periods.append(1e3 * np.diff(servo.end()))
            ticks, late = ticks + served.probe.ticks, late + served.probe.late
            steps, late_steps = steps + served.steps, late_steps + served.late_steps
        priority = servo.has_priority
    p50, p999, largest = np.percentile(np.concatenate(periods), [50.0, 99.9, 100.0]).tolist()
    return {
        **{"tick_ms_p50": p50, "tick_ms_p999": p999, "tick_ms_max": largest, "late_share": late / ticks},
        **{"late_steps_share": late_steps / steps, "model_age_ms_p99": float(np.percentile(ages, 99.0))},
        **{"realtime_rate": simulated / cpu, "priority": priority},
    }


def main(
    scenario: Annotated[str, typer.Option(help="Of the peg and hole; its engine is served.")] = "device",
    seconds: Annotated[float, typer.Option(min=1.0, help="Time of the insertions, s.")] = 10.0,
    contact_step: Annotated[
        float | None, typer.Option(min=1.0, metavar="MS", help="Step of the contact, in place of the scenario's.")
    ] = None,
    json: JsonFile = None,
) -> None:
    chosen = load_scenario(scenario, defaults=load_scenario("device"))
    if contact_step is not None:
        chosen.contact.time_step = 1e-3 * contact_step
    found = timing(resolve_scenario(chosen, seed=SEED, stream=LIVE_STREAM), seconds)
    table = plain_table("pace of the servo")
    table.add_column("figure")
    table.add_column("value", justify="right")
    for name, value in found.items():
        table.add_row(name, f"{value:.4g}")
    show(table)
    finish(found, json)


if __name__ == "__main__":
    run(main)
