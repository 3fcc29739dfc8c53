"""What people use on a rig that feels, without learning from anybody: push, comply, search. And how they are tuned.

Each is a `ControlLaw` and stands behind the same limits, supervisor and motors as a learnt skill.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any, ClassVar, Self

import numpy as np
from scipy.stats import qmc

from benchmarks.rig.trials import FIRST_TUNING, Record, Setting, attempts
from skill.manipulation_skill import Action
from systems.control.force_guard import contact_load
from systems.control.policy import ControlLaw

Range = tuple[float, float, bool]
"""Lowest, highest, and whether the middle is the geometric one."""


@dataclass(frozen=True)
class TunedLaw(ControlLaw):
    """A law with parameters, each with the range in which it is looked for; its defaults are a first guess by hand.

    It feeds by its speed times clip(1 - F / yield_force, -1/2, 1), F the load as the supervisor reckons it.
    """

    speed: float = 0.012  # m/s
    yield_force: float = 15.0  # N
    peg_radius: float = 0.010  # m

    ranges: ClassVar[dict[str, Range]] = {"speed": (0.005, 0.025, True), "yield_force": (5.0, 50.0, True)}

    @classmethod
    def at(cls, place: np.ndarray, **known: float) -> Self:
        """The law at a place (d,) of the unit cube over its ranges."""
        values = {}
        for share, (name, (low, high, geometric)) in zip(place, cls.ranges.items(), strict=True):
            values[name] = low * (high / low) ** share if geometric else low + (high - low) * share
        return cls(**{k: float(v) for k, v in values.items()}, **known)

    def parameters(self) -> dict[str, float]:
        """By name, SI units."""
        return {field.name: getattr(self, field.name) for field in fields(self)}

    def load(self, measured: np.ndarray) -> float:
        """N."""
        return contact_load(measured, self.peg_radius)

    def feed(self, measured: np.ndarray) -> float:
        """m, within the period."""
        return -self.speed * self.period_ * float(np.clip(1.0 - self.load(measured) / self.yield_force, -0.5, 1.0))


@dataclass(frozen=True)
class StraightPush(ControlLaw):
    """No correction: the feed alone, at the speed of an unhindered operator."""

    speed: float  # m/s

    def act(self, measured: Any, probabilities: Any = None) -> Action:
        return Action(turn=np.zeros(2), feed=-self.speed * self.period_, probabilities=np.ones(1))


@dataclass(frozen=True)
class MomentCompliance(TunedLaw):
    """Accommodation: the peg yields to the moment about a centre of compliance.

    With f and m the force and the moment about the tip, the moment about the point at height c on the peg's axis is

        m_c = m - c z x f = (m_x + c f_y, m_y - c f_x),

    and omega = g m_c max(0, 1 - m_0 / |m_c|), after Whitney, "Force feedback control of manipulator fine motions",
    1977. Moment and lateral force so enter in proportions that the tuning finds.
    """

    gain: float = 1.0  # rad/s per N m
    height: float = 0.005  # m, of the centre of compliance above the tip
    dead_zone: float = 0.02  # N m

    ranges: ClassVar[dict[str, Range]] = {
        **TunedLaw.ranges,
        "gain": (0.1, 10.0, True),
        "height": (-0.005, 0.025, False),
        "dead_zone": (0.005, 0.05, True),
    }

    def act(self, measured: Any, probabilities: Any = None) -> Action:
        fx, fy, _, mx, my = measured[:5]
        moment = np.array([mx + self.height * fy, my - self.height * fx])
        size = float(np.linalg.norm(moment))
        rate = self.gain * moment * (1.0 - self.dead_zone / size) if size > self.dead_zone else np.zeros(2)
        return Action(turn=rate * self.period_, feed=self.feed(measured), probabilities=np.ones(1))


@dataclass(frozen=True)
class SpiralSearch(TunedLaw):
    """A growing spiral in pitch and yaw, walked at a steady rate while pressing, as long as something resists.

    A rig whose only lateral freedoms are two angles searches over them. Point k of the spiral has the angle phi and
    the radius spacing phi / 2 pi with spacing phi^2 / 4 pi = rate T k, the length walked; from the outermost point
    the walk goes straight back to the first, and begins anew. Where the load falls below ``touch`` the search rests:
    whatever tilt lets the peg slide is kept. The points are the law's phases.
    """

    spacing: float = 0.010  # rad, between turns of the spiral
    rate: float = 0.10  # rad/s
    outer: float = 0.06  # rad
    touch: float = 3.0  # N

    ranges: ClassVar[dict[str, Range]] = {
        **TunedLaw.ranges,
        "spacing": (0.003, 0.03, True),
        "rate": (0.04, 0.20, True),
        "outer": (0.03, 0.10, True),
        "touch": (1.0, 10.0, True),
    }

    def __post_init__(self) -> None:
        step = self.rate * self.period_
        points = int(np.pi * self.outer**2 / self.spacing / step)
        phi = np.sqrt(4.0 * np.pi * step * np.arange(points + 1) / self.spacing)
        out = self.spacing * phi / (2.0 * np.pi) * np.array([np.cos(phi), np.sin(phi)])
        back = np.linspace(1.0, 0.0, 1 + int(np.ceil(np.linalg.norm(out[:, -1]) / step)))[1:-1]
        path = np.hstack([out, out[:, -1:] * back]).T
        object.__setattr__(self, "_moves", path - np.roll(path, 1, axis=0))
        object.__setattr__(self, "phases", tuple(f"point {k}" for k in range(len(path))))

    def follow(self, phase: int, measured: np.ndarray) -> int:
        return (phase + 1) % self.n_states if self.load(measured) > self.touch else phase

    def act(self, measured: Any, probabilities: Any = None) -> Action:
        one = np.eye(self.n_states)[0] if probabilities is None else np.asarray(probabilities)
        walking = self.load(measured) > self.touch
        turn = self._moves[int(np.argmax(one))] if walking else np.zeros(2)
        return Action(turn=turn, feed=self.feed(measured), probabilities=one)


ROUNDS = ((1, 2), (3, 4), (8, 8))
"""Of the tuning: the best of 1/1, 1/3, 1/8 of the candidates, each on so many further trials."""

FAILED = 3.0


def cost(row: dict[str, Any], setting: Setting) -> float:
    """Of a trial: its time over the limit plus its peak lateral force over the supervisor's; a failure costs 3."""
    if not row["inserted"]:
        return FAILED
    controller = setting.scenario.controller
    return float(row["time_s"] / setting.scenario.trial.time_limit + row["peak_lateral_n"] / controller.force_limit)


def tuning_trials(candidates: int) -> int:
    """How many trials `tuned` will make."""
    return sum(max(1, candidates // share) * trials for share, trials in ROUNDS)


def tuned(law: type[TunedLaw], setting: Setting, record: Record, advance: Callable[[str], None]) -> TunedLaw:
    """Successive halving over the law's ranges, on trials that are not evaluated; what is done is not done again.

    The candidates are the guess by hand and a Latin hypercube. After each round the cheapest go on (`cost`), judged by
    all trials that they have had; the one of least mean cost at the end is the tuned law.
    """
    count = setting.candidates
    peg_radius = setting.scenario.geometry.peg_radius
    places = qmc.LatinHypercube(len(law.ranges), seed=0).random(count - 1)
    laws = [law(peg_radius=peg_radius), *(law.at(place, peg_radius=peg_radius) for place in places)]
    left = list(range(count))
    costs: dict[int, list[float]] = {k: [] for k in left}
    number = FIRST_TUNING
    for share, trials in ROUNDS:
        left = left[: max(1, count // share)]
        numbers = list(range(number, number + trials))
        number += trials
        for k in left:
            missing = [n for n in numbers if f"{k}:{n}" not in record.tuning]
            for row in attempts(setting, laws[k], missing):
                record.add_tuning(f"{k}:{row['seed']}", row)
            for n in numbers:
                costs[k].append(cost(record.tuning[f"{k}:{n}"], setting))
                advance(f"tuning {law.__name__}, candidate {k}")
        left.sort(key=lambda k: float(np.mean(costs[k])))
    record.content["tuned"] = laws[left[0]].parameters() | {"mean_cost": float(np.mean(costs[left[0]]))}
    return laws[left[0]]
