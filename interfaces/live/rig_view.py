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


def show_trial(
    page: LivePage,
    display: LiveDisplay,
    scenario: Scenario,
    policy: RigPolicy,
    *,
    number: int,
    kept: int,
    on_picture: Callable[[float, float], None],
) -> TrialRun:
    """Simulates a trial at the pace of the wall clock, or slower if it is slower, and returns it at its end.

    The peg moves with the feed, the block turns with the gimbal. A blue arrow at the tip is the measured force. The
    panel shows the measured load, the contact state that the policy sees, and the motion that the rig is given.

    Args:
        page: to draw on.
        display: of the page.
        scenario: of the trial, resolved.
        policy: that controls the rig.
        number: of the trial, for the record.
        kept: number of demonstrations kept in this session.
        on_picture: receives the simulated time (s) and the measured load (N) of each picture; an exception ends the
            trial.

    Raises:
        ValueError: if the policy was made for another peg or hole.
    """
    rig = MakeRig(scenario, policy)
    run = TrialRun(rig, scenario, number=number)
    display.draw_start(scenario)
    page.show(hand=False)
    load, pace = ContactLoad(scenario), Pace(scenario.controller.period)
    began, drawn, taken = time.monotonic(), -math.inf, 0
    while not run.has_ended:
        run.advance(min((pace.ticks + 1) * pace.period, scenario.trial.time_limit))
        pace.wait()
        now = time.monotonic()
        if (run.has_ended or now - drawn > PICTURE_PERIOD) and run.monitor.outcome not in UNPHYSICAL:
            drawn, samples = now, run.samples()
            for sample in samples.iloc[taken:].to_dict("records"):
                load.take(sample)
            taken = len(samples)
            page.show(contact=load.values())
            rate = pace.ticks * pace.period / (now - began)
            _draw(display, rig, run, policy, samples.tail(2), rate=rate, kept=kept)
            on_picture(run.context.get_time(), load.load)
        display.follow_view_buttons()
    return run


def _draw(
    display: LiveDisplay,
    rig: RigDiagram,
    run: TrialRun,
    policy: RigPolicy,
    samples: pd.DataFrame,
    *,
    rate: float,
    kept: int,
) -> None:
    """Draws the present moment of a trial, with the last two samples of its recorder."""
    scenario, now = rig.scenario, samples.iloc[-1]
    X_WP, X_WH = rig.poses(run.context)
    X_HP, tip = rig.plant.peg_in_hole(run.context), X_WP.translation()
    display.draw_bodies(X_WP, X_WP, X_WH)  # hides the ghost in the peg: no hand moves the rig
    force = now[["fx", "fy", "fz"]].to_numpy(dtype=float)  # in P; the peg of the rig does not turn
    display.draw_forces(tip, np.zeros(3), load=0.0, contact=(tip, force))
    display.show_readings(X_HP, depth=float(now["depth"]), full_depth=scenario.full_depth, rate=rate, kept=kept)
    # Turning the hole by theta turns the peg by -theta relative to it.
    turn = -np.subtract(*samples[[f"target_{axis}" for axis in AXES]].to_numpy()[[-1, 0]])
    period = scenario.controller.period
    action = Action(turn=turn[:2], feed=float(now["feed_speed"]) * period, spin=float(turn[2]))
    judgement = Judgement(int(now["state"]), bool(now["known"]), action)
    display.show_judgement(judgement, names=policy.state_names(), X_HP=X_HP, X_WH=X_WH, period=period)
