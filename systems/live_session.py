"""A session of a person at the controls: start, keep, discard, quit; nothing that was kept is ever lost."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydrake.geometry import Meshcat

from models.hardware import DEVICE_PRESETS
from models.scenario import DEMONSTRATION_STREAM, Scenario, resolve_scenario
from skill.demonstration import Demonstration, write_demonstration
from systems.demonstrate import DemonstrationRun
from systems.device_protocol import DeviceOperator, LiveDevice
from systems.live_display import LiveDisplay
from systems.meshcat_operator import MeshcatOperator, add_sliders
from systems.virtual_environment import MakeVirtualEnvironment, VirtualEnvironment, start_pose

START, GOOD, BAD, DISCARD, QUIT = "start (Space)", "keep as good (G)", "keep as bad (B)", "discard (X)", "quit (Q)"
KEYS = {START: "Space", GOOD: "KeyG", BAD: "KeyB", DISCARD: "KeyX", QUIT: "KeyQ"}
IDLE_PERIOD = 0.03  # in units of s, between two looks at the buttons
FIGURES_EVERY = 0.2  # in units of s


@dataclass
class Clock:
    """Keeps the simulation at the wall's pace, and counts the pieces that came too late."""

    began: float
    simulated: float = 0.0
    missed: int = 0

    def keep(self, simulated: float) -> None:
        """Waits until the wall has come as far as the simulation; what is late is counted and not made up for."""
        self.simulated = simulated
        ahead = self.began + simulated - time.monotonic()
        if ahead > 0:
            time.sleep(ahead)
        else:
            self.missed += 1
            self.began -= ahead


class LiveSession:
    """Records demonstrations by a person, one after another, into a folder.

    Args:
        scenario: with ranges; every demonstration draws its own start.
        out: folder for the recordings; what is there already stays, and numbering goes on after it.
        seed: of the starts.
        meshcat: whose page the person has open.
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
        tell: Callable[[str], None] = print,
        open_device: Callable[[], LiveDevice] | None = None,
        absent_limit: float = 120.0,
    ) -> None:
        self._scenario, self._out, self._seed, self._meshcat = scenario, out, seed, meshcat
        self._tell, self._open_device, self._absent_limit = tell, open_device, absent_limit
        for label, key in KEYS.items():
            meshcat.AddButton(label, key)
        if open_device is None:
            add_sliders(meshcat, np.zeros(5))
        self._display = LiveDisplay(meshcat)
        self._clicks = {label: meshcat.GetButtonClicks(label) for label in KEYS}
        self._device: LiveDevice | None = None
        self._gamepad = False
        self.kept: list[Path] = []

    def run(self) -> list[Path]:
        """Goes on until the person quits, or stays away; returns what was kept."""
        self._say("ready: press Space to start")
        absent_since: float | None = None
        try:
            while True:
                if self._clicked(QUIT):
                    self._say("session over")
                    return self.kept
                if self._present():
                    absent_since = None
                elif absent_since is None:
                    absent_since = time.monotonic()
                    self._tell(f"no page is open: open {self._meshcat.web_url()} to go on")
                elif time.monotonic() - absent_since > self._absent_limit:
                    self._tell("the page stayed closed: session over")
                    return self.kept
                if self._clicked(START):
                    self._forget_clicks()
                    if self._show_one():
                        self._say("session over")
                        return self.kept
                self._display.follow_views()
                time.sleep(IDLE_PERIOD)
        finally:
            self._release()

    # ------------------------------------------------------- one demonstration

    def _show_one(self) -> bool:
        """One demonstration from start to verdict; True if the person quits."""
        number = next_number(self._out)
        resolved = resolve_scenario(
            self._scenario, seed=self._seed * 100_000 + number, stream=DEMONSTRATION_STREAM, person=self._seed
        )
        try:
            environment = self._build(resolved)
            run = DemonstrationRun(resolved, environment)
            outcome = self._simulate(run, environment, resolved)
        except OSError as error:  # the person's device
            self._release()
            self._say(f"device lost ({error}): demonstration discarded, Space starts another")
            return False
        if outcome == "page closed":
            self._tell("the page was closed: the demonstration is discarded")
            return False
        return self._judge(run, outcome, number)

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
        return MakeVirtualEnvironment(resolved, operator=operator, meshcat=self._meshcat)

    def _simulate(self, run: DemonstrationRun, environment: VirtualEnvironment, resolved: Scenario) -> str:
        """What ended it: an outcome, a button, or a closed page."""
        period = resolved.recorder.period
        clock = Clock(began=time.monotonic())
        shown, shown_at = time.monotonic(), 0.0
        self._say("showing: G keep as good, B keep as bad, X discard")
        step = 0
        while True:
            step += 1
            ended = run.advance(step * period)
            clock.keep(step * period)
            force = self._show_force(run, environment)
            if time.monotonic() - shown > FIGURES_EVERY:
                rate = (step * period - shown_at) / (time.monotonic() - shown)
                shown, shown_at = time.monotonic(), step * period
                energy = float(environment.energy(run.simulator.get_context())[0])
                self._display.show_figures(force=force, rate=min(rate, 2.0), missed=clock.missed, energy=energy)
                self._display.follow_views()
                self._watch_gamepad()
                if not self._present():
                    return "page closed"
            if ended is not None:
                return ended
            if any(self._meshcat.GetButtonClicks(b) != self._clicks[b] for b in (GOOD, BAD, DISCARD, QUIT)):
                return "stopped"

    def _judge(self, run: DemonstrationRun, outcome: str, number: int) -> bool:
        """Waits for the person's verdict on what was shown; True if they quit."""
        try:
            shown = run.demonstration(outcome, habit="live", number=number)
        except ValueError:
            self._say("too short to keep; Space starts another")
            self._forget_clicks()
            return False
        self._say(f"{shown.outcome}: G keep as good, B keep as bad, X discard")
        while True:
            for button, good in ((GOOD, True), (BAD, False)):
                if self._clicked(button) and self._keep(
                    run.demonstration(outcome, good=good, habit="live", number=number)
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

    def _show_force(self, run: DemonstrationRun, environment: VirtualEnvironment) -> float:
        context = run.simulator.get_context()
        wrench, share = environment.felt(context)
        self._display.show_force(environment.peg_pose(context).translation(), wrench[3:], share=share)
        return float(np.linalg.norm(wrench[3:]))

    def _watch_gamepad(self) -> None:
        there = len(self._meshcat.GetGamepad().axes) > 0  # a page keeps the index of one that has gone
        if self._gamepad and not there:
            self._say("the gamepad is gone: sliders and keys go on")
        elif there and not self._gamepad:
            self._say("gamepad: left stick tilts, right stick feeds")
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
