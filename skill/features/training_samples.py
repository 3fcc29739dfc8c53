"""The samples that a skill learns from: refined, with and with the noise of the rig's sensor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from skill.arrays import Array
from skill.data.demonstration import Demonstration
from skill.data.refinement import INTENDED, intended_actions, refine_demonstration, with_following_actions
from skill.features.responses import observations
from skill.features.wrench_features import MEASURED

PLANNING = 2
"""Stream of the sensor noise in the samples of the planner."""


def noise_stream(random_state: int | None, stream: int) -> np.random.Generator:
    """Returns a generator of sensor noise that differs from that of the other samples."""
    return np.random.default_rng(None if random_state is None else [random_state, stream])


@dataclass(frozen=True)
class SampleSettings:
    """How samples are made from demonstrations; see `ManipulationSkill` for the meaning of the numbers."""

    still: float
    rough: float
    correction_time: float
    feed_time: float
    force_noise: float
    moment_noise: float

    def refined(self, demonstration: Demonstration) -> pd.DataFrame:
        """Returns refined samples; each row holds a measurement, the action that follows it, and the intended one."""
        samples = with_following_actions(demonstration.samples)
        times = {"correction_time": self.correction_time, "feed_time": self.feed_time}
        samples[list(INTENDED)] = intended_actions(samples, **times)
        return refine_demonstration(samples, still=self.still, rough=self.rough)

    def with_noise(self, samples: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
        """Returns a copy of samples with the noise of the sensor on the rig."""
        noisy = samples.copy()
        sigma = np.repeat([self.force_noise, self.moment_noise], 3)
        noisy[list(MEASURED[:6])] += sigma * rng.standard_normal((len(samples), 6))
        return noisy


def observed_series(samples: pd.DataFrame) -> Array:
    """Returns the observations (n, 9) of a demonstration; see `skill.features.responses`."""
    turned = samples[["rx", "ry"]].to_numpy().cumsum(axis=0)
    return observations(samples[list(MEASURED)].to_numpy(), turned)
