"""
Your own policy
===============

Run a hand-written control law on the rig, behind the same motors, guards and sensors as a learnt skill.
"""

# %%
# A law is a class with one method. It gets what the rig measures: the wrench on the peg about its tip, and the height
# of the tip. It returns how far to turn the peg relative to the hole, and how far to feed it, within one period of
# 20 ms.
#
# This one yields to the moment, as a compliant wrist does, and feeds more slowly the larger the axial force is.

from dataclasses import dataclass

import matplotlib.pyplot as plt
import numpy as np

from experiments.trial.run_trial import run_trials
from models.scenario import load_scenario
from skill.policy.rig_policy import Action
from systems.law.control_law import ControlLaw


@dataclass(frozen=True)
class Wrist(ControlLaw):
    """Turns with the moment about the tip.

    Attributes:
        gain: rad/s per N m.
        speed: of the feed without a force, m/s.
        softness: axial force at which the feed stops, N.
    """

    gain: float
    speed: float = 0.012
    softness: float = 15.0

    def act(self, measured, estimate):
        """See `ControlLaw`."""
        _, _, fz, mx, my, _, _ = measured
        turn = self.gain * np.array([mx, my]) * self.period_
        feed = -self.speed * max(0.0, 1.0 - abs(fz) / self.softness) * self.period_
        return Action(turn=turn, feed=feed)


# %%
# The same four trials without compliance and with it.

scenario = load_scenario("nominal")
trials = {gain: list(run_trials(scenario, Wrist(gain), [0, 1, 2, 3], jobs=1)) for gain in (0.0, 1.0)}
for gain, runs in trials.items():
    for result, _ in runs:
        print(
            f"gain {gain:g}, trial {result.seed}: {result.reason} after {result.time:.1f} s at"
            f" {1e3 * result.depth:.1f} mm, peak load {result.peak_load:.0f} N, {result.back_offs} back-offs"
        )

# %%
# Without compliance the rig gives up: its guard backs off and tries again, but nothing turns the hole.

figure, axes = plt.subplots(1, 2, sharey=True, figsize=(8, 3.5), layout="constrained")
for axis, (gain, runs) in zip(axes, trials.items(), strict=True):
    for _, run in runs:
        axis.plot(run.samples["time"], 1e3 * run.samples["depth"])
    axis.set(title=f"gain {gain:g} rad/s per N m", xlabel="time [s]")
axes[0].set_ylabel("depth [mm]")

# %%
# To compare a law with others over hundreds of trials, name a function that makes it in the specification of a sweep
# (:doc:`/sweeps`).
