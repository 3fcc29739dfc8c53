"""Shows a trial of the rig on the page, while it is simulated."""

from __future__ import annotations

import math
import time
from collections.abc import Callable

import numpy as np
import pandas as pd

from experiments.trial.diagram_trial import TrialRun
from interfaces.live.display import ContactLoad, LiveDisplay
from interfaces.live.page import LivePage
from interfaces.live.session import PICTURE_PERIOD
from models.scenario import Scenario
from skill.data.axes import AXES
from skill.data.outcome import UNPHYSICAL
from skill.policy.policy_observer import Judgement
from skill.policy.rig_policy import Action, RigPolicy
from systems.rig import MakeRig
from systems.rig_diagram import RigDiagram
from systems.servo.servo_process import Pace

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
        on_picture: Callable[[float, float], None],
    ) -> TrialRun:
        """Simulates and shows a trial, and returns it when it has ended.

        Args:
            scenario: of the trial, resolved.
            policy: that controls the rig.
            number: of the trial, for the record.
            kept: number of demonstrations kept in this session.
            on_picture: receives the simulated time (s) and the measured load (N) of each picture; an exception ends
                the trial.

        Raises:
            ValueError: if the policy was made for another peg or hole.
        """
        rig = MakeRig(scenario, policy)
        run = TrialRun(rig, scenario, number=number)
        self._display.draw_start(scenario)
        self._page.show(hand=False)
        load, pace = ContactLoad(scenario), Pace(scenario.controller.period)
        drawn, taken, rate, rated, rated_time = -math.inf, 0, 1.0, time.monotonic(), 0.0
        while not run.has_ended:
            run.advance(min((pace.ticks + 1) * pace.period, scenario.trial.time_limit))
            pace.wait()
            now = time.monotonic()
            if now - rated > RATE_PERIOD:
                simulated = pace.ticks * pace.period
                rate, rated, rated_time = (simulated - rated_time) / (now - rated), now, simulated
            if (run.has_ended or now - drawn > PICTURE_PERIOD) and run.monitor.outcome not in UNPHYSICAL:
                drawn, samples = now, run.samples()
                for sample in samples.iloc[taken:].to_dict("records"):
                    load.take(sample)
                taken = len(samples)
                self._display.show_contact_load(load)
                self._draw(rig, run, policy, samples.tail(2), rate=rate, kept=kept)
                on_picture(run.context.get_time(), load.load)
            self._display.follow_view_buttons()
        return run

    def _draw(
        self, rig: RigDiagram, run: TrialRun, policy: RigPolicy, samples: pd.DataFrame, *, rate: float, kept: int
    ) -> None:
        """Draws the present moment of a trial, with the last two samples of its recorder."""
        scenario, now = rig.scenario, samples.iloc[-1]
        X_WP, X_WH = rig.poses(run.context)
        X_HP = rig.plant.peg_in_hole(run.context)
        self._display.move_peg(X_WP)
        self._display.move_hole(X_WH)
        self._display.move_hand(X_WP)  # hides the ghost in the peg: no hand moves the rig
        tip = X_WP.translation()
        force = now[["fx", "fy", "fz"]].to_numpy(dtype=float)  # in P; the peg of the rig does not turn
        self._display.draw_forces(tip, np.zeros(3), load=0.0, contact=(tip, force))
        self._display.show_readings(
            X_HP, depth=float(now["depth"]), full_depth=scenario.full_depth, rate=rate, kept=kept
        )
        names, period = policy.state_names(), scenario.controller.period
        self._display.show_judgement(_judgement(samples, period), names=names, X_HP=X_HP, X_WH=X_WH, period=period)


def _judgement(samples: pd.DataFrame, period: float) -> Judgement:
    """Returns the state that the policy sees, and the motion of the peg relative to the hole in the last period."""
    now = samples.iloc[-1]
    # Turning the hole by theta turns the peg by -theta relative to it.
    turn = -np.subtract(*samples[[f"target_{axis}" for axis in AXES]].to_numpy()[[-1, 0]])
    action = Action(turn=turn[:2], feed=float(now["feed_speed"]) * period, spin=float(turn[2]))
    return Judgement(int(now["state"]), bool(now["known"]), action)
