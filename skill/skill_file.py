"""The file of a manipulation skill: one npz archive with named arrays and a JSON header, without pickle."""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from skill.array_schema import ArrayRule, check_arrays
from skill.arrays import Array
from skill.clustering.competitive_agglomeration import CompetitiveAgglomeration
from skill.data.npz_archive import read_archive
from skill.data.sealed_file import UNSEALED, is_sealed, read_bounded, seal
from skill.data.strict_json import parse_object
from skill.data.tables import one_line, write_atomically
from skill.features.contact_features import ContactFeatures
from skill.features.wrench_features import CanonicalFeatures, NormalisedFeatures, RawFeatures, WrenchFeatures
from skill.planning.planning_model import PlanningModel
from skill.regression.locally_weighted_regression import LWRegressor
from skill.skill_schema import PARAMETERS, check_header, check_parts, feature_part
from skill.states.context_mixture import ContextMixture
from skill.states.state_graph import StateGraph

SKILL_VERSION = 7
"""Version of the files that are written."""

OLDER_VERSIONS = (4, 5, 6)
"""The other versions that are read; their files have no plans, those before 6 no contexts, and those of 4 no digest."""

MAX_BYTES = 50_000_000
"""Largest size of a file; a skill of thirty demonstrations has 0.3 MB, one that plans 1.4 MB."""

SKILL_PARAMETERS = tuple(PARAMETERS)
"""The constructor parameters of a `ManipulationSkill` that are stored."""

SOURCES = {"sources": ArrayRule(("n", 2))}


class ArrayPart(Protocol):
    """A part of a skill that is stored as named arrays."""

    def to_arrays(self) -> dict[str, NDArray[Any]]:
        """The fitted part as plain arrays."""

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[Any]]) -> Self:
        """Restores the part from its arrays."""


FEATURE_PARTS = ("features", "state_features")
"""The parts that are stored by class name and parameters: one of ``FEATURE_TYPES`` each."""

FEATURE_TYPES: dict[str, type[WrenchFeatures]] = {
    kind.__name__: kind for kind in (RawFeatures, NormalisedFeatures, CanonicalFeatures, ContactFeatures)
}

ARRAY_PARTS: dict[str, type[ArrayPart]] = {
    "states": CompetitiveAgglomeration,
    "regressor": LWRegressor,
    "graph": StateGraph,
}
"""The parts that are stored as arrays, each of this type. An array is named "part/array"."""

OPTIONAL_PARTS: dict[str, type[ArrayPart]] = {"contexts": ContextMixture, "planning": PlanningModel}
"""The parts that may be None, and are then not stored; otherwise as ``ARRAY_PARTS``."""


@dataclass(frozen=True)
class SkillContents:
    """The contents of a skill file.

    Attributes:
        parameters: values of the ``SKILL_PARAMETERS``.
        parts: the fitted parts, by the names in ``FEATURE_PARTS`` and ``ARRAY_PARTS``.
        sources: (n, 2), demonstration number and time (s) of each sample of the regressor.
        period: sample period, s.
        metadata: numbers of demonstrations, and their geometry.
        names: names of the states, or None.
        min_log_support: see `ManipulationSkill`.
    """

    parameters: dict[str, Any]
    parts: dict[str, Any]
    sources: Array
    period: float
    metadata: dict[str, Any]
    names: list[str] | None
    min_log_support: float


def write_skill_file(path: Path, contents: SkillContents) -> None:
    """Writes a skill file atomically, with a digest in the comment of the archive.

    Raises:
        TypeError: if a part is not of a type that can be stored.
    """
    _check_types(contents.parts)
    header: dict[str, Any] = {"skill_version": SKILL_VERSION, "parameters": contents.parameters}
    for name in FEATURE_PARTS:
        part = contents.parts[name]
        header[name] = [type(part).__name__, part.get_params()]
    header |= {
        "period": contents.period,
        "metadata": contents.metadata,
        "names": contents.names,
        "least_log_support": contents.min_log_support,
    }
    arrays: dict[str, Any] = {"sources": contents.sources}
    stored = (*ARRAY_PARTS, *(name for name in OPTIONAL_PARTS if contents.parts[name] is not None))
    for name in stored:
        arrays.update({f"{name}/{key}": array for key, array in contents.parts[name].to_arrays().items()})
    arrays["header"] = np.frombuffer(json.dumps(header).encode(), dtype=np.uint8)
    stream = io.BytesIO()
    np.savez_compressed(stream, **arrays)
    with zipfile.ZipFile(stream, "a") as archive:
        archive.comment = UNSEALED
    write_atomically(path, seal(stream.getvalue()))


def read_skill_file(path: Path) -> SkillContents:
    """Reads a skill file; everything in it is checked before anything is built.

    Raises:
        ValueError: if the file is missing, damaged, changed, too large, not a skill file, or of another version. The
            message names the file and what is wrong in it.
    """
    header, arrays, sealed = _read_archive(Path(path))
    version = header.get("skill_version")
    if type(version) is not int or version not in (*OLDER_VERSIONS, SKILL_VERSION):
        expected = f"{OLDER_VERSIONS[0]} to {SKILL_VERSION}"
        raise ValueError(f"{path}: skill file version {version}, expected {expected}; train the skill again")
    try:
        if version > OLDER_VERSIONS[0] and not sealed:
            raise ValueError(f"damaged: a file of version {version} without its digest")
        return _contents(header, arrays)
    except ValueError as error:
        raise ValueError(f"{path}: not a complete skill file ({one_line(error)})") from error


def _contents(header: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> SkillContents:
    check_header(header)
    part_types = ARRAY_PARTS | OPTIONAL_PARTS
    arrays_of: dict[str, dict[str, NDArray[Any]]] = {name: {} for name in part_types}
    sources: dict[str, NDArray[Any]] = {}
    for full_name, array in arrays.items():
        part, _, key = full_name.partition("/")
        if key and part in arrays_of:
            arrays_of[part][key] = array
        else:
            sources[full_name] = array
    check_arrays(sources, SOURCES, "a skill")
    parts: dict[str, Any] = {name: feature_part(name, header[name], FEATURE_TYPES) for name in FEATURE_PARTS}
    parts |= dict.fromkeys(OPTIONAL_PARTS)
    for name, part_type in part_types.items():
        if name in OPTIONAL_PARTS and not arrays_of[name]:
            continue
        try:
            parts[name] = part_type.from_arrays(arrays_of[name])
        except ValueError as error:
            raise ValueError(f"{name}: {error}") from error
    check_parts(parts, sources["sources"], header)
    return SkillContents(
        parameters=header["parameters"],
        parts=parts,
        sources=sources["sources"],
        period=header["period"],
        metadata=header["metadata"],
        names=header["names"],
        min_log_support=float(header["least_log_support"]),
    )


def _read_archive(path: Path) -> tuple[dict[str, Any], dict[str, NDArray[Any]], bool]:
    """Returns the header, the arrays, and whether the file carries a digest."""
    try:
        data = read_bounded(path, MAX_BYTES)
        sealed = is_sealed(data)
        arrays = read_archive(data)
        header = arrays.pop("header", None)
        if header is None or header.dtype != np.uint8:
            raise ValueError("no header")
        return parse_object(header.tobytes()), arrays, sealed
    except FileNotFoundError:
        raise ValueError(f"{path}: no such skill file; train one first") from None
    except (OSError, ValueError) as error:
        raise ValueError(f"{path}: not a skill file of this program ({one_line(error)})") from error


def _check_types(parts: Mapping[str, Any]) -> None:
    expected = {
        **{name: tuple(FEATURE_TYPES.values()) for name in FEATURE_PARTS},
        **{name: (part_type,) for name, part_type in ARRAY_PARTS.items()},
        **{name: (part_type, type(None)) for name, part_type in OPTIONAL_PARTS.items()},
    }
    for name, types in expected.items():
        if type(parts[name]) not in types:
            raise TypeError(
                f"{name}: a {type(parts[name]).__name__} cannot be stored;"
                f" expected one of {sorted(part_type.__name__ for part_type in types)}"
            )
