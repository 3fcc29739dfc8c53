"""A session of a person at the controls: start, keep, discard, quit; nothing that was kept is ever lost."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pydrake.geometry import Meshcat

from models.hardware import DEVICE_PRESETS
from models.scenario import DEMONSTRATION_STREAM, Scenario, resolve_scenario
from skill.data.demonstration import Demonstration, write_demonstration
from skill.data.outcome import Ending, Outcome
from systems.live.display import LiveDisplay
from systems.live.page import LivePage
from systems.operators.device_operator import DeviceOperator, LiveDevice
from systems.operators.meshcat_operator import MeshcatOperator, add_sliders, hand_coordinates
from systems.runs.demonstration_run import DemonstrationRun
from systems.virtual_environment import MakeVirtualEnvironment, VirtualEnvironment, show_start, start_pose
from systems.visualization.scene import FRAME

START, GOOD, BAD, DISCARD, QUIT = "start (Space)", "keep as good (G)", "keep as bad (B)", "discard (X)", "quit (Q)"
KEYS = {START: "Space", GOOD: "KeyG", BAD: "KeyB", DISCARD: "KeyX", QUIT: "KeyQ"}
# What page and console say of the controls.
MOVING = [
    (["W", "S"], "feed, draw back"),
    (["←", "→", "↑", "↓"], "lean the peg"),
    (["J", "L", "I", "K"], "move it aside"),
]
JUDGING = [
    (["Space"], "start"),
    (["G"], "keep as good"),
    (["B"], "keep as bad"),
    (["X"], "discard"),
    (["Q"], "quit"),
    (["1", "2", "3"], "views"),
]
IDLE_PERIOD = 0.03  # in units of s, between two looks at the buttons
ABSENT_TOLD = 5.0  # in units of s without a page, after which that is said
SLACK = 0.04  # in units of s; what is late by more is not made up for
FIGURES_EVERY = 0.1  # in units of s


@dataclass
class Clock:
    """Keeps the simulation at the wall's pace, one servo tick after another, and counts what came too late.

    Attributes:
        period: of a tick, in units of s.
        per_step: ticks in a contact step.
        began: when the first tick began, in units of s.
        ticks: that have ended; of these ``late_ticks`` after their period's end.
        late_steps: contact steps whose last tick ended late.
    """

    period: float
    per_step: int
    began: float
    ticks: int = 0
    late_ticks: int = 0
    late_steps: int = 0

    def keep(self) -> None:
        """Ends a tick and waits for the wall; lateness is made up for as long as it is below `SLACK`."""
        self.ticks += 1
        ahead = self.began + self.ticks * self.period - time.monotonic()
        if ahead >= 0:
            time.sleep(ahead)
            return
        self.late_ticks += 1
        self.late_steps += int(self.ticks % self.per_step == 0)
        if -ahead > SLACK:
            self.began -= ahead

    def missed(self) -> list[int]:
        """[late contact steps, contact steps, late ticks, ticks] so far."""
        return [self.late_steps, self.ticks // self.per_step, self.late_ticks, self.ticks]


class LiveSession:
    """Records demonstrations by a person, one after another, into a folder.

    Args:
        scenario: with ranges; every demonstration draws its own start.
        out: folder for the recordings; what is there already stays, and numbering goes on after it.
        seed: of the starts.
        meshcat: whose scene the page shows.
        page: that the person has open.
        tell: where messages go besides the page, e.g. a console.
        open_device: of a device of the person's own; None takes sliders, keys and gamepad of the page.
        absent_limit: s to wait for a page that has been closed, after which the session ends.
    """

    def __init__(
        self,
        *,
        scenario: Scenario,
        out: Path,
        seed: int,
        meshcat: Meshcat,
        page: LivePage,
        tell: Callable[[str], None] = print,
        open_device: Callable[[], LiveDevice] | None = None,
        absent_limit: float = 120.0,
    ) -> None:
        self._scenario, self._out, self._seed, self._meshcat = scenario, out, seed, meshcat
        self._tell, self._open_device, self._absent_limit = tell, open_device, absent_limit
        self._page = page
        for label, key in KEYS.items():
            meshcat.AddButton(label, key)
        if open_device is None:
            add_sliders(meshcat, np.zeros(5))
        keys = JUDGING if open_device is not None else MOVING + JUDGING
        self._display = LiveDisplay(meshcat, page, keys=keys)
        for pressed, what in keys:
            tell(f"  {' '.join(pressed):10s} {what}")
        self._clicks = {label: meshcat.GetButtonClicks(label) for label in KEYS}
        self._device: LiveDevice | None = None
        self._gamepad = False
        self.kept: list[Path] = []

    def run(self) -> list[Path]:
        """Goes on until the person quits, or stays away; returns what was kept."""
        self._show_next()
        self._say("ready: press Space to start")
        absent_since: float | None = None
        told = False
        try:
            while True:
                if self._clicked(QUIT):
                    self._say("session over")
                    return self.kept
                if self._present():
                    absent_since, told = None, False
                elif absent_since is None:
                    absent_since = time.monotonic()
                elif not told and time.monotonic() - absent_since > ABSENT_TOLD:
                    told = True
                    self._tell(f"no page is open: open {self._page.address} to go on")
                elif time.monotonic() - absent_since > self._absent_limit:
                    self._tell("the page stayed closed: session over")
                    return self.kept
                if self._clicked(START):
                    self._forget_clicks()
                    if self._show_one():
                        self._say("session over")
                        return self.kept
                    self._show_next()
                self._display.follow_views()
                time.sleep(IDLE_PERIOD)
        finally:
            self._release()

    # ------------------------------------------------------- one demonstration

    def _next(self) -> tuple[int, Scenario]:
        """Number and scenario of the demonstration that comes next."""
        number = next_number(self._out)
        seed = self._seed * 100_000 + number
        return number, resolve_scenario(self._scenario, seed=seed, stream=DEMONSTRATION_STREAM, person=self._seed)

    def _show_next(self) -> None:
        """Draws how the next demonstration will start."""
        _, resolved = self._next()
        show_start(resolved, meshcat=self._meshcat)
        self._display.look()
        X_HP = start_pose(resolved)
        if self._open_device is None:
            add_sliders(self._meshcat, hand_coordinates(X_HP))
        self._display.show_forces(X_HP, np.zeros(6), share=0.0, touch=None)
        self._display.show_figures(
            X_HP,
            np.zeros(6),
            share=0.0,
            depth=[-float(X_HP.translation()[2]), resolved.full_depth],
            rate=0.0,
            missed=[0, 0, 0, 0],
            energy=0.0,
            lowest=0.0,
            kept=len(self.kept),
        )

    def _show_one(self) -> bool:
        """One demonstration from start to verdict; True if the person quits."""
        number, resolved = self._next()
        try:
            environment = self._build(resolved)
            run = DemonstrationRun(resolved, environment)
            ending = self._simulate(run, environment, resolved)
        except OSError as error:  # the person's device
            self._release()
            self._say(f"device lost ({error}): demonstration discarded, Space starts another")
            return False
        if ending is None:
            self._say("the page was closed: the demonstration is discarded; Space starts another")
            return False
        return self._judge(run, ending, number)

    def _build(self, resolved: Scenario) -> VirtualEnvironment:
        X_HP_start = start_pose(resolved)
        operator: DeviceOperator | MeshcatOperator
        if self._open_device is not None:
            if self._device is None:
                self._device = self._open_device()
            operator = DeviceOperator(
                device=self._device,
                period=DEVICE_PRESETS[resolved.device].servo_period,
                X_HD_start=X_HP_start,
                moved_before=self._device.read_pose(),  # the peg starts where the handle is now
            )
        else:
            operator = MeshcatOperator(meshcat=self._meshcat, period=0.02, X_HD_start=X_HP_start)
        return MakeVirtualEnvironment(resolved, operator=operator, meshcat=self._meshcat, contact_forces=False)

    def _simulate(self, run: DemonstrationRun, environment: VirtualEnvironment, resolved: Scenario) -> Ending | None:
        """Returns how the demonstration ended, or None if the page was closed."""
        servo = DEVICE_PRESETS[resolved.device].servo_period
        clock = Clock(servo, max(1, round(resolved.contact.time_step / servo)), began=time.monotonic())
        drawn, shown, shown_at = 0.0, time.monotonic(), 0.0
        self._say("showing: G keep as good, B keep as bad, X discard")
        while True:
            ended = self._advance(run, clock, ticks=round(resolved.recorder.period / servo))
            now = clock.ticks * servo
            if ended is not None or time.monotonic() - drawn > FRAME:
                drawn = time.monotonic()
                self._draw_forces(run, environment)
            if ended is not None or time.monotonic() - shown > FIGURES_EVERY:
                rate = (now - shown_at) / (time.monotonic() - shown)
                shown, shown_at = time.monotonic(), now
                self._show_figures(run, environment, resolved, rate=rate, missed=clock.missed())
                self._display.follow_views()
                self._watch_gamepad()
                if not self._present():
                    return None
            if ended is not None:
                return ended
            if any(self._meshcat.GetButtonClicks(b) != self._clicks[b] for b in (GOOD, BAD, DISCARD, QUIT)):
                return Ending(Outcome.STOPPED)

    def _advance(self, run: DemonstrationRun, clock: Clock, *, ticks: int) -> Ending | None:
        """Simulates so many ticks of the servo, each in its time; returns what ended the demonstration, or None."""
        for _ in range(ticks):
            ended = run.advance((clock.ticks + 1) * clock.period)
            clock.keep()
            if ended is not None:
                return ended
        return None

    def _judge(self, run: DemonstrationRun, ending: Ending, number: int) -> bool:
        """Waits for the person's verdict on what was shown; True if they quit."""
        try:
            shown = run.demonstration(ending, habit="live", number=number)
        except ValueError:
            self._say("too short to keep; Space starts another")
            self._forget_clicks()
            return False
        self._say(f"{shown.reason}: G keep as good, B keep as bad, X discard")
        while True:
            for button, good in ((GOOD, True), (BAD, False)):
                if self._clicked(button) and self._keep(
                    run.demonstration(ending, good=good, habit="live", number=number)
                ):
                    return False
            if self._clicked(DISCARD):
                self._say("discarded: Space starts another")
                return False
            if self._clicked(QUIT):
                return True
            if not self._present():
                self._tell("the page was closed before a verdict: the demonstration is discarded")
                return False
            self._display.follow_views()
            time.sleep(IDLE_PERIOD)

    def _keep(self, demonstration: Demonstration) -> bool:
        """Writes it; a failure is said, and leaves the verdict open for another try."""
        number = demonstration.metadata["number"]
        path = self._out / f"{number:03d}_{'good' if demonstration.good else 'bad'}_live.parquet"
        try:
            write_demonstration(demonstration, path)
        except OSError as error:
            self._say(f"not kept, {error.strerror or error}: make room and press again, or X to discard")
            return False
        self.kept.append(path)
        self._say(f"kept {path.name}: Space starts another")
        return True

    # ------------------------------------------------------------- the page

    def _draw_forces(self, run: DemonstrationRun, environment: VirtualEnvironment) -> None:
        context = run.simulator.get_context()
        wrench, share = environment.felt(context)
        touch = environment.touch(context)
        self._display.show_forces(environment.peg_pose(context), wrench, share=share, touch=touch)

    def _show_figures(
        self, run: DemonstrationRun, environment: VirtualEnvironment, resolved: Scenario, **figures: Any
    ) -> None:
        context = run.simulator.get_context()
        wrench, share = environment.felt(context)
        energy, lowest = environment.energy(context)
        X_HP = environment.peg_pose(context)
        depth = [-float(X_HP.translation()[2]), resolved.full_depth]
        self._display.show_figures(
            X_HP, wrench, share=share, depth=depth, energy=float(energy), lowest=float(lowest), **figures
        )

    def _watch_gamepad(self) -> None:
        there = len(self._meshcat.GetGamepad().axes) > 0  # a page keeps the index of one that has gone
        if self._gamepad and not there:
            self._say("the gamepad is gone: sliders and keys go on")
        elif there and not self._gamepad:
            self._say("gamepad: left stick leans, right stick feeds")
        self._gamepad = there

    def _present(self) -> bool:
        return bool(self._meshcat.GetNumActiveConnections() > 0)

    def _clicked(self, label: str) -> bool:
        clicks = self._meshcat.GetButtonClicks(label)
        if clicks == self._clicks[label]:
            return False
        self._clicks[label] = clicks
        return True

    def _forget_clicks(self) -> None:
        for label in KEYS:
            self._clicked(label)

    def _say(self, message: str) -> None:
        self._display.say(message)
        self._tell(message)

    def _release(self) -> None:
        if self._device is not None:
            try:
                self._device.close()
            except OSError as error:
                self._tell(f"the device did not close: {error}")
            self._device = None


def next_number(folder: Path) -> int:
    """One more than the largest number that a recording in ``folder`` begins with."""
    numbers = [int(path.name[:3]) for path in folder.glob("[0-9][0-9][0-9]_*.parquet")]
    return max(numbers, default=-1) + 1
