"""Shows a trial of the rig on the page, while it is simulated."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

import numpy as np
import pandas as pd

from models.scenario import Scenario
from skill.data.outcome import UNPHYSICAL
from skill.features.measurement import contact_load
from skill.policy import Action, RigPolicy
from skill.practice.policy_observer import Judgement
from systems.live.clock import Clock, Deadlines
from systems.live.display import RIG_SOURCE, LiveDisplay, Readings
from systems.live.page import LivePage
from systems.rig import MakeRig
from systems.rig_diagram import RigDiagram
from systems.runs.trial import TrialRun
from systems.visualization.scene import FRAME

WRENCH = ["fx", "fy", "fz", "mx", "my", "mz"]
RATE_PERIOD = 0.5  # in units of s, over which the real-time rate is averaged


class RigView:
    """Performs trials of the rig on the page: at the pace of the wall clock, or slower if the simulation is slower.

    The peg moves with the feed, the block turns with the gimbal. A blue arrow at the tip is the measured force. The
    panel shows the measured load, the contact state that the policy sees, and the motion that the rig is given.

    Args:
        page: to draw on.
        display: of the page.
    """

    def __init__(self, page: LivePage, display: LiveDisplay) -> None:
        self._page, self._display = page, display

    def perform(
        self,
        scenario: Scenario,
        policy: RigPolicy,
        *,
        number: int,
        kept: int,
        tell: Callable[[float, float], None],
        is_over: Callable[[], bool],
    ) -> TrialRun | None:
        """Simulates and shows a trial.

        Args:
            scenario: of the trial, resolved.
            policy: that controls the rig.
            number: of the trial, for the record.
            kept: number of demonstrations kept in this session.
            tell: receives the simulated time (s) and the measured load (N) of each picture.
            is_over: asked once a controller period, whether the person does not want to see more.

        Returns:
            The trial, which has ended; None if ``is_over`` ended it.

        Raises:
            ValueError: if the policy was made for another peg or hole.
        """
        rig = MakeRig(scenario, policy)
        run = TrialRun(rig, scenario, number=number)
        self._display.draw_start(scenario)
        self._page.show(source=RIG_SOURCE)
        clock = Clock(period=scenario.controller.period, ticks_per_step=1, start=time.monotonic())
        drawn, rate, rated, rated_time = -math.inf, 1.0, time.monotonic(), 0.0
        while not run.is_over:
            run.advance(min(clock.next_time, scenario.trial.time_limit))
            clock.end_tick()
            if is_over():
                return None
            now = time.monotonic()
            if now - rated > RATE_PERIOD:
                rate, rated, rated_time = (clock.time - rated_time) / (now - rated), now, clock.time
            if (run.is_over or now - drawn > FRAME) and run.monitor.outcome not in UNPHYSICAL:
                drawn = now
                tell(run.context.get_time(), self._draw(rig, run, policy, rate=rate, kept=kept))
            self._display.follow_view_buttons()
        return run

    def _draw(self, rig: RigDiagram, run: TrialRun, policy: RigPolicy, *, rate: float, kept: int) -> float:
        """Draws the present moment of a trial; returns the measured load, N."""
        scenario, samples = rig.scenario, run.samples().tail(2)
        now = samples.iloc[-1]
        wrench = now[WRENCH].to_numpy(dtype=float)
        load = contact_load(wrench, scenario.geometry.peg_radius)
        X_WP, X_WH = rig.poses(run.context)
        X_HP = rig.contact.peg_in_hole(run.context)
        self._display.move_peg(X_WP)
        self._display.move_hole(X_WH)
        self._display.move_hand(X_WP)  # hides the ghost in the peg: no hand moves the rig
        tip = X_WP.translation()
        # The peg of the rig does not turn: P has the directions of W.
        self._display.draw_forces(tip, np.zeros(3), load=0.0, contact=(tip, wrench[:3]))
        self._display.show_readings(
            Readings(
                X_HP=X_HP,
                wrench=np.concatenate([wrench[3:], wrench[:3]]),
                load=load / scenario.controller.force_limit,
                depth=float(now["depth"]),
                full_depth=scenario.full_depth,
                rate=rate,
                deadlines=Deadlines(late_steps=0, steps=0, late_ticks=0, ticks=0),
                energy=0.0,
                min_energy=0.0,
                kept=kept,
            )
        )
        names, period = policy.state_names(), scenario.controller.period
        self._display.show_judgement(_judgement(samples, period), names=names, X_HP=X_HP, X_WH=X_WH, period=period)
        return load


def _judgement(samples: pd.DataFrame, period: float) -> Judgement:
    """Returns the state that the policy sees, and the motion of the peg relative to the hole in the last period."""
    now = samples.iloc[-1]
    # Turning the hole by theta turns the peg by -theta relative to it.
    turn = -np.subtract(*samples[["target_pitch", "target_yaw"]].to_numpy()[[-1, 0]])
    action = Action(turn=turn, feed=float(now["feed_speed"]) * period, probabilities=np.ones(1))
    return Judgement(int(now["state"]), bool(now["known"]), action)
