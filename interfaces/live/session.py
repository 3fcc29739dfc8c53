"""A live session: a person gives demonstrations one after another and keeps or discards each of them."""

from __future__ import annotations

import re
import time
from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from experiments.corrections import correction_scenario
from experiments.demonstration_run import DemonstrationRun, ServedRun
from experiments.demonstration_set import attempt_seed
from interfaces.live.display import ContactLoad, LiveDisplay
from interfaces.live.page import LivePage
from models.scenario import LIVE_STREAM, Scenario, resolve_scenario
from skill.arrays import Array
from skill.data.demonstration import Demonstration, write_demonstration
from skill.data.outcome import Ending, Outcome
from skill.data.tables import TooShortError
from skill.features.measurement import MEASURED
from skill.policy.policy_observer import PolicyObserver
from skill.policy.query_state import QueryState
from skill.policy.rig_policy import RigPolicy
from systems.operators.page_hand import PAGE, PageInput
from systems.servo.servo_client import ServoClient
from systems.virtual_environment import start_pose

IDLE_PERIOD = 0.03  # in units of s, between two checks of the buttons
PICTURE_PERIOD = 1 / 60  # in units of s, between two pictures
READING_PERIOD = 0.1  # in units of s, between two updates of the panel
RATE_READINGS = 10  # updates over which the real-time rate is measured: about a second

START, GOOD, BAD, DISCARD, QUIT = "start (Space)", "keep as good (G)", "keep as bad (B)", "discard (X)", "quit (Q)"
KEYS = {START: "Space", GOOD: "KeyG", BAD: "KeyB", DISCARD: "KeyX", QUIT: "KeyQ"}

READY, RECORDING, VERDICT, BUSY, OVER = "ready", "recording", "verdict", "busy", "over"
"""The phases of a session, which the page knows. While it is busy, the person can do nothing but quit."""


class LiveSession:
    """Records demonstrations by a person, one after another, into a folder.

    Args:
        start_of: returns the resolved scenario of the demonstration with a number (see `live_scenario`).
        out: folder for the recordings; existing recordings stay, and the numbering continues after them.
        page: page that the person opens.
        announce: prints a message that the page shows too on the console.
        driver: name of the driver of the person's haptic device (see `find_device`); None uses sliders, keys and
            gamepad of the page. Either runs in the servo's process.
        policy: names the contact states while the person demonstrates, and shows what it would do; None shows nothing.
        absence_limit: time without an open page after which the session ends, s.
    """

    _idle_buttons: tuple[str, ...] = (START,)
    """The buttons that have a meaning between two demonstrations only."""

    def __init__(
        self,
        *,
        start_of: Callable[[int], Scenario],
        out: Path,
        page: LivePage,
        announce: Callable[[str], None] = print,
        driver: str | None = None,
        policy: RigPolicy | None = None,
        absence_limit: float = 120.0,
    ) -> None:
        self._start_of, self._out, self._page = start_of, out, page
        self._announce, self._driver, self._absence_limit = announce, driver, absence_limit
        self._policy = policy
        self._buttons = page.controls
        for label, key in KEYS.items():
            page.controls.AddButton(label, key)
        self._input = PageInput(page.controls, self._move_hand) if driver is None else None
        self._display = LiveDisplay(page, moves_hand=driver is None)
        self._servo: ServoClient | None = None
        self._has_gamepad = False
        self._absent_since: float | None = None
        self.kept: list[Path] = []

    def run(self) -> list[Path]:
        """Records until the person quits or stays away; returns the paths of the kept demonstrations."""
        self._prepare_next()
        try:
            if self._input is not None:
                self._open_servo()
            self.say("ready: press Space to start", READY)
            while not (self._has_left() or self._is_complete()):
                if self._buttons.clicked(START):
                    self._buttons.forget_clicks(*KEYS)
                    if self._record_one():
                        self.say("session over", OVER)
                        break
                    self._buttons.forget_clicks(*self._idle_buttons)  # of a person who pressed twice
                    self._prepare_next()
                self._display.follow_view_buttons()
                time.sleep(IDLE_PERIOD)
        finally:
            self._close_servo()
        return self.kept

    def _has_left(self) -> bool:
        """Whether the person has quit, or the page has stayed closed for too long."""
        if self._buttons.clicked(QUIT):
            self.say("session over", OVER)
            return True
        if self._page.is_shown:
            self._absent_since = None
            return False
        if self._absent_since is None:
            self._absent_since = time.monotonic()
        is_over = time.monotonic() - self._absent_since > self._absence_limit
        if is_over:
            self._announce("the page stayed closed: session over")
        return is_over

    def _is_complete(self) -> bool:
        """Whether nothing is left to record; asked between two demonstrations. Here the person decides."""
        return False

    # ------------------------------------------------------- one demonstration

    def _next(self) -> tuple[int, Scenario]:
        """Number and resolved scenario of the next demonstration."""
        number = next_number(self._out)
        return number, self._start_of(number)

    def _prepare_next(self) -> None:
        """Draws the start of the next demonstration."""
        _, resolved = self._next()
        self._display.draw_start(resolved)
        self._display.reset_camera()
        X_HP = start_pose(resolved)
        if self._input is not None:
            self._input.start(X_HP)
        self._page.show(contact=ContactLoad(resolved).values())
        self._display.show_readings(
            X_HP, depth=-float(X_HP.translation()[2]), full_depth=resolved.full_depth, rate=0.0, kept=len(self.kept)
        )

    def _record_one(self) -> bool:
        """Records one demonstration and asks for the verdict; returns whether the person quits."""
        number, resolved = self._next()
        try:
            servo = self._open_servo()
            if self._input is not None:
                self._input.start(start_pose(resolved))
            live = ServedRun(resolved, servo)
            ending = self._simulate(live, resolved)
            servo.end()
        except OSError as error:  # from the device
            self._close_servo()
            self.say(f"device lost ({error}): demonstration discarded, Space starts another", READY)
            return False
        if ending is None:
            self.say("the page was closed: demonstration discarded, Space starts another", READY)
            return False
        return self._judge(live.run, ending, number)

    def _open_servo(self) -> ServoClient:
        if self._servo is None:
            if self._driver is not None:
                self.say(f"opening the device '{self._driver}'")
            self._servo = ServoClient(self._driver or PAGE)
        return self._servo

    def _move_hand(self, wanted: Array) -> None:
        """Tells the servo what the person at the page wants; called in the page's thread too."""
        servo = self._servo
        if servo is not None:
            servo.move_hand(wanted)

    def _simulate(self, live: ServedRun, resolved: Scenario) -> Ending | None:
        """Returns how the demonstration ended, or None if the page was closed."""
        last_drawn = 0.0
        readings = deque([(time.monotonic(), 0.0)], maxlen=RATE_READINGS)  # wall-clock and simulated time, s
        observer = PolicyObserver(self._policy) if self._policy is not None else None
        load, steps_per_sample = ContactLoad(resolved), round(resolved.recorder.period / resolved.contact.time_step)
        self.say("recording: G keep as good, B keep as bad, X discard", RECORDING)
        while True:
            ending = live.step()
            if live.steps % steps_per_sample == 0:
                self._show_sample(live, load, observer)
            if ending is not None or time.monotonic() - last_drawn > PICTURE_PERIOD:
                last_drawn = time.monotonic()
                self._draw(live)
            if ending is not None or time.monotonic() - readings[-1][0] > READING_PERIOD:
                (began, simulated), now = readings[0], time.monotonic()
                rate = (live.time - simulated) / (now - began)
                readings.append((now, live.time))
                self._show_readings(live, resolved, rate=rate)
                self._display.follow_view_buttons()
                self._watch_gamepad()
                if not self._page.is_shown:
                    return None
            if ending is not None:
                return ending
            if self._buttons.any_waiting(GOOD, BAD, DISCARD, QUIT):
                return Ending(Outcome.STOPPED)

    def _judge(self, run: DemonstrationRun, ending: Ending, number: int) -> bool:
        """Waits for the person's verdict on the demonstration; returns whether the person quits."""
        try:
            reason = run.demonstration(ending, habit="live", number=number).reason
        except ValueError as error:
            short = isinstance(error, TooShortError)
            reason = "too short to keep" if short else f"discarded: {error}"
            self.say(f"{reason}; Space starts another", READY)
            return False
        self.say(f"{reason}: G keep as good, B keep as bad, X discard", VERDICT)
        while True:
            for button, good in ((GOOD, True), (BAD, False)):
                if self._buttons.clicked(button) and self._keep(
                    run.demonstration(ending, good=good, habit="live", number=number)
                ):
                    return False
            if self._buttons.clicked(DISCARD):
                self.say("discarded: Space starts another", READY)
                return False
            if self._buttons.clicked(QUIT):
                return True
            if not self._page.is_shown:
                self.say("the page was closed before a verdict: demonstration discarded", READY)
                return False
            self._display.follow_view_buttons()
            time.sleep(IDLE_PERIOD)

    def _keep(self, demonstration: Demonstration) -> bool:
        """Writes the demonstration; returns whether this succeeded. After a failure the person can try again."""
        number = demonstration.metadata["number"]
        path = self._out / f"{number:03d}_{'good' if demonstration.good else 'bad'}_live.parquet"
        try:
            write_demonstration(demonstration, path)
        except OSError as error:
            self.say(f"not kept, {error.strerror or error}: make room and press again, or X to discard")
            return False
        self.kept.append(path)
        self.say(f"kept {path.name}: Space starts another", READY)
        return True

    # ------------------------------------------------------------- page and device

    def _draw(self, live: ServedRun) -> None:
        context, probe = live.run.simulator.get_context(), live.probe
        X_HP = live.environment.plant.peg_pose(context)
        contact = live.environment.plant.contact_force(context)
        self._display.draw_bodies(X_HP, probe.X_HD)
        self._display.draw_forces(X_HP.translation(), probe.wrench[3:], load=probe.load, contact=contact)
        if self._input is not None:
            self._input.follow(probe.X_HD)

    def _show_sample(self, live: ServedRun, load: ContactLoad, observer: PolicyObserver | None) -> None:
        """Shows the contact load of the newest sample, and what the policy thinks of it."""
        context = live.run.simulator.get_context()
        sample = live.environment.last_sample(context)
        load.take(sample)
        self._page.show(contact=load.values())
        if observer is None or not np.isfinite(list(sample.values())).all():
            return  # nobody watches, or the run has diverged
        judgement = observer.watch([sample[name] for name in MEASURED], [sample["rx"], sample["ry"]])
        self._display.show_judgement(
            judgement,
            names=observer.policy.state_names(),
            X_HP=live.environment.plant.peg_pose(context),
            period=observer.policy.period_,
        )

    def _show_readings(self, live: ServedRun, resolved: Scenario, *, rate: float) -> None:
        X_HP = live.environment.plant.peg_pose(live.run.simulator.get_context())
        self._display.show_readings(
            X_HP,
            depth=-float(X_HP.translation()[2]),
            full_depth=resolved.full_depth,
            rate=rate,
            kept=len(self.kept),
            probe=live.probe,
            late_steps=live.late_steps,
            steps=live.steps,
        )

    def _watch_gamepad(self) -> None:
        """Says when a gamepad is connected or disconnected."""
        has_gamepad = len(self._page.controls.GetGamepad().axes) > 0
        if has_gamepad != self._has_gamepad:
            keys, sticks = "gamepad disconnected: use sliders and keys", "gamepad: left stick tilts, right stick feeds"
            self.say(sticks if has_gamepad else keys)
        self._has_gamepad = has_gamepad

    def say(self, message: str, phase: str | None = None) -> None:
        """Shows a message on the page and on the console; a phase begins, if one is given."""
        self._page.show(status=message, **({} if phase is None else {"phase": phase}))
        self._announce(message)

    def _close_servo(self) -> None:
        if self._servo is not None:
            self._servo.close()
            self._servo = None


def live_scenario(scenario: Scenario, *, seed: int, number: int) -> Scenario:
    """Resolves a scenario for the live demonstration ``number`` of a session with ``seed``.

    Uses the seeds of simulated demonstrations in a random stream of its own, so that the starts differ from theirs.
    """
    return resolve_scenario(scenario, seed=attempt_seed(seed, number, 0), stream=LIVE_STREAM)


def asked_scenario(scenario: Scenario, query_states: Sequence[QueryState], *, seed: int, number: int) -> Scenario:
    """Resolves a scenario for the live demonstration ``number``, which begins in one of the query states in turn."""
    query_state = query_states[number % len(query_states)]
    return correction_scenario(scenario, query_state, seed=attempt_seed(seed, number, 0), stream=LIVE_STREAM)


def next_number(folder: Path) -> int:
    """Returns one more than the largest number with which the name of a recording in ``folder`` begins."""
    matches = (re.match(r"(\d{3,})_", path.name) for path in folder.glob("*.parquet"))
    return max((int(match[1]) for match in matches if match), default=-1) + 1
