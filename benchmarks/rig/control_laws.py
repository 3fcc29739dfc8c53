"""Control laws that need no demonstrations: push, compliance and search, and the tuning of their parameters.

Each is a `ControlLaw` with the same limits, force guard and motors as a learnt skill.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import qmc

from models.scenario import Scenario
from skill.arrays import Array
from skill.features.measurement import contact_load
from skill.policy.rig_policy import Action
from skill.states.estimate import Estimate
from systems.law.control_law import ControlLaw

Range = tuple[float, float, bool]
"""Minimum, maximum, and whether the parameter is spaced geometrically."""


@dataclass(frozen=True)
class TunedLaw(ControlLaw):
    """A control law whose parameters are tuned within ranges; the defaults are a first guess by hand.

    Its feed speed is ``speed`` clip(1 - F / yield_force, -1/2, 1), where F is the load of the force guard
    (`contact_load`).

    Attributes:
        speed: feed speed without load, m/s.
        yield_force: load at which the feed stops, N.
        lever: of the moments in the load, m.
        ranges: range of each tuned parameter.
    """

    speed: float = 0.012
    yield_force: float = 15.0
    lever: float = 0.010

    ranges: ClassVar[dict[str, Range]] = {"speed": (0.005, 0.025, True), "yield_force": (5.0, 50.0, True)}

    @classmethod
    def at(cls, place: Array, **known: float) -> Self:
        """The law at a point (d,) of the unit cube over its ranges; ``known`` are the other parameters."""
        values = {}
        for share, (name, (low, high, geometric)) in zip(place, cls.ranges.items(), strict=True):
            values[name] = low * (high / low) ** share if geometric else low + (high - low) * share
        return cls(**{k: float(v) for k, v in values.items()}, **known)

    def load(self, measured: Array) -> float:
        """The load of a measurement (7,), N."""
        return contact_load(measured, self.lever)

    def feed(self, measured: Array) -> float:
        """The feed within one period, m; negative into the hole."""
        return -self.speed * self.period_ * float(np.clip(1.0 - self.load(measured) / self.yield_force, -0.5, 1.0))


@dataclass(frozen=True)
class StraightPush(ControlLaw):
    """A push without correction, at a constant feed speed (m/s)."""

    speed: float

    def act(self, measured: ArrayLike, estimate: Estimate) -> Action:
        """See `ControlLaw`."""
        return Action(turn=np.zeros(2), feed=-self.speed * self.period_)


@dataclass(frozen=True)
class MomentCompliance(TunedLaw):
    """Compliance: the peg turns with the moment about a centre of compliance.

    With f and m the force and the moment about the tip, the moment about the point at height c on the peg's axis is

        m_c = m - c z x f = (m_x + c f_y, m_y - c f_x),

    and the angular velocity is omega = g m_c max(0, 1 - m_0 / |m_c|), after Whitney, "Force feedback control of
    manipulator fine motions", 1977. The tuned height determines the proportion of moment and lateral force.

    Attributes:
        gain: g, rad/s per N m.
        height: c, of the centre of compliance above the tip, m.
        dead_zone: m_0, N m.
    """

    gain: float = 1.0
    height: float = 0.005
    dead_zone: float = 0.02

    ranges: ClassVar[dict[str, Range]] = {
        **TunedLaw.ranges,
        "gain": (0.1, 10.0, True),
        "height": (-0.005, 0.025, False),
        "dead_zone": (0.005, 0.05, True),
    }

    def act(self, measured: ArrayLike, estimate: Estimate) -> Action:
        """See `ControlLaw`."""
        measured = np.asarray(measured, dtype=float)
        fx, fy, _, mx, my = measured[:5]
        moment = np.array([mx + self.height * fy, my - self.height * fx])
        size = float(np.linalg.norm(moment))
        rate = self.gain * moment * (1.0 - self.dead_zone / size) if size > self.dead_zone else np.zeros(2)
        return Action(turn=rate * self.period_, feed=self.feed(measured))


@dataclass(frozen=True)
class SpiralSearch(TunedLaw):
    """A search along a growing spiral in pitch and yaw, at a constant rate, while the pressed peg meets resistance.

    The rig's only lateral freedoms are two angles, so that the search is over them. Point k of the spiral has the angle
    phi and the radius spacing phi / 2 pi, with path length spacing phi^2 / 4 pi = rate T k for the period T. From the
    outermost point the path returns straight to the first one and starts again. The search pauses while the load is
    below ``touch``, so that a tilt at which the peg slides is kept. The points are the states of the law.

    Attributes:
        spacing: between turns of the spiral, rad.
        rate: rad/s.
        outer: radius of the outermost point, rad.
        touch: load above which the search goes on, N.
    """

    spacing: float = 0.010
    rate: float = 0.10
    outer: float = 0.06
    touch: float = 3.0

    ranges: ClassVar[dict[str, Range]] = {
        **TunedLaw.ranges,
        "spacing": (0.003, 0.03, True),
        "rate": (0.04, 0.20, True),
        "outer": (0.03, 0.10, True),
        "touch": (1.0, 10.0, True),
    }

    @cached_property
    def _moves(self) -> Array:
        """Turn from the point before to each point, (points, 2), rad."""
        step = self.rate * self.period_
        points = int(np.pi * self.outer**2 / self.spacing / step)
        phi = np.sqrt(4.0 * np.pi * step * np.arange(points + 1) / self.spacing)
        out = self.spacing * phi / (2.0 * np.pi) * np.array([np.cos(phi), np.sin(phi)])
        back = np.linspace(1.0, 0.0, 1 + int(np.ceil(np.linalg.norm(out[:, -1]) / step)))[1:-1]
        path = np.hstack([out, out[:, -1:] * back]).T
        moves: Array = path - np.roll(path, 1, axis=0)
        return moves

    def estimator(self) -> Self:
        """The law itself, which counts its points."""
        return self

    def initial(self) -> Estimate:
        """The first point."""
        return Estimate.of_phase(0, len(self._moves))

    def step(self, memory: Array, measured: Array) -> Estimate:
        """The next point while the load is above ``touch``."""
        point = int(memory[0])
        point = point + 1 if self.load(measured) > self.touch else point
        return Estimate.of_phase(point % len(self._moves), len(self._moves))

    def state_names(self) -> list[str]:
        """The points."""
        return [f"point {k}" for k in range(len(self._moves))]

    def act(self, measured: ArrayLike, estimate: Estimate) -> Action:
        """See `ControlLaw`."""
        measured = np.asarray(measured, dtype=float)
        searching = self.load(measured) > self.touch
        turn = self._moves[estimate.state] if searching else np.zeros(2)
        return Action(turn=turn, feed=self.feed(measured))


FIRST_TUNING = 80000
"""Number of the first trial that is used for tuning; no comparison uses it or the next thousand."""

ROUNDS = ((1, 2), (3, 4), (8, 8))
"""Rounds of the tuning, as (share, trials): the best 1/share of the candidates perform so many further trials each."""

FAILURE_COST = 3.0


def cost(row: Mapping[str, Any], scenario: Scenario) -> float:
    """The cost of a trial: its time over the time limit plus its peak load over the limit of the force guard.

    A failure costs 3.
    """
    if not row["inserted"]:
        return FAILURE_COST
    return float(row["time_s"] / scenario.trial.time_limit + row["peak_load_n"] / scenario.controller.guard.force_limit)


Perform = Callable[[int, TunedLaw, list[int]], Iterable[Mapping[str, Any]]]
"""Performs the trials of these numbers with candidate k, and returns their results (`TrialResult.record`)."""


def tune(law: type[TunedLaw], scenario: Scenario, candidates: int, perform: Perform) -> tuple[TunedLaw, float]:
    """Tunes a law by successive halving, on trials that no comparison uses; returns it with its mean cost.

    The candidates are the default parameters and a Latin hypercube over the ranges of the law. After each round the
    candidates with the lowest mean `cost` over all their trials go on; the best of the last round is returned.

    Args:
        law: the class of the law.
        scenario: unresolved.
        candidates: their number.
        perform: performs trials.
    """
    lever = scenario.geometry.reach
    places = qmc.LatinHypercube(len(law.ranges), seed=0).random(candidates - 1)
    laws = [law(lever=lever), *(law.at(place, lever=lever) for place in places)]
    left = list(range(candidates))
    costs: dict[int, list[float]] = {k: [] for k in left}
    number = FIRST_TUNING
    for share, trials in ROUNDS:
        left = left[: max(1, candidates // share)]
        numbers = list(range(number, number + trials))
        number += trials
        for k in left:
            costs[k] += [cost(row, scenario) for row in perform(k, laws[k], numbers)]
        left.sort(key=lambda k: float(np.mean(costs[k])))
    return laws[left[0]], float(np.mean(costs[left[0]]))
