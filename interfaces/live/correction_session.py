"""A live correction session: a skill practises, a person shows what it could not do, and sees it do that."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from experiments.corrections import StuckTrial, find_query_state, practice_trial
from experiments.trial.trial_result import TrialResult
from interfaces.live.page import LivePage
from interfaces.live.rig_view import show_trial
from interfaces.live.session import (
    BUSY,
    IDLE_PERIOD,
    KEYS,
    READY,
    START,
    LiveSession,
    asked_scenario,
    live_scenario,
)
from models.scenario import Scenario
from skill.data.demonstration import Demonstration
from skill.data.outcome import Outcome
from skill.policy.query_state import QueryState
from skill.policy.rig_policy import RigPolicy

SKIP, SKIP_KEY = "skip the pose (N)", "KeyN"


class PersonLeftError(Exception):
    """The person has quit or stays away."""


class CorrectionSession(LiveSession):
    """The page of one live correction session, from the practice of a skill to the trials of the next.

    It is a `LiveSession` whose demonstrations begin in the query states that `show_query_states` gets. A query state is
    done when the person has kept a good demonstration of it, or skips it.

    Args:
        scenario: of the demonstrations, with ranges.
        seed: of the demonstrations.
        out: see `LiveSession`, as for the other arguments.
    """

    _idle_buttons = (START, SKIP)

    def __init__(
        self,
        *,
        scenario: Scenario,
        seed: int,
        out: Path,
        page: LivePage,
        announce: Callable[[str], None] = print,
        driver: str | None = None,
        absence_limit: float = 120.0,
    ) -> None:
        self._scenario, self._seed = scenario, seed
        self._asked: Sequence[QueryState] = []
        self._place = 0
        self._is_shown = self._is_announced = False
        super().__init__(
            start_of=self._start, out=out, page=page, announce=announce, driver=driver, absence_limit=absence_limit
        )
        page.controls.AddButton(SKIP, SKIP_KEY)

    def show_note(self, message: str) -> None:
        """Shows on the page what the session is busy with.

        Raises:
            PersonLeftError: if the person has quit or stays away.
        """
        self._page.show(status=message, phase=BUSY)
        self._display.follow_view_buttons()
        if self._has_left():
            raise PersonLeftError

    def begin_work(self, message: str) -> None:
        """Draws the peg above the hole, as before a demonstration, and shows a note; see `show_note`."""
        self._asked = []
        self._prepare_next()
        self.show_note(message)

    # ------------------------------------------------------- demonstrations

    def show_query_states(self, query_states: Sequence[QueryState]) -> None:
        """Lets the person show query states, one after another.

        Raises:
            PersonLeftError: if the person quits or stays away before all are done.
            ValueError: if a demonstration cannot begin in a query state.
        """
        self._asked, self._place = query_states, 0
        self._is_shown = self._is_announced = False
        for query_state in query_states:  # all are checked before the first
            asked_scenario(self._scenario, [query_state], seed=self._seed, number=0)
        self._buttons.forget_clicks(*KEYS, SKIP)
        self.run()
        if self._place < len(self._asked):
            raise PersonLeftError

    def _start(self, number: int) -> Scenario:
        if self._place < len(self._asked):
            return asked_scenario(self._scenario, [self._asked[self._place]], seed=self._seed, number=number)
        return live_scenario(self._scenario, seed=self._seed, number=number)

    def _is_complete(self) -> bool:
        """Whether all query states are done. Goes on to the next query state, and says which one it is."""
        if self._buttons.clicked(SKIP) or self._is_shown:
            self._place += 1
            self._is_shown = self._is_announced = False
            self._prepare_next()
        if self._place >= len(self._asked):
            return True
        if not self._is_announced:
            self._is_announced = True
            where = describe(self._asked[self._place])
            self.say(f"show me: {self._place + 1} of {len(self._asked)}, {where}; Space starts", READY)
        return False

    def _keep(self, demonstration: Demonstration) -> bool:
        is_kept = super()._keep(demonstration)
        if is_kept:
            self._is_shown, self._is_announced = demonstration.good, False
        return is_kept

    # ------------------------------------------------------- the rig

    def perform_all(self, stuck: Sequence[StuckTrial], scenario: Scenario, policy: RigPolicy, *, again: bool) -> None:
        """Shows the rig in the trials in which another policy was stuck, once, or again and again; see `perform`."""
        while True:
            for k, trial in enumerate(stuck, start=1):
                then = "next" if k < len(stuck) else "again" if again else "next round"
                self.perform(trial, scenario, policy, title=f"rig {k} of {len(stuck)}", then=then)
            if not again:
                return

    def perform(self, stuck: StuckTrial, scenario: Scenario, policy: RigPolicy, *, title: str, then: str) -> None:
        """Shows how the rig performs the practice trial again in which another policy was stuck; waits for Space.

        Args:
            stuck: the trial of the other policy.
            scenario: of the rig, with ranges.
            policy: that controls the rig now.
            title: of the trial, for the page.
            then: what Space does at the end, for the page.

        Raises:
            PersonLeftError: if the person quits or stays away.
        """
        number, before = stuck.query_state.trial, course(stuck.result, stuck.query_state)
        resolved = practice_trial(scenario, number)

        def show_progress(now: float, load: float) -> None:
            self.show_note(f"{title}: {now:.1f} s, load {load:.0f} N; before: {before}")

        self._announce(f"{title}: practice trial {number} with the new skill")
        run = show_trial(
            self._page, self._display, resolved, policy, number=number, kept=len(self.kept), on_picture=show_progress
        )
        result, record = run.ended().result, run.ended().record(policy)
        now = find_query_state(record, resolved, number=number, inserted=result.inserted)
        self.say(f"{title}: {course(result, now)}; before: {before}. Space: {then}")
        self._buttons.forget_clicks(*KEYS)
        while not self._buttons.clicked(START):
            if self._has_left():
                raise PersonLeftError
            self._display.follow_view_buttons()
            time.sleep(IDLE_PERIOD)


def describe(query_state: QueryState) -> str:
    """Returns where a skill was stuck, for the page: depth, tilt and contact state."""
    tilt = math.degrees(np.hypot(*query_state.tilt))
    return f"stuck at {1e3 * query_state.depth:.1f} mm, {tilt:.1f}°, {query_state.state}"


def course(result: TrialResult, stuck: QueryState | None) -> str:
    """Returns how a trial went, for the page: where it was stuck first, if it was, and how it ended, if not there."""
    parts = [] if stuck is None else [f"stuck at {1e3 * stuck.depth:.1f} mm"]
    if result.inserted:
        parts.append(f"inserted in {result.time:.1f} s")
    elif result.outcome not in (Outcome.JAMMED, Outcome.TIME_OVER):
        parts.append(result.reason)
    return ", ".join(parts)
