"""What a data set of LeRobot holds of a recording: one episode, with one frame a sample."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skill.arrays import Array

MAX_RATE_ERROR = 1e-3
"""Largest relative difference of a sampling rate from a whole number of frames per second."""


@dataclass(frozen=True)
class Feature:
    """A feature of a data set.

    Attributes:
        dtype: of its numbers: "float32", "float64", "int64" or "bool".
        names: of its numbers; empty for a single number.
        units: of its numbers; empty if they have none.
        frame: coordinate frame in which they are expressed, or their meaning.
        labels: what the numbers from 0 on mean; empty for measured numbers.
    """

    dtype: str
    names: tuple[str, ...] = ()
    units: tuple[str, ...] = ()
    frame: str = ""
    labels: tuple[str, ...] = ()

    @property
    def width(self) -> int:
        """Count of its numbers in a frame."""
        return max(1, len(self.names))


@dataclass(frozen=True)
class Episode:
    """A recording as an episode of n frames.

    Attributes:
        name: of the file of the recording.
        outcome: how it ended.
        columns: the numbers of each feature, (n,) for a single number and (n, width) else.
        header: what the recording holds besides its samples, JSON-serialisable.
    """

    name: str
    outcome: str
    columns: Mapping[str, NDArray[Any]]
    header: Mapping[str, Any]

    def __len__(self) -> int:
        return len(next(iter(self.columns.values())))


def frame_rate(times: Array, where: str) -> int:
    """Returns the frames per second of two or more time stamps (n,), s.

    Raises:
        ValueError: if the rate is no whole number, as a data set of LeRobot has it.
    """
    rate = 1.0 / float(np.median(np.diff(times)))
    if round(rate) < 1 or abs(rate / round(rate) - 1.0) > MAX_RATE_ERROR:
        raise ValueError(f"{where}: sampled at {rate:.5g} Hz, expected a whole number of samples in a second")
    return round(rate)


def check_times(times: Array, fps: int, where: str) -> None:
    """Checks that sample k was taken at k / fps after the first one, within half a frame.

    Raises:
        ValueError: naming the sample, its time and the expected one.
    """
    expected = times[0] + np.arange(len(times)) / fps
    off = np.abs(times - expected)
    if off.max() > 0.5 / fps:
        k = int(np.argmax(off > 0.5 / fps))
        raise ValueError(
            f"{where}: sample {k} at {times[k]:.6g} s, expected {expected[k]:.6g} s at {fps} samples in a second;"
            " a data set of LeRobot has no gaps and a single rate"
        )


def endings(length: int, *, success: bool) -> dict[str, NDArray[np.bool_]]:
    """Returns ``next.done`` and ``next.success`` (n,): whether the episode has ended, and whether it has succeeded."""
    done = np.arange(length) == length - 1
    return {"next.done": done, "next.success": done & success}


def with_units(names: Sequence[str], units: Sequence[str]) -> tuple[str, ...]:
    """Returns names such as ``fx [N]``."""
    return tuple(f"{name} [{unit}]" for name, unit in zip(names, units, strict=True))


WRENCH = ("fx", "fy", "fz", "mx", "my", "mz")
WRENCH_UNITS = ("N", "N", "N", "N m", "N m", "N m")

ENDINGS = {"next.done": Feature("bool"), "next.success": Feature("bool")}


def wrench_features(frame: str) -> dict[str, Feature]:
    """Returns the features of the wrench: for policies, and a copy whose names have units."""
    return {
        "observation.environment_state": Feature("float32", WRENCH, WRENCH_UNITS, frame),
        "observation.wrench": Feature("float32", with_units(WRENCH, WRENCH_UNITS), WRENCH_UNITS, frame),
    }
