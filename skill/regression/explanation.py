"""Why a regressor predicts and a skill acts as it does: states, remembered samples, and how sure it is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from skill.arrays import Array

SHOWN = 5  # remembered samples in the printed form


@dataclass(frozen=True)
class Explanation:
    """Why the regressor predicted what it did at one query.

    Attributes:
        neighbours: (k,), row numbers of the training samples, the greatest weight first.
        weights: (k,), their kernel weights, shared-state probability included, over the greatest.
        influence: (k,), the equivalent kernel: the prediction is sum_i influence_i y_i.
        prediction: (p,).
        lower: (p,), of the prediction interval.
        upper: (p,), of the prediction interval.
        level: nominal coverage of the interval.
        support: sum of the weights: how many samples had a say.
        log_w_max: log of the greatest weight; very negative far from all samples.
    """

    neighbours: NDArray[np.intp]
    weights: Array
    influence: Array
    prediction: Array
    lower: Array
    upper: Array
    level: float
    support: float
    log_w_max: float


@dataclass(frozen=True)
class SkillExplanation:
    """What lies behind one action.

    Attributes:
        state_names: (K,).
        probabilities: (K,), of the contact states.
        turn: (2,), rotation vector of the peg relative to the hole about x and y of P, rad, over one sample period.
        feed: motion of the peg along its axis, m, over one sample period.
        frame_angle: rad, from P to the frame in which the interval is given: that of the lateral force.
        lower: (3,), lower end of the prediction interval of (turn_x, turn_y, feed) in that frame.
        upper: (3,), its upper end.
        level: nominal coverage of the interval.
        neighbours: DataFrame of the remembered samples that had a say, the weightiest first: ``demonstration``
            (number), ``time`` (s), ``weight`` (over the greatest), ``influence`` (the action is their sum over
            influence times remembered action).
        support: sum of the weights: how many remembered samples had a say.
        log_w_max: logarithm of the greatest kernel weight; very negative far from everything demonstrated.
    """

    state_names: list[str]
    probabilities: Array
    turn: Array
    feed: float
    frame_angle: float
    lower: Array
    upper: Array
    level: float
    neighbours: pd.DataFrame
    support: float
    log_w_max: float

    def __str__(self) -> str:
        """In a person's units."""
        states = ", ".join(
            f"{self.state_names[k]} {self.probabilities[k]:.0%}"
            for k in np.argsort(-self.probabilities)
            if self.probabilities[k] >= 0.01
        )
        degrees, low, high = np.degrees(self.turn), np.degrees(self.lower[:2]), np.degrees(self.upper[:2])
        return "\n".join(
            [
                f"states: {states}",
                f"turn {degrees[0]:+.3f} {degrees[1]:+.3f} deg, feed {1e3 * self.feed:+.3f} mm, in one sample period",
                f"{self.level:.0%} interval in the contact's frame ({np.degrees(self.frame_angle):+.0f} deg about z):"
                f" turn {low[0]:+.3f}..{high[0]:+.3f}, {low[1]:+.3f}..{high[1]:+.3f} deg,"
                f" feed {1e3 * self.lower[2]:+.3f}..{1e3 * self.upper[2]:+.3f} mm",
                f"support {self.support:.1f} samples, log of the greatest kernel weight {self.log_w_max:.1f}",
                *(
                    f"  demonstration {demonstration:.0f} at {time:.2f} s: weight {weight:.2f}"
                    for demonstration, time, weight, _ in self.neighbours.head(SHOWN).to_numpy()
                ),
            ]
        )
