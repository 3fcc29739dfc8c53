"""The shape and the sizes of peg and hole, as stored with demonstrations, rig runs and skills."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from typing import Any, Self

from skill.data.files import is_number

MAX_SIZE = 10.0
"""Largest size of peg or hole, m; scenarios allow no larger one."""

TABLES = ("corners", "mates")
"""Attributes of a geometry that hold rows of numbers."""

OF_POLICIES = ("section", *TABLES, "peg_radius", "hole_radius", "hole_depth", "chamfer")
"""Attributes on which a policy depends."""


@dataclass(frozen=True)
class PegHoleGeometry:
    """The shape and the sizes of peg and hole.

    Attributes:
        peg_radius: m.
        peg_length: m.
        hole_radius: m, greater than the radius of the peg.
        hole_depth: m, greater than the chamfer.
        chamfer: width of the chamfer at the mouth, m, at 45 degrees.
        facets: number of facets of the simulated bore and peg, at least 3.
        block_radius: outer radius of the hole block, m, greater than that of the chamfer.
        floor: thickness of the block below the bore, m.
        section: name of the shape, see `models.section`.
        corners: of a polygon, which then replaces the name.
        mates: rows of sections that mate at once, see `models.assembly`; empty for one on the axis.
    """

    peg_radius: float
    peg_length: float
    hole_radius: float
    hole_depth: float
    chamfer: float
    facets: int
    block_radius: float
    floor: float
    section: str = "round"
    corners: tuple[tuple[float, ...], ...] = ()
    mates: tuple[tuple[float, ...], ...] = ()

    @property
    def clearance(self) -> float:
        """Radial clearance of peg and hole, m."""
        return self.hole_radius - self.peg_radius

    @classmethod
    def from_metadata(cls, metadata: Mapping[str, Any], where: str) -> Self:
        """Reads the entry ``geometry`` of metadata; ignores sizes that it does not know.

        Args:
            metadata: metadata of a demonstration, a rig run or a skill.
            where: name of the source, for error messages.

        Raises:
            ValueError: if the geometry is missing or incomplete, or if a size is impossible or above ``MAX_SIZE``.
        """
        geometry = cls.find(metadata, where)
        if geometry is None:
            raise ValueError(f"{where}: no geometry in the metadata; expected the sizes {list(SIZES)}")
        return geometry

    @classmethod
    def find(cls, metadata: Mapping[str, Any], where: str) -> Self | None:
        """Returns the geometry like `from_metadata`, or None if the metadata have no entry ``geometry``."""
        stored = metadata.get("geometry")
        if stored is None:
            return None
        if not isinstance(stored, Mapping):
            raise ValueError(f"{where}: geometry is {stored!r}; expected a mapping of the sizes {list(SIZES)}")
        missing = [n for n in SIZES if not (is_number(stored.get(n)) and math.isfinite(stored[n]))]
        if missing:
            raise ValueError(f"{where}: geometry lacks {missing}; expected finite numbers for {list(SIZES)}")
        sizes: dict[str, Any] = {name: float(stored[name]) for name in SIZES if name != "facets"}
        for name in TABLES:
            try:
                sizes[name] = _rows(stored.get(name, ()))
            except (TypeError, ValueError) as error:
                raise ValueError(f"{where}: geometry.{name} is {stored[name]!r}; expected rows of numbers") from error
        geometry = cls(facets=round(stored["facets"]), section=str(stored.get("section", cls.section)), **sizes)
        errors = geometry._errors()
        if errors:
            raise ValueError(f"{where}: geometry: {'; '.join(errors)}")
        return geometry

    def record(self) -> dict[str, Any]:
        """Returns the shape and the sizes as JSON values."""
        return {**asdict(self), **{name: [list(row) for row in getattr(self, name)] for name in TABLES}}

    def _errors(self) -> list[str]:
        """What is impossible about the sizes."""
        limits = {  # each size, and the greatest value that is too small for it
            "peg_radius": 0.0,
            "peg_length": 0.0,
            "hole_radius": self.peg_radius,
            "hole_depth": self.chamfer,
            "block_radius": self.hole_radius + self.chamfer,
            "floor": 0.0,
        }
        errors = [
            f"{name.replace('_', ' ')} {getattr(self, name):g} m, expected above {limit:g} m, at most {MAX_SIZE:g} m"
            for name, limit in limits.items()
            if not limit < getattr(self, name) <= MAX_SIZE
        ]
        if self.chamfer < 0.0:
            errors.append(f"chamfer {self.chamfer:g} m, expected at least 0")
        if self.facets < 3:
            errors.append(f"{self.facets} facets, expected at least 3")
        return errors


SIZES = tuple(field.name for field in fields(PegHoleGeometry) if field.name not in ("section", *TABLES))
"""Attributes of a geometry that are numbers."""


def common_geometry(metadata_of: Sequence[tuple[str, Mapping[str, Any]]]) -> PegHoleGeometry | None:
    """Returns the geometry that all sources share; None if they do not state it.

    Args:
        metadata_of: name and metadata of each source.

    Raises:
        ValueError: if the geometries differ. The message names the sources with the rarest geometry, and how it differs
            from the most frequent one.
    """
    sources: dict[PegHoleGeometry | None, list[str]] = {}
    for name, metadata in metadata_of:
        sources.setdefault(PegHoleGeometry.find(metadata, name), []).append(name)
    usual, *others = sorted(sources, key=lambda geometry: -len(sources[geometry]))
    if others:
        odd = others[-1]
        named = ", ".join(sources[odd][:3]) + (f" and {len(sources[odd]) - 3} more" if len(sources[odd]) > 3 else "")
        if odd is None or usual is None:
            difference = "no geometry, but there is one" if odd is None else "a geometry, but there is none"
        else:
            difference = fit_difference(odd.record(), usual.record(), list(usual.record()))
        raise ValueError(
            f"{named}: {difference} in {len(sources[usual])} of {len(metadata_of)} demonstrations, such as"
            f" {sources[usual][0]}; expected one geometry: train a skill for each"
        )
    return usual


def fit_difference(learnt: Mapping[str, Any], needed: Mapping[str, Any], names: Sequence[str] = OF_POLICIES) -> str:
    """Compares two geometries as mappings, by default in what a policy depends on.

    Returns:
        the first difference, such as "geometry.chamfer 0.001 m, not 0.002 m", or "".
    """
    for name in names:
        one, other = (_rows(found[name]) if name in TABLES else found[name] for found in (learnt, needed))
        if one != other:
            unit = "" if name in (*TABLES, "section", "facets") else " m"
            return f"geometry.{name} {learnt[name]}{unit}, not {needed[name]}{unit}"
    return ""


def _rows(rows: Any) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(float(value) for value in row) for row in rows)
