"""The manipulation skill: features, contact states, a regressor of the actions, and a state graph, in one object."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Self

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from sklearn.base import clone

from skill.arrays import Array
from skill.clustering.competitive_agglomeration import CompetitiveAgglomeration
from skill.data.demonstration import Demonstration
from skill.data.geometry import PegHoleGeometry, common_geometry
from skill.data.outcome import Outcome
from skill.data.refinement import INTENDED, intended_actions, refine_demonstration, with_following_actions
from skill.features.contact_features import ContactFeatures
from skill.features.measurement import MEASURED, observed_series
from skill.features.wrench_features import CanonicalFeatures, WrenchFeatures
from skill.policy.imitation import FEED, N_TURNS, SPIN, Imitation, lowest_log_support
from skill.policy.planner import Planner
from skill.policy.planning_model import VALUE_TIME, PlanningModel
from skill.policy.prediction import Prediction, Query, SkillExplanation
from skill.policy.rig_policy import Action
from skill.policy.transitions import Transitions, transitions
from skill.regression.feature_scale_selection import tuned_regressor
from skill.regression.locally_weighted_regression import LWRegressor
from skill.regression.protocols import Regressor
from skill.skill_file import POLICIES, read_skill_file, write_skill_file
from skill.states.contact_state_filter import ContactStateFilter
from skill.states.estimate import Estimate, StateEstimator
from skill.states.state_graph import StateGraph
from skill.states.state_style import state_labels

STATE_FLOOR = 0.05
"""Added to the covariances of the states, in units of the variance of each state feature. Contacts at different places
differ by more than its square root, 0.2 standard deviations. Without it, each long rest in one pose becomes a state."""

PLANNING = 2
"""Stream of the sensor noise in the samples of the planner; the other samples have the first."""


class ManipulationSkill:
    """A skill that is learnt from demonstrations and acts on a measured wrench and depth.

    Each part can be replaced by another one. A skill with foreign parts works, but only one with parts of this package
    can be saved.

    Args:
        features: transformer of the measurements for the regressor; None for `CanonicalFeatures` with the geometry of
            the demonstrations.
        state_features: transformer of the measurements for the contact states; None for `ContactFeatures` with the
            geometry of the demonstrations.
        states: clusterer of the contact states; None for `CompetitiveAgglomeration` with ``STATE_FLOOR``. With
            ``m_init=1`` it finds a single state.
        policy: "imitate", do what the good demonstrations do in the same situation, or "plan", do what leads to the
            desired next state (`skill.policy.planner`).
        regressor: regressor of the actions, with several outputs as in scikit-learn; None for `LWRegressor`. The
            latter is tuned by `tuned_regressor`, and is given the contact states.
        still: delta_s, m; see `refine_demonstration`.
        rough: delta_d, m; see `refine_demonstration`.
        correction_time: tau_c, s, and
        feed_time: tau_f, s; see `intended_actions`. The skill learns what the good demonstrations intend.
        force_noise: standard deviation of the forces of the sensor on the rig, N. The virtual environment measures the
            wrench exactly, so this noise is added to the demonstrations. Without it the free state, whose simulated
            forces are exactly zero, is never recognised on the rig.
        moment_noise: standard deviation of the moments about the tip, N m. For a sensor at a height above the tip it is
            about height times force noise.
        random_state: seed of the sensor noise and of the clustering.

    Attributes:
        features_, state_features_, states_, regressor_: the fitted parts. The outputs of the regressor are (turn_x,
            turn_y, feed) over one sample period that the good demonstrations intend, in the frame of the features;
            then turn_z, if all demonstrations were recorded with a clocking stage.
        graph_: `StateGraph` of the demonstrations.
        planning_: `PlanningModel`; None for the policy "imitate".
        period_: sample period, s.
        sources_: (n, 2), demonstration number and time (s) of each sample of the regressor.
        min_log_support_: logarithm of the kernel weight below which support is low; see `lowest_log_support`.
        names_: names of the states, or None.
        metadata_: numbers of demonstrations, and their geometry.
    """

    names_: list[str] | None
    metadata_: dict[str, Any]

    def __init__(
        self,
        *,
        features: WrenchFeatures | None = None,
        state_features: WrenchFeatures | None = None,
        states: CompetitiveAgglomeration | None = None,
        policy: str = "imitate",
        regressor: Regressor | None = None,
        still: float = 2e-5,
        rough: float = 4e-4,
        correction_time: float = 0.4,
        feed_time: float = 0.1,
        force_noise: float = 0.06,
        moment_noise: float = 5e-3,
        random_state: int = 0,
    ) -> None:
        self.features = features
        self.state_features = state_features
        self.states = states
        self.policy = policy
        self.regressor = regressor
        self.still = still
        self.rough = rough
        self.correction_time = correction_time
        self.feed_time = feed_time
        self.force_noise = force_noise
        self.moment_noise = moment_noise
        self.random_state = random_state

    # ----------------------------------------------------------------- learning

    def fit(self, demonstrations: Sequence[Demonstration]) -> Self:
        """Discovers the states in all demonstrations, and learns the actions of the good ones.

        Raises:
            TypeError: if the regressor has no neighbours to plan with.
            ValueError: if no demonstration is good, their geometries differ, or ``policy`` is unknown.
        """
        if self.policy not in POLICIES:
            raise ValueError(f"policy {self.policy!r}; expected one of {list(POLICIES)}")
        if not any(d.good for d in demonstrations):
            outcomes = sorted({d.reason for d in demonstrations})
            raise ValueError(
                f"none of the {len(demonstrations)} demonstrations is good (outcomes: {outcomes});"
                " expected at least one good demonstration to learn from"
            )
        geometry = common_geometry(
            [(d.source or f"demonstration {n}", d.metadata) for n, d in enumerate(demonstrations)]
        )
        self.features_ = CanonicalFeatures.of(geometry) if self.features is None else clone(self.features)
        self.state_features_ = (
            ContactFeatures.of(geometry) if self.state_features is None else clone(self.state_features)
        )
        rng = np.random.default_rng(self.random_state)
        refined = [self.with_noise(self.refined(demonstration), rng) for demonstration in demonstrations]
        self.period_ = float(np.median(np.concatenate([np.diff(d.samples["time"]) for d in demonstrations])))
        self.names_ = None
        self._fit_states(demonstrations, refined)
        self.metadata_ = {
            "demonstrations": len(refined),
            "good": int(sum(d.good for d in demonstrations)),
            "geometry": None if geometry is None else geometry.record(),
            "clocking": all(bool(d.metadata.get("clocking")) for d in demonstrations),
        }
        self._fit_actions(demonstrations, refined)
        self.planning_ = self._planning_model(demonstrations) if self.policy == "plan" else None
        return self

    def _fit_states(self, demonstrations: Sequence[Demonstration], refined: Sequence[pd.DataFrame]) -> None:
        """Fits the states and their graph to the refined samples of all demonstrations."""
        Z = np.vstack([self.state_features_.transform_demonstration(r) for r in refined])
        lengths = [len(r) for r in refined]
        groups = np.repeat(np.arange(len(refined)), lengths)
        phase = np.concatenate([np.linspace(0.0, 1.0, n, endpoint=False) for n in lengths])
        if self.states is None:
            states = CompetitiveAgglomeration(reg_covar=STATE_FLOOR, random_state=self.random_state)
        else:
            states = clone(self.states)
        self.states_ = states.fit(Z, groups=groups, phase=phase)
        labels = self.states_.predict(Z)
        self.graph_ = StateGraph(n_states=self.n_states, sample_period=self.period_).fit(
            [labels[groups == g] for g in range(len(refined))],
            [str(Outcome.INSERTED) if d.good else d.reason for d in demonstrations],
            times=[r["time"] for r in refined],
        )

    def _fit_actions(self, demonstrations: Sequence[Demonstration], refined: Sequence[pd.DataFrame]) -> None:
        """Fits the regressor to the refined samples of the good demonstrations."""
        numbers = [n for n, d in enumerate(demonstrations) if d.good]
        groups = np.repeat(numbers, [len(refined[n]) for n in numbers])
        samples = pd.concat([refined[n] for n in numbers], ignore_index=True)
        measured = samples[list(MEASURED)].to_numpy()
        X = self.features_.transform(measured)
        outputs = INTENDED if self.metadata_["clocking"] else INTENDED[:SPIN]
        Y = self.features_.actions_to_frame(measured, samples[list(outputs)].to_numpy())
        P = self.state_probabilities(measured)
        self.sources_ = np.column_stack([groups, samples["time"].to_numpy()])
        if self.regressor is None:
            self.regressor_ = tuned_regressor(X, Y, groups, memberships=P, random_state=self.random_state)
        else:
            self.regressor_ = clone(self.regressor)
        if isinstance(self.regressor_, LWRegressor):
            self.regressor_.fit(X, Y, memberships=P)
        else:
            self.regressor_.fit(X, Y)
        self.min_log_support_ = lowest_log_support(self.regressor_, self.sources_[:, 0])

    def _planning_model(self, demonstrations: Sequence[Demonstration]) -> PlanningModel:
        """Learns what the policy "plan" needs from all demonstrations."""
        if not isinstance(self.regressor_, LWRegressor):
            raise TypeError(f"a {type(self.regressor_).__name__} has no neighbours; expected one such as LWRegressor")
        rng = np.random.default_rng(None if self.random_state is None else [self.random_state, PLANNING])
        parts = []
        for demonstration in demonstrations:
            samples = self.with_noise(demonstration.samples, rng)
            labels = self.states_.predict(self.state_features_.transform_demonstration(samples))
            parts.append(
                transitions(
                    observed_series(samples),
                    labels,
                    good=demonstration.good,
                    n_states=self.n_states,
                    features=self.features_,
                    peg_radius=self._peg_radius(),
                    period=self.period_,
                )
            )
        rows = Transitions.joined(parts)
        return PlanningModel.learnt(
            rows,
            features=self.features_.transform(rows.measured),
            memberships=self.state_probabilities(rows.measured),
            values=self.graph_.values(VALUE_TIME),
        )

    def refined(self, demonstration: Demonstration) -> pd.DataFrame:
        """Refined samples; each row holds a measurement, the action that follows it, and the intended one."""
        samples = with_following_actions(demonstration.samples)
        times = {"correction_time": self.correction_time, "feed_time": self.feed_time}
        samples[list(INTENDED)] = intended_actions(samples, **times)
        return refine_demonstration(samples, still=self.still, rough=self.rough)

    def with_noise(self, samples: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
        """A copy of samples with the noise of the sensor on the rig."""
        noisy = samples.copy()
        sigma = np.repeat([self.force_noise, self.moment_noise], 3)
        noisy[list(MEASURED[:6])] += sigma * rng.standard_normal((len(samples), 6))
        return noisy

    # ------------------------------------------------------------------- acting

    def estimator(self) -> StateEstimator:
        """The on-line estimator of contact states, over the measured state features."""
        contacts = ContactStateFilter(self.states_, self.graph_.transition_matrix(), channels=self._measured_channels())
        return StateEstimator(contacts, self.state_features_)

    def estimate_alone(self, measured: ArrayLike) -> Estimate:
        """The estimate from one measurement (7,) alone."""
        return Estimate(self.state_probabilities(_row(measured))[0])

    def _peg_radius(self) -> float:
        """The lever of the moments in the loads of a plan, m."""
        return ContactFeatures.of(PegHoleGeometry.find(self.metadata_, "the skill")).peg_radius

    def _measured_channels(self) -> NDArray[np.intp]:
        """Indices of the state features that the rig can measure; the hidden ones follow them."""
        return np.arange(len(self.state_features_.names))

    def state_probabilities(self, measured: ArrayLike) -> Array:
        """Probabilities of the states (n, K) from measurements (n, 7) alone, without the hidden features."""
        return self.states_.predict_proba(self.state_features_.transform(measured), channels=self._measured_channels())

    def act(self, measured: ArrayLike, estimate: Estimate | None = None) -> Action:
        """Returns the action for one measurement.

        Args:
            measured: (7,), fx fy fz (N) mx my mz (N m) z (m).
            estimate: of the estimator; None for `estimate_alone`.

        Raises:
            ValueError: if the shape is wrong or a number is not finite.
        """
        query = self._query(measured, estimate)
        return self._action(query, self._predictor().predict(query))

    def _query(self, measured: ArrayLike, estimate: Estimate | None) -> Query:
        """The query of one measurement; arguments as for `act`."""
        row = _row(measured)
        X = self.features_.transform(row)
        found = self.estimate_alone(measured) if estimate is None else estimate
        return Query(row, X, _row(found.states))

    def _action(self, query: Query, prediction: Prediction) -> Action:
        local = self.features_.actions_from_frame(query.row, prediction.action[None])[0]
        spin = float(local[SPIN]) if len(local) > SPIN else 0.0
        return Action(local[:N_TURNS], float(local[FEED]), prediction.support, spin)

    def _predictor(self) -> Imitation | Planner:
        if self.planning_ is None:
            return self.imitation()
        return Planner(self.planning_, self.imitation(), self.features_, self._peg_radius(), self.period_)

    def imitation(self) -> Imitation:
        """Returns what predicts the actions from the features."""
        return Imitation(self.regressor_, self.sources_, self.min_log_support_)

    def explain(self, measured: ArrayLike, estimate: Estimate | None = None, level: float = 0.95) -> SkillExplanation:
        """Explains the action of `act` for one measurement.

        Args:
            measured: (7,), as for `act`.
            estimate: as for `act`.
            level: nominal coverage of the prediction interval.

        Raises:
            TypeError: if the regressor cannot explain its predictions.
            ValueError: as for `act`.
        """
        if not isinstance(self.regressor_, LWRegressor):
            raise TypeError(
                f"a {type(self.regressor_).__name__} cannot explain its predictions; expected an LWRegressor"
            )
        query = self._query(measured, estimate)
        prediction = self._predictor().predict(query)
        local = self.regressor_.explain(query.X[0], query.P[0], level)
        angle = float(self.features_.rotation_angle(query.row)[0])
        action = self._action(query, prediction)
        return SkillExplanation(query, prediction, action, local, self.sources_, self.state_names(), angle)

    @property
    def n_states(self) -> int:
        """Number of contact states, K."""
        return int(self.states_.n_clusters_)

    def state_names(self) -> list[str]:
        """Names of the K contact states."""
        return state_labels(self.n_states, self.names_)

    def name_states(self, names: Sequence[str]) -> None:
        """Sets the names (K,) of the states."""
        self.names_ = state_labels(self.n_states, names)

    # ------------------------------------------------------------------- saving

    def save(self, path: Path) -> None:
        """Writes one npz file with named arrays and a JSON header, without pickle.

        Raises:
            TypeError: if a part is not of a type that can be stored.
        """
        write_skill_file(path, self)

    @classmethod
    def load(cls, path: Path) -> Self:
        """Reads a file of `save`; the loaded skill acts bit-identically.

        Raises:
            ValueError: if the file is missing, damaged, not a skill file, or of another version.
        """
        parameters, attributes = read_skill_file(Path(path))
        skill = cls(**parameters)
        vars(skill).update(attributes)
        return skill


def _row(values: ArrayLike) -> Array:
    """One vector as a matrix with one row."""
    return np.asarray(values, dtype=float).reshape(1, -1)
