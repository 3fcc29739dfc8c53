"""What a sweep varies: factors with their levels, as a full grid or as a random design."""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from models.document import brief
from skill.arrays import Array

MAX_CELLS = 1_000
TRAINING = "training."
"""Begins the keys that change how a policy is made; the others are keys of the scenario."""

RANGES = ("uniform", "log_uniform")
"""How numbers are drawn from a range."""

Overrides = dict[str, Any]
"""Values by their dotted keys, such as ``contact.friction``."""


@dataclass(frozen=True)
class Level:
    """One value of a factor.

    Attributes:
        value: in the results: a number, a text or a list.
        overrides: what it changes.
    """

    value: Any
    overrides: Overrides


@dataclass(frozen=True)
class Cell:
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
        return json.dumps(self.factors, sort_keys=True)

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
        return Level(value, {self.name: value})


def make_cells(vary: dict[str, Any], design: str | dict[str, Any], where: str) -> list[Cell]:
    """Returns the cells of a design.

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
        cells = [_cell(factors, levels, where) for levels in chosen]
        return list({cell.label: cell for cell in cells}.values())
    if design != "grid":
        raise _wrong(where, "design", brief(design), "grid, or {random: N, seed: S}")
    for factor in factors:
        if not factor.levels:
            raise _wrong(where, f"vary.{factor.name}", "a range", "a list of values in a grid")
    if math.prod(len(factor.levels) for factor in factors) > MAX_CELLS:
        raise _wrong(where, "vary", f"a grid of more than {MAX_CELLS:,} cells", "fewer")
    return [_cell(factors, levels, where) for levels in itertools.product(*(f.levels for f in factors))]


def _wrong(where: str, name: str, found: str, expected: str) -> ValueError:
    return ValueError(f"{where}: {name} is {found}, expected {expected}")


def _factor(name: Any, values: Any, where: str) -> Factor:
    """Reads a factor: a list of values, a range, or named levels."""
    path = f"vary.{name}"
    if not isinstance(name, str) or not name:
        raise _wrong(where, path, "no text", "the name of a factor")
    if isinstance(values, list):
        return _list_factor(name, values, where)
    if not isinstance(values, dict) or not values:
        raise _wrong(where, path, brief(values), "a list of values, a range, or levels with the keys that they set")
    if any(kind in values for kind in RANGES):
        return _range_factor(name, values, where)
    for level, overrides in values.items():
        if not isinstance(level, str | int | float):
            raise _wrong(where, path, f"a mapping with the level {brief(level)}", "texts or numbers as levels")
        if not isinstance(overrides, dict) or not overrides or not all(isinstance(key, str) for key in overrides):
            raise _wrong(where, f"{path}.{level}", brief(overrides), "keys with values, which this level sets together")
    return Factor(name, tuple(Level(level, overrides) for level, overrides in values.items()))


def _list_factor(name: str, values: list[Any], where: str) -> Factor:
    path = f"vary.{name}"
    if not values:
        raise _wrong(where, path, "[]", "at least one value")
    try:
        texts = [json.dumps(value) for value in values]
    except TypeError as error:
        raise _wrong(where, path, brief(values), "numbers, texts or lists of them") from error
    if len(set(texts)) < len(texts):
        raise _wrong(where, path, brief(values), "each value once")
    return Factor(name, tuple(Level(value, {name: value}) for value in values))


def _range_factor(name: str, values: dict[str, Any], where: str) -> Factor:
    (kind, limits), *others = values.items()
    if others:
        raise _wrong(where, f"vary.{name}", brief(values), f"one of {list(RANGES)} and nothing else")
    numbers = [limit for limit in limits if type(limit) in (int, float)] if isinstance(limits, list) else []
    if not (len(numbers) == len(limits) == 2 and all(map(math.isfinite, numbers)) and numbers[0] < numbers[1]):
        raise _wrong(where, f"vary.{name}.{kind}", brief(limits), "two numbers, the smaller first")
    if kind == "log_uniform" and numbers[0] <= 0:
        raise _wrong(where, f"vary.{name}.{kind}", brief(limits), "two numbers above 0")
    return Factor(name, low=float(numbers[0]), high=float(numbers[1]), logarithmic=kind == "log_uniform")


def _random_design(design: dict[str, Any], where: str) -> tuple[int, int]:
    """The number of samples and the seed of a random design."""
    samples: Any = design.get("random")
    seed: Any = design.get("seed", 0)
    for name, number, least, most in (("random", samples, 1, MAX_CELLS), ("seed", seed, 0, 2**32 - 1)):
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


def _cell(factors: list[Factor], levels: Sequence[Level], where: str) -> Cell:
    overrides: Overrides = {}
    for factor, level in zip(factors, levels, strict=True):
        for key, value in level.overrides.items():
            if key in overrides:
                raise _wrong(where, "vary", f"{key} in two factors, the second {factor.name}", "each key once")
            overrides[key] = value
    return Cell({f.name: level.value for f, level in zip(factors, levels, strict=True)}, overrides)
