"""A live session without a browser, for the kill campaign: a script presses the buttons, a device moves the peg.

    python -m tests.scripted_live FOLDER SCENARIO --number N

The session, the simulation and the files are the real ones. The script starts a demonstration, the device pushes the
peg into the hole, and the script keeps the recording as good, N times.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import typer
from pydrake.math import RigidTransform

from experiments.outputs.output_set import open_live_folder
from interfaces.live.access import LOCAL_HOST
from interfaces.live.page import LivePage
from interfaces.live.session import GOOD, QUIT, START, LiveSession, live_scenario
from interfaces.terminal import report_errors, say
from models.scenario import load_scenario

FEED = 0.04  # speed of the device, m/s
TICK = 1e-3  # of the device, s


class PushingDevice:
    """A haptic device whose handle moves down at a constant speed."""

    def __init__(self) -> None:
        self.ticks = 0

    def read_pose(self) -> RigidTransform:
        """Returns the pose of the handle."""
        return RigidTransform(np.array([0.0, 0.0, -FEED * TICK * self.ticks]))

    def write_wrench(self, wrench: object) -> None:
        """Takes one tick's wrench."""
        self.ticks += 1

    def close(self) -> None:
        """Closes the device."""


class ScriptedButtons:
    """Presses start, then keep, ``number`` times, then quit."""

    def __init__(self, number: int) -> None:
        self._script = [START, GOOD] * number + [QUIT]

    def clicked(self, label: str) -> bool:
        """Whether a button is the next of the script."""
        if self._script and self._script[0] == label:
            self._script.pop(0)
            return True
        return False

    def any_waiting(self, *labels: str) -> bool:
        """Whether a running demonstration is to be stopped: never."""
        return False

    def forget_clicks(self, *labels: str) -> None:
        """Forgets nothing, because the script waits."""


class WatchedPage(LivePage):
    """The page of a session, which counts as shown without a browser."""

    @property
    def is_shown(self) -> bool:
        return True


@report_errors
def main(out: Path, scenario: Path, number: int = 3) -> None:
    """Runs the session."""
    loaded = load_scenario(scenario)
    with open_live_folder(out):
        page = WatchedPage(host=LOCAL_HOST, port=0)
        try:
            session = LiveSession(
                start_of=lambda k: live_scenario(loaded, seed=0, number=k),
                out=out,
                page=page,
                announce=say,
                driver="tests.scripted_live:PushingDevice",
            )
            session._buttons = ScriptedButtons(number)
            say(f"{len(session.run())} demonstrations kept")
        finally:
            page.close()


if __name__ == "__main__":
    typer.run(main)
