"""What a sweep varies: factors with their levels, as a full grid or as a random design."""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from scipy.stats import qmc

from experiments.sweeps.checked_mapping import CheckedMapping
from models.document import brief
from skill.arrays import Array

MAX_CELLS = 100_000
TRAINING = "training."
"""Begins the keys that change how a policy is made; the others are keys of the scenario."""

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


def read_factors(section: CheckedMapping) -> list[Factor]:
    """Reads the section ``vary``: a list or mapping of levels, or a range, for each factor.

    A key of the scenario, or ``training.`` and a key of ``demonstrations``, takes a list of values, or ``{uniform: [a,
    b]}`` or ``{log_uniform: [a, b]}``. Any other name takes named levels, each with the keys that it sets together:
    ``{wide: {geometry.hole_radius: 0.0114, start.tilt_range: 0.1}}``.

    Raises:
        ValueError: naming the factor and what is wrong.
    """
    factors = []
    for name in section.values:
        if not isinstance(name, str) or not name:
            raise section.error(brief(name), "no text", "the name of a factor")
        value = section.values[name]
        if isinstance(value, list):
            factors.append(_list_factor(section, name, value))
        else:
            factors.append(_mapping_factor(section, name))
    return factors


def _list_factor(section: CheckedMapping, name: str, values: list[Any]) -> Factor:
    if not values:
        raise section.error(name, "[]", "at least one value")
    try:
        texts = [json.dumps(value) for value in values]
    except TypeError as error:
        raise section.error(name, brief(values), "numbers, texts or lists of them") from error
    if len(set(texts)) < len(texts):
        raise section.error(name, brief(values), "each value once")
    return Factor(name, tuple(Level(value, {name: value}) for value in values))


def _mapping_factor(section: CheckedMapping, name: str) -> Factor:
    own = section.section(name)
    kind = next((kind for kind in ("uniform", "log_uniform") if kind in own.values), None)
    if kind is None:
        levels = []
        for level, overrides in own.values.items():
            if not isinstance(level, str | int | float):
                raise section.error(name, f"a mapping with the level {brief(level)}", "texts or numbers as levels")
            if not isinstance(overrides, Mapping) or not overrides or not all(isinstance(k, str) for k in overrides):
                raise own.error(str(level), brief(overrides), "keys with values, which this level sets together")
            levels.append(Level(level, dict(overrides)))
        if not levels:
            raise section.error(name, "{}", "levels, each with the keys that it sets")
        return Factor(name, tuple(levels))
    limits = own.take(kind, list)
    own.finish()
    numbers = [limit for limit in limits if isinstance(limit, int | float) and not isinstance(limit, bool)]
    if not (len(numbers) == len(limits) == 2 and all(map(math.isfinite, numbers)) and numbers[0] < numbers[1]):
        raise own.error(kind, brief(limits), "two numbers, the smaller first")
    if kind == "log_uniform" and numbers[0] <= 0:
        raise own.error(kind, brief(limits), "two numbers above 0")
    return Factor(name, low=float(numbers[0]), high=float(numbers[1]), logarithmic=kind == "log_uniform")


def read_cells(specification: CheckedMapping) -> list[Cell]:
    """Reads the sections ``vary`` and ``design`` and returns the cells of the design.

    The random design is a scrambled Sobol sequence: a larger number of samples begins with the same ones. Combinations
    of listed levels that are drawn again count once.

    Raises:
        ValueError: naming the key and what is wrong.
    """
    factors = read_factors(specification.section("vary"))
    design = specification.values.get("design", "grid")
    if isinstance(design, Mapping):
        section = specification.section("design")
        samples = section.count("random", least=1, most=MAX_CELLS)
        seed = section.count("seed", 0, least=0, most=2**32 - 1)
        section.finish()
        if not factors:
            raise specification.error("design", "random", "grid, because nothing is varied")
        shares = _sobol(len(factors), samples, seed)
        chosen = [[f.at(float(share)) for f, share in zip(factors, row, strict=True)] for row in shares]
        cells = [_cell(factors, levels, specification) for levels in chosen]
        return list({cell.label: cell for cell in cells}.values())  # lists of levels may be drawn alike
    if specification.take("design", str, "grid") != "grid":
        raise specification.error("design", brief(design), "grid, or {random: N, seed: S}")
    for factor in factors:
        if not factor.levels:
            raise specification.error(f"vary.{factor.name}", "a range", "a list of values in a grid")
    if math.prod(len(factor.levels) for factor in factors) > MAX_CELLS:
        raise specification.error("vary", "a grid of more than 100,000 cells", "fewer")
    return [_cell(factors, levels, specification) for levels in itertools.product(*(f.levels for f in factors))]


def _sobol(dimensions: int, samples: int, seed: int) -> Array:
    """Returns points (samples, dimensions) in the unit cube."""
    # A power of two keeps the sequence balanced; the first samples of it are used.
    sequence = qmc.Sobol(dimensions, seed=seed)
    points: Array = sequence.random_base2(math.ceil(math.log2(samples)))[:samples]
    return points


def _cell(factors: list[Factor], levels: Any, specification: CheckedMapping) -> Cell:
    overrides: Overrides = {}
    for factor, level in zip(factors, levels, strict=True):
        for key, value in level.overrides.items():
            if key in overrides:
                raise specification.error("vary", f"{key} in two factors, the second {factor.name}", "each key once")
            overrides[key] = value
    return Cell({f.name: level.value for f, level in zip(factors, levels, strict=True)}, overrides)
