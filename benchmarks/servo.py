"""How well the servo keeps 1 kHz, and how well it renders the simulation.

    python -m benchmarks.servo [--scenario device] [--seconds 10] [--contact-step MS] [--json FILE]

1. The servo's process, with the loopback device, beside the simulation on the wall's clock: alone, with the page open
   in a headless Chromium, and beside a busy process on each core. Columns: percentiles of the time between two ticks;
   late ticks (that end after their period) of all; late contact steps of all; age of the local model of the contact;
   rate, the simulated time over the CPU time of the simulation.
2. The force, without a clock: hands that are recorded once, with operator, device and contact all at 1 kHz, move the
   served probe. The error is the root mean square of the difference from the wrench of the recording, in N and of its
   root mean square.
3. Energy, without a clock: hands that push the peg against the mouth at random and at single frequencies, with the
   grip and the friction that the device's preset assumes. The energy that the display generates is what it gives back
   beyond all that the hand has put in, and that grip and friction have absorbed.

Keys of the file: ``tick_ms_p50`` to ``tick_ms_max``, ``late_share``, ``late_steps_share``, ``model_age_ms_p99`` and
``realtime_rate``, of the servo alone; ``conditions``, the same for each condition; ``force_rms_error_n``,
``force_rms_error_share`` and ``torque_rms_error_share``, over the hands; ``hands``, the same for each;
``energy_generated_mj``, the largest; ``priority``, whether the system grants the servo a real-time priority.
"""

from __future__ import annotations

import copy
import math
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from multiprocessing import get_context
from typing import Annotated, Any

import numpy as np
import typer
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context, LeafSystem

from benchmarks.command_line import JsonFile, finish, run
from benchmarks.headless_browser import headless_browser
from experiments.demonstration_run import DemonstrationRun
from experiments.lockstep import lockstep
from experiments.served_run import ServedRun
from interfaces.live.display import LiveDisplay
from interfaces.live.page import open_live_page
from interfaces.live.session import PICTURE_PERIOD
from interfaces.reports.result_tables import plain_table
from interfaces.terminal import console, progress
from models.hardware import DEVICE_PRESETS
from models.scenario import DEMONSTRATION_STREAM, LIVE_STREAM, Scenario, load_scenario, resolve_scenario
from skill.arrays import Array
from systems.operators.device_operator import LOOPBACK, DeviceOperator
from systems.operators.loopback_device import Hand, LoopbackDevice
from systems.servo.served_environment import MakeServedEnvironment
from systems.servo.servo_client import ServoClient
from systems.servo.servo_diagram import MakeServo
from systems.virtual_environment import MakeVirtualEnvironment, start_pose

CONDITIONS = ("alone", "page open", "busy cores")
HANDS = range(774, 780)
"""Seeds of the simulated operators whose hands move the probe."""

MODEL_DELAY = -1
"""Ticks after the end of a contact step at which its model arrives: a step is simulated in less than its time."""

ENERGY_SECONDS = 2.0
FREQUENCIES = (2.0, 5.0, 10.0, 20.0, 40.0)  # in units of Hz
RANDOM_HANDS = range(780, 785)


def busy(stop: Any) -> None:
    """Occupies a core."""
    while not stop.is_set():
        sum(range(10_000))


@contextmanager
def busy_cores(number: int) -> Iterator[None]:
    """Occupies a number of cores."""
    spawn = get_context("spawn")
    stop = spawn.Event()
    processes = [spawn.Process(target=busy, args=(stop,), daemon=True) for _ in range(number)]
    for process in processes:
        process.start()
    time.sleep(1.0)
    try:
        yield
    finally:
        stop.set()
        for process in processes:
            process.join()


@contextmanager
def shown_page() -> Iterator[Callable[[ServedRun], None]]:
    """Yields what draws a run into a page that a headless Chromium shows.

    Raises:
        ModuleNotFoundError: if selenium is not installed.
    """
    page = open_live_page()
    display = LiveDisplay(page)
    drawn = 0.0

    def draw(served: ServedRun) -> None:
        nonlocal drawn
        if time.monotonic() - drawn > PICTURE_PERIOD:
            drawn = time.monotonic()
            context = served.run.simulator.get_context()
            X_HP = served.environment.plant.peg_pose(context)
            display.move_peg(X_HP)
            contact = served.environment.plant.contact_force(context)
            wrench, load = served.probe.wrench, served.probe.load
            display.draw_forces(X_HP.translation(), wrench[3:], load=load, contact=contact)

    try:
        with headless_browser(page.address):
            time.sleep(3.0)
            yield draw
    finally:
        page.close()


def timing(scenario: Scenario, seconds: float, draw: Callable[[ServedRun], None]) -> dict[str, Any]:
    """The pace of the servo over insertions that together last so long."""
    periods: list[Array] = []
    ages: list[float] = []
    late = ticks = late_steps = steps = 0
    simulated, cpu = 0.0, 0.0
    with ServoClient(LOOPBACK) as servo:
        while ticks < 1e3 * seconds:
            served = ServedRun(scenario, servo)
            began = time.process_time()
            while served.step() is None and served.time < seconds:
                ages.append(1e3 * served.probe.age)
                draw(served)
            simulated, cpu = simulated + served.time, cpu + time.process_time() - began
            periods.append(1e3 * np.diff(servo.end()))
            ticks, late = ticks + served.probe.ticks, late + served.probe.late
            steps, late_steps = steps + served.steps, late_steps + served.late_steps
    found = np.concatenate(periods)
    p50, p999 = np.percentile(found, [50.0, 99.9])
    return {
        **{"ticks": ticks, "tick_ms_p50": float(p50), "tick_ms_p999": float(p999)},
        **{"tick_ms_max": float(found.max()), "late_share": late / ticks, "late_steps_share": late_steps / steps},
        **{"model_age_ms_p99": float(np.percentile(ages, 99.0)), "priority": servo.has_priority},
        "realtime_rate": simulated / cpu,
    }


def timings(scenario: Scenario, seconds: float) -> dict[str, dict[str, Any]]:
    """The pace of the servo in each condition."""
    found = {}
    for name in CONDITIONS:
        with ExitStack() as stack:
            draw: Callable[[ServedRun], None] = lambda served: None  # noqa: E731
            if name == "page open":
                draw = stack.enter_context(shown_page())
            if name == "busy cores":
                stack.enter_context(busy_cores(2))
            found[name] = timing(scenario, seconds, draw)
    return found


class HandPath(LeafSystem):
    """A hand that follows recorded poses, one for each tick."""

    def __init__(self, poses: list[RigidTransform], period: float) -> None:
        super().__init__()
        self._poses, self._period = poses, period
        self.DeclareAbstractOutputPort("hand_pose", Value[RigidTransform], self._calc, {self.time_ticket()})

    def _calc(self, context: Context, output: Value) -> None:
        output.set_value(self._poses[min(round(context.get_time() / self._period), len(self._poses) - 1)])


def recorded(scenario: Scenario, period: float) -> tuple[list[RigidTransform], Array]:
    """The poses of a simulated operator's hand, and the rendered wrenches (n, 6), with contact once a tick."""
    exact = copy.deepcopy(scenario)
    exact.contact.time_step = period
    environment = MakeVirtualEnvironment(exact)
    demonstration = DemonstrationRun(exact, environment)
    operator = environment.diagram.GetSubsystemByName("operator")
    poses, wrenches, ending = [], [], None
    while ending is None:
        context = demonstration.simulator.get_context()
        pose = operator.GetOutputPort("hand_pose").Eval(operator.GetMyContextFromRoot(context))
        poses.append(RigidTransform(pose))  # a copy: the value changes with the next tick
        wrenches.append(environment.rendered_wrench(context))
        ending = demonstration.advance(len(poses) * period)
    return poses, np.array(wrenches)


def force_errors(scenario: Scenario) -> dict[str, float]:
    """The error of the served wrench against that of a recording, for one hand."""
    period = DEVICE_PRESETS[scenario.device].servo_period
    poses, exact = recorded(scenario, period)
    environment = MakeServedEnvironment(scenario)
    servo = MakeServo(scenario, operator=HandPath(poses, period), X_HP_start=environment.X_HP_start)
    servo.start(environment.X_HP_start)
    ticks = lockstep(
        servo,
        DemonstrationRun(scenario, environment),
        environment,
        time_step=scenario.contact.time_step,
        delay=MODEL_DELAY,
    )
    served = np.array([probe.wrench for (probe, _), _ in zip(ticks, exact, strict=False)])
    exact = exact[: len(served)]
    rms = [np.sqrt(np.mean(np.sum((served - exact)[:, part] ** 2, axis=1))) for part in (slice(3), slice(3, 6))]
    size = [np.sqrt(np.mean(np.sum(exact[:, part] ** 2, axis=1))) for part in (slice(3), slice(3, 6))]
    return {
        **{"force_rms_error_n": float(rms[1]), "force_rms_n": float(size[1])},
        **{"force_rms_error_share": float(rms[1] / size[1]), "torque_rms_error_share": float(rms[0] / size[0])},
    }


def paths() -> Iterator[tuple[str, Callable[[float], Array]]]:
    """Names and paths of hands that push down and shake."""
    down = np.array([0.0, 0.0, -0.012, 0.0, 0.0, 0.0])
    shake = np.array([0.002, 0.002, 0.004, math.radians(2.0), math.radians(2.0), 0.0])

    def single(frequency: float) -> Callable[[float], Array]:
        return lambda t: min(t / 0.3, 1.0) * down + shake * math.sin(2.0 * math.pi * frequency * t)

    def random(seed: int) -> Callable[[float], Array]:
        rng = np.random.default_rng(seed)
        frequencies, phases = rng.uniform(0.5, 30.0, (6, 8)), rng.uniform(0.0, 2.0 * math.pi, (6, 8))
        parts = rng.normal(size=(6, 8)) / 3.0
        return lambda t: (
            min(t / 0.3, 1.0) * down + shake * np.sum(parts * np.sin(2.0 * math.pi * frequencies * t + phases), axis=1)
        )

    for frequency in FREQUENCIES:
        yield f"{frequency:g} Hz", single(frequency)
    for seed in RANDOM_HANDS:
        yield f"random {seed}", random(seed)


def energy_generated(scenario: Scenario, path: Callable[[float], Array]) -> float:
    """The largest energy, J, that the display has given back beyond what the hand has put in and the grip absorbed."""
    parameters = DEVICE_PRESETS[scenario.device]
    grip = Hand(
        damping=parameters.grip_damping,
        friction=parameters.friction_force,
        angular_damping=parameters.grip_angular_damping,
        angular_friction=parameters.friction_torque,
    )
    now = [0.0]
    device = LoopbackDevice(path, grip, clock=lambda: now[0])
    X = start_pose(scenario)
    environment = MakeServedEnvironment(scenario)
    operator = DeviceOperator(device=device, period=parameters.servo_period, X_HD_start=X)
    servo = MakeServo(scenario, operator=operator, X_HP_start=X)
    servo.start(X)
    step, largest = scenario.contact.time_step, 0.0
    for probe, _ in lockstep(
        servo, DemonstrationRun(scenario, environment), environment, time_step=step, delay=MODEL_DELAY
    ):
        largest = max(largest, -probe.energy - device.dissipated)
        now[0] = probe.time + parameters.servo_period
        if probe.time > ENERGY_SECONDS:
            break
    return largest


def main(
    scenario: Annotated[str, typer.Option(help="Of the peg and hole; its engine is served.")] = "device",
    seconds: Annotated[float, typer.Option(min=1.0, help="Time in each condition, s.")] = 10.0,
    contact_step: Annotated[
        float | None, typer.Option(min=1.0, metavar="MS", help="Step of the contact, in place of the scenario's.")
    ] = None,
    json: JsonFile = None,
) -> None:
    chosen = load_scenario(scenario, defaults=load_scenario("device"))
    if contact_step is not None:
        chosen.contact.time_step = 1e-3 * contact_step
    conditions = timings(resolve_scenario(chosen, seed=HANDS[0], stream=LIVE_STREAM), seconds)
    hands, energies = {}, {}
    with progress("force and energy", len(HANDS) + len(list(paths()))) as advance:
        for seed in HANDS:
            hands[seed] = force_errors(resolve_scenario(chosen, seed=seed, stream=DEMONSTRATION_STREAM))
            advance(f"hand {seed}")
        for name, path in paths():
            resolved = resolve_scenario(chosen, seed=HANDS[0], stream=DEMONSTRATION_STREAM)
            energies[name] = 1e3 * energy_generated(resolved, path)
            advance(name)
    show(conditions, hands, energies)
    mean = {key: float(np.mean([hand[key] for hand in hands.values()])) for key in next(iter(hands.values()))}
    details = {"conditions": conditions, "hands": hands, "energies_mj": energies}
    finish({**conditions["alone"], **mean, "energy_generated_mj": max(energies.values()), **details}, json)


def show(conditions: dict[str, Any], hands: dict[int, Any], energies: dict[str, float]) -> None:
    """Prints the results."""
    table = plain_table("ticks of the servo, ms")
    for title in ("condition", "50 %", "99.9 %", "largest", "late", "late steps", "model's age, 99 %", "rate"):
        table.add_column(title, justify="left" if title == "condition" else "right")
    for name, of in conditions.items():
        figures = [f"{of[key]:.2f}" for key in ("tick_ms_p50", "tick_ms_p999", "tick_ms_max")]
        shares = [f"{100 * of[key]:.2f} %" for key in ("late_share", "late_steps_share")]
        table.add_row(name, *figures, *shares, f"{of['model_age_ms_p99']:.1f}", f"{of['realtime_rate']:.2f}")
    console.print(table)
    table = plain_table("error of the wrench")
    for title in ("hand", "force", "torque"):
        table.add_column(title, justify="right")
    for seed, of in hands.items():
        shares = [f"{100 * of[key]:.1f} %" for key in ("force_rms_error_share", "torque_rms_error_share")]
        table.add_row(str(seed), *shares)
    console.print(table)
    worst = max(energies, key=lambda name: energies[name])
    console.print(
        f"energy generated beyond what the grip absorbed, over {len(energies)} hands: at most {energies[worst]:.3f} mJ"
        f" ({worst})",
        highlight=False,
    )


if __name__ == "__main__":
    run(main)
