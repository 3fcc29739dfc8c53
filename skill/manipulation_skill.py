"""The manipulation skill: features, contact states, a regressor over them, and their graph, in one object."""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from skill.competitive_agglomeration import CompetitiveAgglomeration
from skill.contact_state_filter import ContactStateFilter
from skill.demonstration import ACTIONS, Demonstration
from skill.explanation import SkillExplanation
from skill.features import MEASURED, CanonicalFeatures
from skill.locally_weighted_regression import LWRegressor
from skill.refinement import refine_demonstration
from skill.state_graph import StateGraph
from skill.tables import write_atomically

Array = NDArray[np.float64]

SKILL_VERSION = 1
"""Of the file format; a file of another version is refused."""


@dataclass(frozen=True)
class Action:
    """What to do for one sample period.

    Attributes:
        turn: (2,), rotation vector of the peg relative to the hole about x and y of P, rad.
        feed: motion of the peg along its axis, m; negative goes into the hole.
        probabilities: (K,), of the contact states.
    """

    turn: Array
    feed: float
    probabilities: Array


class ManipulationSkill:
    """Learnt from demonstrations, performed from a wrench and a depth.

    Args:
        still: delta_s, m; actions no larger than this are dropped by the refinement.
        rough: delta_d, m; jumps of the action above this are averaged by it.
        force_noise: N, one sigma, of the sensor through which the skill will feel. The virtual environment knows
            the wrench exactly; the demonstrations are seen as that sensor would have seen them, else the state
            of free motion, whose forces are exactly zero there, is never recognised on the rig.
        moment_noise: N m, likewise, about the tip: for a sensor at a height above it, mostly height times force noise.
        bandwidth: of the regression's kernel, in units of its standardised features.
        ridge: of the regression.
        degree: of the regression: 0 kernel mean, 1 local linear.
        random_state: of the clustering.

    Attributes:
        states_: the fitted `CompetitiveAgglomeration`, over measured and hidden features.
        regressor_: the fitted `LWRegressor`, of (turn_x, turn_y, feed) in the feature frame.
        graph_: the `StateGraph` of the demonstrations.
        period_: of a sample, s.
        sources_: (n, 2), demonstration number and time (s) of each sample that the regressor remembers.
        metadata_: what the demonstrations had in common (geometry), for a check against the rig.
    """

    def __init__(
        self,
        *,
        still: float = 2e-5,
        rough: float = 4e-4,
        force_noise: float = 0.06,
        moment_noise: float = 5e-3,
        bandwidth: float = 1.0,
        ridge: float = 1e-2,
        degree: int = 1,
        random_state: int = 0,
    ) -> None:
        self.still = still
        self.rough = rough
        self.force_noise = force_noise
        self.moment_noise = moment_noise
        self.bandwidth = bandwidth
        self.ridge = ridge
        self.degree = degree
        self.random_state = random_state

    def fit(self, demonstrations: Sequence[Demonstration]) -> Self:
        """Discovers the states in all demonstrations, and learns the actions of the good ones.

        Raises:
            ValueError: if no demonstration is good: there is nothing to imitate.
        """
        if not any(d.good for d in demonstrations):
            outcomes = sorted({d.outcome for d in demonstrations})
            raise ValueError(
                f"none of the {len(demonstrations)} demonstrations inserts gently (outcomes: {outcomes});"
                " expected at least one good demonstration to learn from"
            )
        self.features_ = CanonicalFeatures()
        rng = np.random.default_rng(self.random_state)
        refined = [self._as_sensed(self._refined(d), rng) for d in demonstrations]
        self.period_ = float(np.median(np.concatenate([np.diff(d.samples["time"]) for d in demonstrations])))

        Z = np.vstack([self.features_.transform_demonstration(r) for r in refined])
        lengths = [len(r) for r in refined]
        groups = np.repeat(np.arange(len(refined)), lengths)
        phase = np.concatenate([np.linspace(0.0, 1.0, n, endpoint=False) for n in lengths])
        self.states_ = CompetitiveAgglomeration(random_state=self.random_state).fit(
            Z, groups=groups, phase=phase
        )
        labels = self.states_.predict(Z)
        self.graph_ = StateGraph(n_states=self.n_states, sample_period=self.period_).fit(
            [labels[groups == g] for g in range(len(refined))],
            ["inserted" if d.good else d.outcome for d in demonstrations],
            times=[r["time"] for r in refined],
        )

        good = np.repeat([d.good for d in demonstrations], lengths)
        samples = pd.concat(refined, ignore_index=True)[good]
        measured = samples[list(MEASURED)].to_numpy()
        X = self.features_.transform(measured)
        Y = self.features_.actions_to_frame(measured, samples[["rx", "ry", "uz"]].to_numpy())
        self.regressor_ = LWRegressor(
            bandwidth=self.bandwidth, ridge=self.ridge, degree=self.degree, feature_scale="standard"
        ).fit(X, Y, memberships=self._memberships(X))
        self.sources_ = np.column_stack([groups[good], samples["time"].to_numpy()])
        self.metadata_ = {"demonstrations": len(refined), "good": int(sum(d.good for d in demonstrations))}
        return self

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

    def _memberships(self, X: Array) -> Array:
        """Probabilities of the states from measured features alone: the hidden ones are marginalised."""
        return self.states_.predict_proba(X, channels=np.arange(X.shape[1]))

    def state_filter(self) -> ContactStateFilter:
        """The on-line estimator of the states, over the measured features."""
        k = len(self.features_.get_feature_names_out())
        return ContactStateFilter(
            self.states_, transitions=self.graph_.transition_matrix(), channels=np.arange(k)
        )

    def measured_features(self, measured: ArrayLike) -> Array:
        """Features (k,) of one measurement (7,): fx fy fz (N) mx my mz (N m) z (m)."""
        return self.features_.transform(np.asarray(measured, dtype=float).reshape(1, -1))[0]

    def state_probabilities(self, measured: ArrayLike) -> Array:
        """Of each state, (n, K), from measurements (n, 7): fx fy fz mx my mz z."""
        return self._memberships(self.features_.transform(measured))

    def act(self, measured: ArrayLike, probabilities: ArrayLike | None = None) -> Action:
        """The action for one measurement.

        Args:
            measured: (7,) fx fy fz (N) mx my mz (N m) z (m).
            probabilities: (K,) of the states, as an estimator has filtered them; by default those of this
                measurement alone.
        """
        row = np.asarray(measured, dtype=float).reshape(1, -1)
        X = self.features_.transform(row)
        P = self._memberships(X) if probabilities is None else np.asarray(probabilities, float).reshape(1, -1)
        local = self.features_.actions_from_frame(row, self.regressor_.predict(X, memberships=P))[0]
        return Action(turn=local[:2], feed=float(local[2]), probabilities=P[0])

    def explain(
        self, measured: ArrayLike, probabilities: ArrayLike | None = None, level: float = 0.95
    ) -> SkillExplanation:
        """Why `act` does what it does for one measurement; arguments as for `act`."""
        row = np.asarray(measured, dtype=float).reshape(1, -1)
        action = self.act(measured, probabilities)
        local = self.regressor_.explain(self.measured_features(measured), action.probabilities, level)
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
        return [f"state {k}" for k in range(self.n_states)]

    # ------------------------------------------------------------------- saving

    def save(self, path: Path) -> None:
        """One npz file: named arrays and a JSON header; no pickle."""
        parameters = {
            k: getattr(self, k)
            for k in (
                "still",
                "rough",
                "force_noise",
                "moment_noise",
                "bandwidth",
                "ridge",
                "degree",
                "random_state",
            )
        }
        header = {
            "skill_version": SKILL_VERSION,
            "parameters": parameters,
            "period": self.period_,
            **{"metadata": self.metadata_},
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
        except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
            raise ValueError(f"{path}: not a skill file of this program ({error})") from error
        if header.get("skill_version") != SKILL_VERSION:
            raise ValueError(
                f"{path}: skill file version {header.get('skill_version')}, expected {SKILL_VERSION};"
                " train the skill again"
            )
        skill = cls(**header["parameters"])
        parts: dict[str, dict[str, Any]] = {"states": {}, "regressor": {}, "graph": {}}
        try:
            skill.sources_ = arrays.pop("sources")
            for name, array in arrays.items():
                part, key = name.split("/", 1)
                parts[part][key] = array
            skill.features_ = CanonicalFeatures()
            skill.states_ = CompetitiveAgglomeration.from_arrays(parts["states"])
            skill.regressor_ = LWRegressor.from_arrays(parts["regressor"])
            skill.graph_ = StateGraph.from_arrays(parts["graph"])
        except (KeyError, ValueError) as error:
            raise ValueError(f"{path}: not a complete skill file ({error})") from error
        skill.period_, skill.metadata_ = header["period"], header["metadata"]
        return skill
