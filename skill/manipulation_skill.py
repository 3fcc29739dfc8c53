"""The manipulation skill: features, contact states, a regressor over them, and their graph, in one object."""

from __future__ import annotations

import io
import json
import math
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from sklearn.base import clone

from skill.arrays import Array
from skill.clustering.competitive_agglomeration import CompetitiveAgglomeration
from skill.data.demonstration import ACTIONS, Demonstration
from skill.data.outcome import Outcome
from skill.data.refinement import refine_demonstration
from skill.data.tables import write_atomically
from skill.features.contact_features import ContactFeatures
from skill.features.wrench_features import MEASURED, CanonicalFeatures, NormalisedFeatures, RawFeatures
from skill.regression.bandwidth_selection import select_feature_scale
from skill.regression.explanation import SkillExplanation
from skill.regression.locally_weighted_regression import LWRegressor
from skill.states.contact_state_filter import ContactStateFilter
from skill.states.state_graph import StateGraph
from skill.states.state_style import state_labels

UNSUPPORTED = 0.01  # share of the demonstrated samples that find less support than the least in other demonstrations
FOLDS = 5  # of the cross-validation over demonstrations

STATE_FLOOR = 0.05
"""Of the variance of the state features, added to every state's: a contact in another place differs by more than its
square root, 0.2 of a standard deviation; without it, each long rest in one pose becomes a state."""

SKILL_VERSION = 4
"""Of the file format; a file of another version is refused."""


PARAMETERS = ("still", "rough", "force_noise", "moment_noise", "random_state")

STORED: dict[str, Any] = {
    part.__name__: part
    for part in (
        RawFeatures,
        NormalisedFeatures,
        CanonicalFeatures,
        ContactFeatures,
        CompetitiveAgglomeration,
        LWRegressor,
    )
}
"""The parts that a skill file can hold."""


@dataclass(frozen=True)
class Action:
    """What to do for one sample period.

    Attributes:
        turn: (2,), rotation vector of the peg relative to the hole about x and y of P, rad.
        feed: motion of the peg along its axis, m; negative goes into the hole.
        probabilities: (K,), of the contact states.
        support: how near the nearest remembered sample is, from 0 to 1: its kernel weight, over the least that a
            demonstrated sample should find in the demonstrations of others. 1 where the regressor does not say.
    """

    turn: Array
    feed: float
    probabilities: Array
    support: float = 1.0


class ManipulationSkill:
    """Learnt from demonstrations, performed from a wrench and a depth.

    Its parts can be exchanged for one's own; a skill with foreign parts works, but only one with parts of this
    package can be saved.

    Args:
        features: transformer of measurements, for the regressor; None for `CanonicalFeatures`.
        state_features: transformer of measurements, by which the states are told apart; None for `ContactFeatures` of
            the demonstrations' geometry.
        states: clusterer of contact states; None for `CompetitiveAgglomeration` with a floor of 5 % under the
            variances. One with ``m_init=1`` finds a single state: no states at all.
        regressor: of the actions; None for `LWRegressor`, the features scaled by cross-validation over the
            demonstrations where there are at least five good ones, else standardised. Any scikit-learn regressor with
            several outputs will do; ours alone is given the states.
        still: delta_s, m; actions no larger than this are dropped by the refinement.
        rough: delta_d, m; jumps of the action above this are averaged by it.
        force_noise: N, one sigma, of the sensor through which the skill will feel. The virtual environment knows
            the wrench exactly; the demonstrations are seen as that sensor would have seen them, else the state
            of free motion, whose forces are exactly zero there, is never recognised on the rig.
        moment_noise: N m, likewise, about the tip: for a sensor at a height above it, mostly height times force noise.
        random_state: of the sensor's noise and the clustering.

    Attributes:
        features_, state_features_, states_, regressor_: the fitted parts; the regressor's outputs are (turn_x, turn_y,
            feed) over one sample period, in the feature frame.
        graph_: the `StateGraph` of the demonstrations.
        period_: of a sample, s.
        sources_: (n, 2), demonstration number and time (s) of each sample that the regressor remembers.
        min_log_support_: log of the kernel weight below which support is low: all but one in a hundred of the
            remembered samples find more in other demonstrations. -inf where nothing is known about it.
        names_: of the states; None while they are only numbered.
        metadata_: numbers of demonstrations, and the geometry they were made with.
    """

    def __init__(
        self,
        *,
        features: RawFeatures | None = None,
        state_features: RawFeatures | None = None,
        states: CompetitiveAgglomeration | None = None,
        regressor: Any = None,
        still: float = 2e-5,
        rough: float = 4e-4,
        force_noise: float = 0.06,
        moment_noise: float = 5e-3,
        random_state: int = 0,
    ) -> None:
        self.features = features
        self.state_features = state_features
        self.states = states
        self.regressor = regressor
        self.still = still
        self.rough = rough
        self.force_noise = force_noise
        self.moment_noise = moment_noise
        self.random_state = random_state

    def fit(self, demonstrations: Sequence[Demonstration]) -> Self:
        """Discovers the states in all demonstrations, and learns the actions of the good ones.

        Raises:
            ValueError: if no demonstration is good: there is nothing to imitate.
        """
        if not any(d.good for d in demonstrations):
            outcomes = sorted({d.reason for d in demonstrations})
            raise ValueError(
                f"none of the {len(demonstrations)} demonstrations inserts gently (outcomes: {outcomes});"
                " expected at least one good demonstration to learn from"
            )
        self.features_ = CanonicalFeatures() if self.features is None else clone(self.features)
        geometry = _common_geometry(demonstrations)
        self.state_features_ = (
            _features_of_contacts(geometry) if self.state_features is None else clone(self.state_features)
        )
        rng = np.random.default_rng(self.random_state)
        refined = [self._as_sensed(self._refined(d), rng) for d in demonstrations]
        self.period_ = float(np.median(np.concatenate([np.diff(d.samples["time"]) for d in demonstrations])))

        Z = np.vstack([self.state_features_.transform_demonstration(r) for r in refined])
        lengths = [len(r) for r in refined]
        groups = np.repeat(np.arange(len(refined)), lengths)
        phase = np.concatenate([np.linspace(0.0, 1.0, n, endpoint=False) for n in lengths])
        if self.states is None:
            states = CompetitiveAgglomeration(reg_covar=STATE_FLOOR, random_state=self.random_state)
        else:
            states = clone(self.states)
        self.states_ = states.fit(Z, groups=groups, phase=phase)
        self.names_: list[str] | None = None
        labels = self.states_.predict(Z)
        self.graph_ = StateGraph(n_states=self.n_states, sample_period=self.period_).fit(
            [labels[groups == g] for g in range(len(refined))],
            [str(Outcome.INSERTED) if d.good else d.reason for d in demonstrations],
            times=[r["time"] for r in refined],
        )

        good = np.repeat([d.good for d in demonstrations], lengths)
        samples = pd.concat(refined, ignore_index=True)[good]
        measured = samples[list(MEASURED)].to_numpy()
        X = self.features_.transform(measured)
        Y = self.features_.actions_to_frame(measured, samples[["rx", "ry", "uz"]].to_numpy())
        P = self.state_probabilities(measured)
        self.regressor_ = self._tuned(X, Y, groups[good], P) if self.regressor is None else clone(self.regressor)
        knows_states = isinstance(self.regressor_, LWRegressor)
        self.regressor_.fit(X, Y, **({"memberships": P} if knows_states else {}))
        self.sources_ = np.column_stack([groups[good], samples["time"].to_numpy()])
        self.min_log_support_ = self._min_log_support()
        self.metadata_: dict[str, Any] = {
            "demonstrations": len(refined),
            "good": int(sum(d.good for d in demonstrations)),
            "geometry": geometry,
        }
        return self

    def _tuned(self, X: Array, Y: Array, groups: Array, P: Array) -> LWRegressor:
        """Our regressor, with the feature scale that predicts left-out demonstrations best."""
        regressor = LWRegressor(feature_scale="standard", ridge=1.0)
        if len(np.unique(groups)) < FOLDS:
            return regressor
        chosen = select_feature_scale(
            regressor, X, Y, groups, memberships=P, n_splits=FOLDS, random_state=self.random_state
        )
        return regressor.set_params(feature_scale=chosen.feature_scale)

    def _refined(self, demonstration: Demonstration) -> pd.DataFrame:
        samples = demonstration.samples.copy()
        # A row holds the motion *since* the last sample; the skill pairs what was felt with what was done next.
        samples[list(ACTIONS)] = samples[list(ACTIONS)].shift(-1, fill_value=0.0)
        refined, _ = refine_demonstration(samples, still=self.still, rough=self.rough)
        return refined

    def _as_sensed(self, samples: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
        sensed = samples.copy()
        sigma = np.repeat([self.force_noise, self.moment_noise], 3)
        sensed[list(MEASURED[:6])] += sigma * rng.standard_normal((len(samples), 6))
        return sensed

    def _min_log_support(self) -> float:
        if not isinstance(self.regressor_, LWRegressor):
            return -math.inf
        demonstrations = self.sources_[self.regressor_.rows_, 0]
        if len(np.unique(demonstrations)) < 2:
            return -math.inf
        return float(np.quantile(self.regressor_.support_between(demonstrations), UNSUPPORTED))

    def state_filter(self) -> ContactStateFilter:
        """The on-line estimator of the states, over the measured features."""
        return ContactStateFilter(
            self.states_, transitions=self.graph_.transition_matrix(), channels=self._measured_channels()
        )

    def _measured_channels(self) -> NDArray[np.intp]:
        """Of the states: those that the rig can measure come first."""
        return np.arange(len(self.state_features_.get_feature_names_out()))

    def measured_features(self, measured: ArrayLike) -> Array:
        """What the states are told apart by, (k,), of one measurement (7,): fx fy fz (N) mx my mz (N m) z (m)."""
        return self.state_features_.transform(np.asarray(measured, dtype=float).reshape(1, -1))[0]

    def state_probabilities(self, measured: ArrayLike) -> Array:
        """Of each state, (n, K), from measurements (n, 7), fx fy fz mx my mz z, alone: the rest is marginalised."""
        return self.states_.predict_proba(self.state_features_.transform(measured), channels=self._measured_channels())

    def act(self, measured: ArrayLike, probabilities: ArrayLike | None = None) -> Action:
        """The action for one measurement.

        Args:
            measured: (7,) fx fy fz (N) mx my mz (N m) z (m).
            probabilities: (K,) of the states, as an estimator has filtered them; by default those of this
                measurement alone.
        """
        row = np.asarray(measured, dtype=float).reshape(1, -1)
        X = self.features_.transform(row)
        P = self.state_probabilities(row) if probabilities is None else np.asarray(probabilities, float).reshape(1, -1)
        if isinstance(self.regressor_, LWRegressor):
            predicted, log_support = self.regressor_.predict_with_support(X, memberships=P)
            support = math.exp(min(0.0, float(log_support[0]) - self.min_log_support_))
        else:
            predicted, support = self.regressor_.predict(X), 1.0
        local = self.features_.actions_from_frame(row, predicted)[0]
        return Action(turn=local[:2], feed=float(local[2]), probabilities=P[0], support=support)

    def explain(
        self, measured: ArrayLike, probabilities: ArrayLike | None = None, level: float = 0.95
    ) -> SkillExplanation:
        """Why `act` does what it does for one measurement; arguments as for `act`."""
        row = np.asarray(measured, dtype=float).reshape(1, -1)
        action = self.act(measured, probabilities)
        local = self.regressor_.explain(self.features_.transform(row)[0], action.probabilities, level)
        demonstration, time = self.sources_[local.neighbours].T
        return SkillExplanation(
            state_names=self.state_names(),
            probabilities=action.probabilities,
            turn=action.turn,
            feed=action.feed,
            frame_angle=float(self.features_.rotation_angle(row)[0]),
            lower=local.lower,
            upper=local.upper,
            level=level,
            neighbours=pd.DataFrame(
                {
                    "demonstration": demonstration.astype(int),
                    "time": time,
                    "weight": local.weights,
                    "influence": local.influence,
                }
            ),
            support=local.support,
            log_w_max=local.log_w_max,
        )

    @property
    def n_states(self) -> int:
        """Number of contact states."""
        return int(self.states_.n_clusters_)

    def state_names(self) -> list[str]:
        """Of each contact state, for tables and pictures."""
        return state_labels(self.n_states, self.names_)

    def name_states(self, names: Sequence[str]) -> None:
        """Gives each state a name, (K,), in place of its number."""
        self.names_ = state_labels(self.n_states, names)

    # ------------------------------------------------------------------- saving

    def save(self, path: Path) -> None:
        """One npz file: named arrays and a JSON header; no pickle.

        Raises:
            TypeError: if a part is not of this package: how it would be stored is unknown.
        """
        for part in (self.features_, self.state_features_, self.states_, self.regressor_):
            if type(part).__name__ not in STORED:
                raise TypeError(f"{type(part).__name__} cannot be stored; expected one of {sorted(STORED)}")
        header = {
            "skill_version": SKILL_VERSION,
            "parameters": {name: getattr(self, name) for name in PARAMETERS},
            "features": [type(self.features_).__name__, self.features_.get_params()],
            "state_features": [type(self.state_features_).__name__, self.state_features_.get_params()],
            "period": self.period_,
            "metadata": self.metadata_,
            "names": self.names_,
            "least_log_support": self.min_log_support_,
        }
        arrays: dict[str, Any] = {"sources": self.sources_}
        for part, fitted in (
            ("states", self.states_),
            ("regressor", self.regressor_),
            ("graph", self.graph_),
        ):
            arrays.update({f"{part}/{k}": v for k, v in fitted.to_arrays().items()})
        arrays["header"] = np.frombuffer(json.dumps(header).encode(), dtype=np.uint8)
        stream = io.BytesIO()
        np.savez_compressed(stream, **arrays)
        write_atomically(path, stream.getvalue())

    @classmethod
    def load(cls, path: Path) -> Self:
        """Reads what `save` wrote.

        Raises:
            ValueError: naming the file, if it is missing, not a skill, damaged, or of another version.
        """
        try:
            with np.load(path, allow_pickle=False) as stored:
                arrays = {name: stored[name] for name in stored.files}
            header = json.loads(arrays.pop("header").tobytes())
        except FileNotFoundError:
            raise ValueError(f"{path}: no such skill file; train one first") from None
        except (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile) as error:
            raise ValueError(f"{path}: not a skill file of this program ({error})") from error
        if header.get("skill_version") != SKILL_VERSION:
            raise ValueError(
                f"{path}: skill file version {header.get('skill_version')}, expected {SKILL_VERSION};"
                " train the skill again"
            )
        parts: dict[str, dict[str, Any]] = {"states": {}, "regressor": {}, "graph": {}}
        try:
            skill = cls(**header["parameters"])
            skill.sources_ = arrays.pop("sources")
            for name, array in arrays.items():
                part, key = name.split("/", 1)
                parts[part][key] = array
            skill.features_, skill.state_features_ = (
                STORED[kind](**settings) for kind, settings in (header["features"], header["state_features"])
            )
            skill.states_ = CompetitiveAgglomeration.from_arrays(parts["states"])
            skill.regressor_ = LWRegressor.from_arrays(parts["regressor"])
            skill.graph_ = StateGraph.from_arrays(parts["graph"])
            skill.period_, skill.metadata_, skill.names_ = (header[k] for k in ("period", "metadata", "names"))
            skill.min_log_support_ = float(header["least_log_support"])
        except (KeyError, TypeError, ValueError) as error:
            raise ValueError(f"{path}: not a complete skill file ({error})") from error
        return skill


def _features_of_contacts(geometry: dict[str, Any] | None) -> ContactFeatures:
    """For the radii of a geometry (m), or those of the paper's peg and hole."""
    if geometry is None:
        return ContactFeatures()
    r, R = geometry["peg_radius"], geometry["hole_radius"]
    return ContactFeatures(peg_radius=r, play=R - r)


def _common_geometry(demonstrations: Sequence[Demonstration]) -> dict[str, Any] | None:
    """The geometry that all demonstrations name; None where they name none.

    Raises:
        ValueError: if they differ: one skill is for one peg and hole.
    """
    geometries = [d.metadata.get("geometry") for d in demonstrations]
    for number, geometry in enumerate(geometries):
        if geometry != geometries[0]:
            raise ValueError(
                f"demonstration {number} has geometry {geometry}, demonstration 0 has {geometries[0]};"
                " expected one geometry: train a skill for each"
            )
    return geometries[0]
