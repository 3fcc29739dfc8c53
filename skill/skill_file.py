"""The file of a manipulation skill: one npz archive with named arrays and a JSON header, without pickle."""

from __future__ import annotations

import io
import json
import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from skill.arrays import Array
from skill.clustering.competitive_agglomeration import CompetitiveAgglomeration
from skill.data.tables import write_atomically
from skill.features.contact_features import ContactFeatures
from skill.features.wrench_features import CanonicalFeatures, NormalisedFeatures, RawFeatures, WrenchFeatures
from skill.regression.locally_weighted_regression import LWRegressor
from skill.states.state_graph import StateGraph

SKILL_VERSION = 4
"""Version of the file format; files of other versions are not loaded."""


SKILL_PARAMETERS = ("still", "rough", "force_noise", "moment_noise", "random_state")
"""The constructor parameters of a `ManipulationSkill` that are stored."""


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
    """Writes a skill file atomically.

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
    for name in ARRAY_PARTS:
        arrays.update({f"{name}/{key}": array for key, array in contents.parts[name].to_arrays().items()})
    arrays["header"] = np.frombuffer(json.dumps(header).encode(), dtype=np.uint8)
    stream = io.BytesIO()
    np.savez_compressed(stream, **arrays)
    write_atomically(path, stream.getvalue())


def read_skill_file(path: Path) -> SkillContents:
    """Reads a skill file.

    Raises:
        ValueError: if the file is missing, damaged, not a skill file, or of another version. The message names the
            file.
    """
    header, arrays = _read_archive(path)
    if header.get("skill_version") != SKILL_VERSION:
        raise ValueError(
            f"{path}: skill file version {header.get('skill_version')}, expected {SKILL_VERSION}; train the skill again"
        )
    try:
        parameters = dict(header["parameters"])
        unknown = sorted(set(parameters) - set(SKILL_PARAMETERS))
        if unknown:
            raise ValueError(f"unknown parameters {unknown}; expected some of {list(SKILL_PARAMETERS)}")
        sources = arrays.pop("sources")
        arrays_of: dict[str, dict[str, NDArray[Any]]] = {name: {} for name in ARRAY_PARTS}
        for full_name, array in arrays.items():
            part, key = full_name.split("/", 1)
            arrays_of[part][key] = array
        parts: dict[str, Any] = {}
        for name in FEATURE_PARTS:
            kind, settings = header[name]
            parts[name] = FEATURE_TYPES[kind](**settings)
        for name, part_type in ARRAY_PARTS.items():
            parts[name] = part_type.from_arrays(arrays_of[name])
        return SkillContents(
            parameters=parameters,
            parts=parts,
            sources=sources,
            period=header["period"],
            metadata=header["metadata"],
            names=header["names"],
            min_log_support=float(header["least_log_support"]),
        )
    except (KeyError, TypeError, ValueError) as error:
        raise ValueError(f"{path}: not a complete skill file ({error})") from error


def _read_archive(path: Path) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    try:
        with np.load(path, allow_pickle=False) as stored:
            arrays = {name: stored[name] for name in stored.files}
        return dict(json.loads(arrays.pop("header").tobytes())), arrays
    except FileNotFoundError:
        raise ValueError(f"{path}: no such skill file; train one first") from None
    except (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile, zlib.error) as error:
        raise ValueError(f"{path}: not a skill file of this program ({error})") from error


def _check_types(parts: Mapping[str, Any]) -> None:
    expected = {
        **{name: tuple(FEATURE_TYPES.values()) for name in FEATURE_PARTS},
        **{name: (part_type,) for name, part_type in ARRAY_PARTS.items()},
    }
    for name, types in expected.items():
        if type(parts[name]) not in types:
            raise TypeError(
                f"{name}: a {type(parts[name]).__name__} cannot be stored;"
                f" expected one of {sorted(part_type.__name__ for part_type in types)}"
            )
