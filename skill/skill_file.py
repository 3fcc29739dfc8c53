"""The file of a manipulation skill: one npz archive with named arrays and a JSON header, without pickle.

Everything in a file is checked before anything is built from it: the header, each array (`check_arrays`), and that the
parts of the skill fit together.
"""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from skill.arrays import Array
from skill.clustering.competitive_agglomeration import CompetitiveAgglomeration
from skill.clustering.gaussian_states import GaussianStates
from skill.data.array_schema import MAX_MAGNITUDE, MIN_POSITIVE, ArrayRule, check_arrays
from skill.data.files import (
    UNSEALED,
    check_seal,
    is_number,
    one_line,
    parse_object,
    read_bounded,
    seal,
    write_atomically,
)
from skill.data.geometry import PegHoleGeometry
from skill.data.npz_archive import read_archive
from skill.features.contact_features import ContactFeatures
from skill.features.wrench_features import CanonicalFeatures, NormalisedFeatures, RawFeatures, WrenchFeatures
from skill.policy.planning_model import PlanningModel
from skill.policy.transitions import N_INPUTS, N_LOADS
from skill.regression.locally_weighted_regression import LWRegressor
from skill.states.state_graph import StateGraph

SKILL_VERSION = 9
"""Version of the files that are written and read."""

MAX_BYTES = 50_000_000
"""Largest size of a file; a skill of thirty demonstrations has 0.3 MB, one that plans 1.4 MB."""

MAX_PERIOD = 1.0
"""Largest sample period, s."""

MAX_ACTION = 10.0
"""Largest turn (rad) or feed (m) over one sample period."""

POLICIES = ("imitate", "plan")
"""How a skill can act; see `skill.policy.imitation` and `skill.policy.planner`."""

N_ACTIONS = (3, 4)
"""Number of outputs of the regressor: turn about x and y, feed, and turn about z where the skill turns there."""

Check = Callable[[Any], bool]


def _positive(value: Any) -> bool:
    return is_number(value) and MIN_POSITIVE <= value <= MAX_MAGNITUDE


PARAMETERS = (
    *("still", "rough", "correction_time", "feed_time", "force_noise", "moment_noise"),
    *("policy", "random_state"),
)
"""The constructor parameters of a `ManipulationSkill` that are stored. All but the policy matter to training alone."""


def _are_parameters(value: Any) -> bool:
    return isinstance(value, dict) and set(value) == set(PARAMETERS) and value["policy"] in POLICIES


ENTRIES: dict[str, tuple[Check, str]] = {
    "skill_version": (lambda value: type(value) is int, "an integer"),
    "parameters": (_are_parameters, f"an object of {list(PARAMETERS)}, the policy one of {list(POLICIES)}"),
    "features": (lambda value: isinstance(value, list), "a class name and its parameters"),
    "state_features": (lambda value: isinstance(value, list), "a class name and its parameters"),
    "period": (lambda value: is_number(value) and 0.0 < value <= MAX_PERIOD, "a positive time of at most 1 s"),
    "metadata": (lambda value: isinstance(value, dict), "an object"),
    "names": (lambda value: value is None or _are_texts(value), "null or a list of texts"),
    "least_log_support": (lambda value: is_number(value) and value <= MAX_MAGNITUDE, "a number of at most 1e12"),
}
"""The entries of the header, and what they may be."""


def _are_texts(value: Any) -> bool:
    return isinstance(value, list) and all(isinstance(name, str) for name in value)


SOURCES = {"sources": ArrayRule(("n", 2))}


class ArrayPart(Protocol):
    """A part of a skill that is stored as named arrays."""

    def to_arrays(self) -> dict[str, NDArray[Any]]:
        """The fitted part as plain arrays."""

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray[Any]]) -> Any:
        """Restores the part from its arrays."""


FEATURE_PARTS = ("features", "state_features")
"""The parts that are stored by class name and parameters: one of ``FEATURE_TYPES`` each."""

FEATURE_TYPES: dict[str, type[WrenchFeatures]] = {
    kind.__name__: kind for kind in (RawFeatures, NormalisedFeatures, CanonicalFeatures, ContactFeatures)
}

ARRAY_PARTS: dict[str, type[ArrayPart]] = {
    "states": GaussianStates,
    "regressor": LWRegressor,
    "graph": StateGraph,
}
"""The parts that are stored as arrays, each of this type. An array is named "part/array"."""

OPTIONAL_PARTS: dict[str, type[ArrayPart]] = {"planning": PlanningModel}
"""The parts that may be None, and are then not stored; otherwise as ``ARRAY_PARTS``."""


def write_skill_file(path: Path, skill: Any) -> None:
    """Writes a fitted `ManipulationSkill` atomically, with a digest in the comment of the archive.

    Raises:
        TypeError: if a part is not of a type that can be stored.
    """
    parts = {name: getattr(skill, f"{name}_") for name in (*FEATURE_PARTS, *ARRAY_PARTS, *OPTIONAL_PARTS)}
    _check_types(parts)
    parameters = {name: getattr(skill, name) for name in PARAMETERS}
    header: dict[str, Any] = {"skill_version": SKILL_VERSION, "parameters": parameters}
    header |= {name: [type(parts[name]).__name__, parts[name].get_params()] for name in FEATURE_PARTS}
    header |= {
        "period": skill.period_,
        "metadata": skill.metadata_,
        "names": skill.names_,
        "least_log_support": skill.min_log_support_,
    }
    arrays: dict[str, Any] = {"sources": skill.sources_}
    for name in (*ARRAY_PARTS, *OPTIONAL_PARTS):
        if parts[name] is not None:
            arrays.update({f"{name}/{key}": array for key, array in parts[name].to_arrays().items()})
    arrays["header"] = np.frombuffer(json.dumps(header).encode(), dtype=np.uint8)
    stream = io.BytesIO()
    np.savez_compressed(stream, **arrays)
    with zipfile.ZipFile(stream, "a") as archive:
        archive.comment = UNSEALED
    write_atomically(path, seal(stream.getvalue()))


def read_skill_file(path: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """Reads the parameters and the fitted attributes of a `ManipulationSkill`; everything is checked first.

    Raises:
        ValueError: if the file is missing, damaged, changed, too large, not a skill file, or of another version. The
            message names the file and what is wrong in it.
    """
    header, arrays = _read_archive(path)
    version = header.get("skill_version")
    if type(version) is not int or version != SKILL_VERSION:
        raise ValueError(f"{path}: skill file version {version}, expected {SKILL_VERSION}; train the skill again")
    try:
        return _contents(header, arrays)
    except ValueError as error:
        raise ValueError(f"{path}: not a complete skill file ({one_line(error)})") from error


def _contents(header: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> tuple[dict[str, Any], dict[str, Any]]:
    _check_header(header)
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
    parts: dict[str, Any] = {name: _feature_part(name, header[name]) for name in FEATURE_PARTS}
    parts |= dict.fromkeys(OPTIONAL_PARTS)
    for name, part_type in part_types.items():
        if name in OPTIONAL_PARTS and not arrays_of[name]:
            continue
        try:
            parts[name] = part_type.from_arrays(arrays_of[name])
        except ValueError as error:
            raise ValueError(f"{name}: {error}") from error
    _check_parts(parts, sources["sources"], header)
    return header["parameters"], {
        **{f"{name}_": part for name, part in parts.items()},
        "sources_": sources["sources"],
        "period_": header["period"],
        "metadata_": header["metadata"],
        "names_": header["names"],
        "min_log_support_": float(header["least_log_support"]),
    }


def _read_archive(path: Path) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    """Returns the header and the arrays."""
    try:
        data = read_bounded(path, MAX_BYTES)
        check_seal(data)
        arrays = read_archive(data)
        header = arrays.pop("header", None)
        if header is None or header.dtype != np.uint8:
            raise ValueError("no header")
        return parse_object(header.tobytes()), arrays
    except FileNotFoundError:
        raise ValueError(f"{path}: no such skill file; train one first") from None
    except (OSError, ValueError) as error:
        raise ValueError(f"{path}: not a skill file of this program ({one_line(error)})") from error


def _check_types(parts: Mapping[str, Any]) -> None:
    expected: dict[str, tuple[type, ...]] = {
        **{name: tuple(FEATURE_TYPES.values()) for name in FEATURE_PARTS},
        **{name: (part_type,) for name, part_type in ARRAY_PARTS.items()},
        **{name: (part_type, type(None)) for name, part_type in OPTIONAL_PARTS.items()},
        "states": (CompetitiveAgglomeration, GaussianStates),
    }
    for name, types in expected.items():
        if type(parts[name]) not in types:
            raise TypeError(
                f"{name}: a {type(parts[name]).__name__} cannot be stored;"
                f" expected one of {sorted(part_type.__name__ for part_type in types)}"
            )


def _check_header(header: Mapping[str, Any]) -> None:
    """Checks the header of a skill file; a ValueError names the entry, what was found and what was expected."""
    odd = sorted(set(header) ^ set(ENTRIES))
    if odd:
        raise ValueError(f"entries of the header {odd} missing or unknown; expected exactly {list(ENTRIES)}")
    for name, (fits, wanted) in ENTRIES.items():
        if not fits(header[name]):
            text = repr(header[name])
            raise ValueError(f"'{name}' is {text if len(text) < 60 else f'{text[:60]}...'}, expected {wanted}")
    PegHoleGeometry.find(header["metadata"], "header")
    for name in ("demonstrations", "good", "practice_trials"):
        count = header["metadata"].get(name, 1)
        if type(count) is not int or not 1 <= count <= MAX_MAGNITUDE:
            raise ValueError(f"header: metadata '{name}' is {count!r}, expected a positive integer of at most 1e12")


def _feature_part(name: str, entry: list[Any]) -> WrenchFeatures:
    """Returns the features that an entry of the header describes: the name of a class, and its parameters."""
    kind, settings = entry if len(entry) == 2 else (entry, None)
    if kind not in list(FEATURE_TYPES):
        raise ValueError(f"{name}: class {kind!r}, expected one of {sorted(FEATURE_TYPES)}")
    known = sorted(FEATURE_TYPES[kind]().get_params())
    if not isinstance(settings, dict) or sorted(settings) != known:
        found = sorted(settings) if isinstance(settings, dict) else None
        raise ValueError(f"{name}: parameters {found} of {kind}, expected {known}")
    for key, value in settings.items():
        if not _positive(value):
            raise ValueError(f"{name}: '{key}' is {value!r}, expected a positive number in SI units, 1e-12 to 1e12")
    return FEATURE_TYPES[kind](**settings)


def _check_parts(parts: Mapping[str, Any], sources: Array, header: Mapping[str, Any]) -> None:
    """Checks that the parts of a skill fit together; a ValueError names the part, what was found and expected.

    Args:
        parts: the parts by their names.
        sources: (n, 2), demonstration number and time (s) of each sample of the regressor.
        header: the header of the file.
    """
    states, regressor, graph = (parts[name] for name in ("states", "regressor", "graph"))
    measured = len(parts["state_features"].names)
    channels = measured + len(parts["state_features"].hidden_names)
    features = len(parts["features"].names)
    K, P = len(states.means_), regressor.memberships_
    if P is None:
        raise ValueError(f"regressor: array 'memberships' is missing, expected one column for each of {K} states")
    for what, found, expected in (
        ("states: number of channels", states.means_.shape[1], channels),
        ("graph: number of states", len(graph.visits_), K),
        ("regressor: number of features", regressor.X_.shape[1], features),
        ("regressor: number of outputs", regressor.y_.shape[1], N_ACTIONS[bool(header["metadata"].get("clocking"))]),
        ("regressor: number of states", P.shape[1], K),
        ("sources: number of samples", len(sources), len(regressor.X_)),
    ):
        if found != expected:
            raise ValueError(f"{what} is {found}, expected {expected} as the other parts have")
    if not (np.isfinite(sources).all() and (sources[:, 0] >= 0).all() and (sources[:, 0] % 1 == 0).all()):
        raise ValueError("sources: expected the number of a demonstration and a time in s for each sample")
    if regressor.rows_[-1] >= len(sources):
        raise ValueError(f"regressor: array 'rows' goes up to {regressor.rows_[-1]}, expected below {len(sources)}")
    largest = float(np.abs(regressor.y_).max())
    if largest > MAX_ACTION:
        raise ValueError(f"regressor: array 'y' goes up to {largest:g} rad or m, expected at most {MAX_ACTION:g}")
    planning, plans = parts["planning"], header["parameters"].get("policy") == "plan"
    if (planning is not None) != plans:
        raise ValueError(f"planning: {'missing' if plans else 'unexpected'} for this policy")
    if planning is not None:
        spreads = planning.feature_spread, planning.input_spread, planning.output_spread
        sizes = [*(len(spread) for spread in spreads), len(planning.lower)]
        of_skill = [features, N_INPUTS, N_LOADS, K]
        if sizes != of_skill:
            raise ValueError(f"planning: {sizes} features, inputs, outputs and states, expected {of_skill}")
    names = header["names"]
    if names is not None and len(names) < K:
        raise ValueError(f"header: {len(names)} names, expected one for each of {K} states")
