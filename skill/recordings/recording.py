"""One trial of a force/torque sensor: time stamps, channels and, if there are any, the phases of the samples."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skill.arrays import Array

MAX_SAMPLES = 4_000_000
"""Largest number of samples that are read from a file: an hour at 1 kHz has 3.6 million."""

RATE_TOLERANCE = 0.01
"""By how much the rate of a recording may exceed the requested one before it is averaged; clocks are not exact."""


@dataclass(frozen=True, eq=False)
class Recording:
    """One trial of a sensor.

    Attributes:
        name: where it is from, for messages and titles, such as "snap.csv, trial 3".
        time: (n,) time of each sample, s, strictly increasing; intervals may differ and there may be gaps.
        values: (n, d) samples, finite, SI units.
        channels: d names such as "fx", each once.
        phases: (n,) integers or texts, the known phase of each sample; None where there are none.
        trial: what its file calls the trial, such as "3"; empty where a file is one recording.

    Raises:
        ValueError: if a shape does not fit, the time does not increase, or there are fewer than two samples. The
            message begins with the name of the recording.
    """

    name: str
    time: Array
    values: Array
    channels: tuple[str, ...]
    phases: NDArray[Any] | None = None
    trial: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "time", np.asarray(self.time, dtype=float))
        object.__setattr__(self, "values", np.asarray(self.values, dtype=float))
        object.__setattr__(self, "channels", tuple(self.channels))
        self._check_time()
        if self.values.shape != (len(self.time), len(self.channels)):
            expected = (len(self.time), len(self.channels))
            raise ValueError(f"{self.name}: values of shape {self.values.shape}, expected {expected}")
        if self.phases is not None:
            object.__setattr__(self, "phases", np.asarray(self.phases))
            if self.phases.shape != self.time.shape or self.phases.dtype.kind not in "iuU":
                raise ValueError(
                    f"{self.name}: phases of type {self.phases.dtype} and shape {self.phases.shape},"
                    f" expected integers or texts of shape {self.time.shape}"
                )

    def _check_time(self) -> None:
        if len(self.time) < 2:
            raise ValueError(f"{self.name}: found {len(self.time)} samples, expected at least 2")
        bad = np.flatnonzero(~np.isfinite(self.time))
        if bad.size:
            raise ValueError(f"{self.name}: time is not finite in sample {bad[0]} ({bad.size} such samples)")
        bad = np.flatnonzero(np.diff(self.time) <= 0)
        if bad.size:
            before, after = self.time[bad[0]], self.time[bad[0] + 1]
            what = "occurs twice" if before == after else f"jumps back from {before:.9g} s"
            raise ValueError(
                f"{self.name}: time {after:.9g} s {what} in sample {bad[0] + 1} ({bad.size} such samples);"
                " expected times that increase"
            )

    @property
    def rate(self) -> float:
        """Sampling rate, Hz: the inverse of the median interval, so that gaps do not count."""
        return 1.0 / float(np.median(np.diff(self.time)))

    @property
    def duration(self) -> float:
        """Time from the first sample to the last, s."""
        return float(self.time[-1] - self.time[0])

    def averaged(self, rate: float) -> Recording:
        """Returns a recording of at most one sample in every interval of 1/rate; each is the mean of its interval.

        Times are means too, so that a ramp stays what it is whatever the time stamps are. The phase is the most
        frequent one of the interval; of two that are equally frequent, the first. An interval without samples gives
        none: a gap stays a gap. The intervals begin half a sample before the first sample, so that jitter of the time
        stamps does not move samples into the neighbouring interval where the interval is a multiple of the period.

        Args:
            rate: requested rate, Hz. A recording that is not faster (by more than one per cent) is returned as it is.

        Raises:
            ValueError: if the rate is not positive and finite, or less than two samples are left.
        """
        if not (math.isfinite(rate) and rate > 0):
            raise ValueError(f"{self.name}: a rate of {rate} Hz, expected a positive number")
        if self.rate <= rate * (1 + RATE_TOLERANCE):
            return self
        interval = np.floor((self.time - self.time[0] + 0.5 / self.rate) * rate)
        first = np.flatnonzero(np.diff(interval, prepend=-1.0) > 0)
        if len(first) < 2:
            raise ValueError(f"{self.name}: lasts {self.duration:g} s, too short to be averaged to {rate:g} Hz")
        counts = np.diff(first, append=len(self.time))
        offset = np.add.reduceat(self.time - self.time[0], first) / counts
        return Recording(
            self.name,
            self.time[0] + offset,
            np.add.reduceat(self.values, first, axis=0) / counts[:, None],
            self.channels,
            None if self.phases is None else _majority(self.phases, np.repeat(np.arange(len(first)), counts)),
            self.trial,
        )


def _majority(phases: NDArray[Any], interval: NDArray[np.int64]) -> NDArray[Any]:
    """The most frequent phase of each interval, the first of equally frequent ones; intervals count from 0."""
    names, codes = np.unique(phases, return_inverse=True)
    pairs, first, counts = np.unique(interval * len(names) + codes, return_index=True, return_counts=True)
    order = np.lexsort((first, -counts, pairs // len(names)))
    _, best = np.unique(pairs[order] // len(names), return_index=True)
    return np.asarray(names[pairs[order][best] % len(names)])
