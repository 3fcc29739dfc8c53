"""What a sweep varies: factors with their levels, combined in a full grid or in a random design."""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from models.document import brief
from skill.arrays import Array

MAX_COMBINATIONS = 1_000
TRAINING = "training."
"""Begins the keys that change how a policy is made; the others are keys of the scenario."""

RANGES = ("uniform", "log_uniform")
"""How numbers are drawn from a range."""

Overrides = dict[str, Any]
"""Values by their dotted keys, such as ``contact.friction``."""

Level = tuple[Any, Overrides]
"""A value of a factor, as the results have it, and what it changes."""


@dataclass(frozen=True)
class Combination:
    """One combination of levels.

    Attributes:
        factors: value of each factor.
        overrides: all that the levels change.
    """

    factors: dict[str, Any]
    overrides: Overrides

    @property
    def label(self) -> str:
        """The factors as JSON, the same text for the same factors."""
        return json.dumps(self.factors, sort_keys=True, default=str)

    def scenario_overrides(self) -> Overrides:
        """Returns the overrides of the scenario."""
        return {key: value for key, value in self.overrides.items() if not key.startswith(TRAINING)}

    def training_overrides(self) -> Overrides:
        """Returns the overrides of the making of policies, without the prefix."""
        return {key[len(TRAINING) :]: v for key, v in self.overrides.items() if key.startswith(TRAINING)}


@dataclass(frozen=True)
class Factor:
    """A factor: a list of levels, or a range of numbers for random designs.

    Attributes:
        name: of the factor.
        levels: of a list; empty for a range.
        low, high: limits of a range.
        logarithmic: whether a range is drawn evenly in its logarithm.
    """

    name: str
    levels: tuple[Level, ...] = ()
    low: float = 0.0
    high: float = 0.0
    logarithmic: bool = False

    def at(self, share: float) -> Level:
        """Returns the level at a share in [0, 1) of the list or range."""
        if self.levels:
            return self.levels[int(share * len(self.levels))]
        if self.logarithmic:
            value = self.low * (self.high / self.low) ** share
        else:
            value = self.low + (self.high - self.low) * share
        return value, {self.name: value}


def make_combinations(vary: dict[str, Any], design: str | dict[str, Any], where: str) -> list[Combination]:
    """Returns the combinations of a design.

    A key of the scenario, or ``training.`` and a key of ``demonstrations``, takes a list of values, or ``{uniform: [a,
    b]}`` or ``{log_uniform: [a, b]}``. Any other name takes named levels, each with the keys that it sets together:
    ``{wide: {geometry.hole_radius: 0.0114, start.tilt_range: 0.1}}``.

    The random design is a scrambled Sobol sequence: a larger number of samples begins with the same ones. Combinations
    of listed levels that are drawn again count once.

    Args:
        vary: the factors by their names.
        design: ``grid``, or ``{random: N, seed: S}``.
        where: name of the file, for messages.

    Raises:
        ValueError: naming the key and what is wrong.
    """
    factors = [_factor(name, values, where) for name, values in vary.items()]
    if isinstance(design, dict):
        samples, seed = _random_design(design, where)
        if not factors:
            raise _wrong(where, "design", "random", "grid, because nothing is varied")
        shares = _sobol(len(factors), samples, seed)
        chosen = [[f.at(float(share)) for f, share in zip(factors, row, strict=True)] for row in shares]
        combinations = [_combination(factors, levels, where) for levels in chosen]
        return list({combination.label: combination for combination in combinations}.values())
    if design != "grid":
        raise _wrong(where, "design", brief(design), "grid, or {random: N, seed: S}")
    for factor in factors:
        if not factor.levels:
            raise _wrong(where, f"vary.{factor.name}", "a range", "a list of values in a grid")
    if math.prod(len(factor.levels) for factor in factors) > MAX_COMBINATIONS:
        raise _wrong(where, "vary", f"a grid of more than {MAX_COMBINATIONS:,} combinations", "fewer")
    return [_combination(factors, levels, where) for levels in itertools.product(*(f.levels for f in factors))]


def _wrong(where: str, name: str, found: str, expected: str) -> ValueError:
    return ValueError(f"{where}: {name} is {found}, expected {expected}")


def _factor(name: str, values: Any, where: str) -> Factor:
    """Reads a factor: a list of values, a range, or named levels."""
    path = f"vary.{name}"
    match values:
        case [_, *_]:
            if any(values.count(value) > 1 for value in values):
                raise _wrong(where, path, brief(values), "each value once")
            return Factor(name, tuple((value, {name: value}) for value in values))
        case {"uniform": limits} | {"log_uniform": limits} if len(values) == 1:
            return _range_factor(name, limits, "log_uniform" in values, where)
        case {} if values and all(isinstance(overrides, dict) and overrides for overrides in values.values()):
            return Factor(name, tuple(values.items()))
    expected = f"a list of values, one of {list(RANGES)} with its limits, or levels with the keys that they set"
    raise _wrong(where, path, brief(values), expected)


def _range_factor(name: str, limits: Any, logarithmic: bool, where: str) -> Factor:
    numbers = [limit for limit in limits if type(limit) in (int, float)] if isinstance(limits, list) else []
    if not (len(numbers) == len(limits) == 2 and all(map(math.isfinite, numbers)) and numbers[0] < numbers[1]):
        raise _wrong(where, f"vary.{name}", brief(limits), "two numbers, the smaller first")
    if logarithmic and numbers[0] <= 0:
        raise _wrong(where, f"vary.{name}", brief(limits), "two numbers above 0")
    return Factor(name, low=float(numbers[0]), high=float(numbers[1]), logarithmic=logarithmic)


def _random_design(design: dict[str, Any], where: str) -> tuple[int, int]:
    """The number of samples and the seed of a random design."""
    samples: Any = design.get("random")
    seed: Any = design.get("seed", 0)
    for name, number, least, most in (("random", samples, 1, MAX_COMBINATIONS), ("seed", seed, 0, 2**32 - 1)):
        if type(number) is not int or not least <= number <= most:
            raise _wrong(where, f"design.{name}", brief(number), f"{least} to {most}")
    if not set(design) <= {"random", "seed"}:
        raise _wrong(where, "design", brief(design), "the keys random and seed only")
    return samples, seed


def _sobol(dimensions: int, samples: int, seed: int) -> Array:
    """Returns points (samples, dimensions) in the unit cube."""
    # A power of two keeps the sequence balanced; the first samples of it are used.
    from scipy.stats import qmc  # slow to import, and most designs are grids

    sequence = qmc.Sobol(dimensions, seed=seed)
    points: Array = sequence.random_base2(math.ceil(math.log2(samples)))[:samples]
    return points


def _combination(factors: list[Factor], levels: Sequence[Level], where: str) -> Combination:
    overrides: Overrides = {}
    for factor, (_, changed) in zip(factors, levels, strict=True):
        for key, value in changed.items():
            if key in overrides:
                raise _wrong(where, "vary", f"{key} in two factors, the second {factor.name}", "each key once")
            overrides[key] = value
    return Combination({f.name: value for f, (value, _) in zip(factors, levels, strict=True)}, overrides)
