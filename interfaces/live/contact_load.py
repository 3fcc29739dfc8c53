"""The contact load of a live demonstration, as the rig's force guard counts it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from models.scenario import Scenario
from skill.features.measurement import load_of_components

WRENCH = ("fx", "fy", "fz", "mx", "my", "mz")


class ContactLoad:
    """The load of the newest sample of a demonstration, and the largest so far.

    Args:
        scenario: of the demonstration, with the limits of the guard.

    Attributes:
        load: sqrt(|f|^2 + |m/r|^2) of the contact wrench, N.
        peak: largest load so far, N.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._radius, self._guard = scenario.geometry.peg_radius, scenario.controller.guard
        self.load = self.peak = 0.0

    def take(self, sample: Mapping[Any, float]) -> None:
        """Takes a sample of the recorder; ignores one that is not finite, of a run that has diverged."""
        load = load_of_components([sample[name] for name in WRENCH], self._radius)
        if math.isfinite(load):
            self.load, self.peak = load, max(self.peak, load)

    def values(self) -> dict[str, float | bool]:
        """Returns what the panel shows; ``held`` says whether the rig's guard would slow the feed."""
        return {
            "load": self.load,
            "limit": self._guard.force_limit,
            "peak": self.peak,
            "held": self.load > self._guard.soft_force,
        }
