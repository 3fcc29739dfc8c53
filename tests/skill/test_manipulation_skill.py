import math
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.transform import Rotation
from sklearn.linear_model import LinearRegression

from skill.clustering.competitive_agglomeration import CompetitiveAgglomeration
from skill.data.demonstration import ACTIONS, read_demonstrations, write_demonstration
from skill.data.refinement import INTENDED, intended_actions, refine_demonstration
from skill.features.contact_features import ContactFeatures
from skill.features.measurement import MEASURED
from skill.features.wrench_features import CanonicalFeatures, RawFeatures
from skill.manipulation_skill import ManipulationSkill
from skill.policy.imitation import quartiles_of
from skill.regression.locally_weighted_regression import LWRegressor, local_prediction
from skill.regression.protocols import ExplainableRegressor, StateRegressor
from skill.states.contact_state_filter import ContactStateFilter
from skill.states.estimate import Estimate
from tests.skill.acting import acted
from tests.trajectories import GEOMETRY, make_demonstration


def made_up_demonstrations(number=6):
    """Synthetic trajectories with different tilts and directions."""
    rng = np.random.default_rng(0)
    tilts, directions = np.radians(rng.uniform(1.5, 4.0, number)), rng.uniform(-3.0, 3.0, number)
    return [make_demonstration(tilt=t, direction=d) for t, d in zip(tilts, directions, strict=True)]


@pytest.fixture(scope="module")
def made_up_skill():
    """Four states from synthetic trajectories; no cross-validation, hence quick to fit."""
    return ManipulationSkill(regressor=LWRegressor(ridge=1.0, feature_scale=None)).fit(made_up_demonstrations())


def single_state():
    """Parts that are quick to fit: one state, and features that only scale the measurements."""
    return {
        "features": RawFeatures(),
        "states": CompetitiveAgglomeration(m_init=1),
        "regressor": LWRegressor(feature_scale=None),
    }


def measurements(demonstration):
    return demonstration.samples[list(MEASURED)].to_numpy()


# --------------------------------------------------------------------- acts


def test_a_contact_turned_about_the_axis_gets_the_turned_action(skill, rows):
    angle = 1.1
    c, s = np.cos(angle), np.sin(angle)
    R = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    for row in rows[np.linalg.norm(rows[:, :2], axis=1) > 1.0][:10]:
        turned = np.concatenate([R @ row[:3], R @ row[3:6], row[6:]])
        one, other = skill.act(row), skill.act(turned)
        np.testing.assert_allclose(other.turn, R[:2, :2] @ one.turn, atol=1e-9)
        assert other.feed == pytest.approx(one.feed, abs=1e-12)


def twisted(demonstration, start):
    """The same demonstration with a clocking stage: the peg untwists from an angle, under a moment of 0.5 N m/rad."""
    samples = demonstration.samples.copy()
    angle = np.linspace(start, 0.0, len(samples))
    R = Rotation.from_rotvec(samples[["ax", "ay", "az"]].to_numpy() * samples[["angle"]].to_numpy())
    R = R * Rotation.from_rotvec(angle[:, None] * [0.0, 0.0, 1.0])
    samples["angle"] = R.magnitude()
    samples[["ax", "ay", "az"]] = R.as_rotvec() / np.maximum(R.magnitude(), 1e-12)[:, None]
    samples.loc[samples["angle"] < 1e-9, ["ax", "ay", "az"]] = [0.0, 0.0, 1.0]
    samples.loc[1:, "dangle"] = (R[:-1].inv() * R[1:]).magnitude()
    samples["mz"] = -0.5 * angle
    return replace(demonstration, samples=samples, metadata={**demonstration.metadata, "clocking": True})


def test_a_skill_of_demonstrations_with_a_clocking_stage_turns_about_the_axis_too(made_up_skill, tmp_path):
    demonstrations = [twisted(d, (-1) ** n * 0.05) for n, d in enumerate(made_up_demonstrations())]
    turning = ManipulationSkill(regressor=LWRegressor(ridge=1.0, feature_scale=None)).fit(demonstrations)
    turning.save(tmp_path / "turning.npz")
    loaded = ManipulationSkill.load(tmp_path / "turning.npz")
    rows = measurements(demonstrations[0])
    rows = rows[np.abs(rows[:, 5]) > 5e-3][::10]
    found = [turning.act(row) for row in rows]
    assert all(
        action.spin * row[5] > 0.0 for action, row in zip(found, rows, strict=True)
    )  # with the moment on the peg
    assert [loaded.act(row).spin for row in rows] == [action.spin for action in found]
    c, s = np.cos(1.1), np.sin(1.1)
    R = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    for row, action in zip(rows, found, strict=True):
        turned = turning.act(np.concatenate([R @ row[:3], R @ row[3:6], row[6:]]))
        assert turned.spin == pytest.approx(action.spin, abs=1e-9)
    assert made_up_skill.act(rows[0]).spin == 0.0
    assert made_up_skill.metadata_["clocking"] is False


def test_the_learnt_turn_agrees_with_the_demonstrated_one_in_contact(skill, demonstrations):
    agree = []
    for d in demonstrations[:5]:
        samples = d.samples
        rows, done = samples[list(MEASURED)].to_numpy(), samples[["rx", "ry"]].shift(-1, fill_value=0.0).to_numpy()
        for row, turn in zip(rows, done, strict=True):
            if np.linalg.norm(row[:2]) > 2.0 and np.linalg.norm(turn) > 3e-4:
                agree.append(skill.act(row).turn @ turn > 0)
    assert len(agree) > 20
    assert np.mean(agree) > 0.85


def test_the_states_probabilities_are_those_of_single_measurements(skill, rows):
    np.testing.assert_allclose(
        skill.state_probabilities(rows), [skill.estimate_alone(row).states for row in rows], atol=1e-12
    )
    assert len(skill.state_names()) == len(set(skill.state_names())) == skill.n_states >= 2


def test_the_action_depends_on_the_state(made_up_skill):
    """The regressor is given the states: those of the caller, or those of the measurement."""
    differences = []
    for row in measurements(made_up_demonstrations()[0])[20:100:10]:
        X = made_up_skill.features_.transform(row[None])
        actions = [made_up_skill.act(row, Estimate(state)) for state in np.eye(made_up_skill.n_states)]
        for state, action in zip(np.eye(made_up_skill.n_states), actions, strict=True):
            local = made_up_skill.regressor_.predict(X, memberships=state[None])
            regressor = made_up_skill.regressor_
            _, near, weights, _ = local_prediction(regressor.numbers(), X[0] * regressor.feature_scale_, state)
            for k in range(2):
                local[0, k] = np.clip(local[0, k], *quartiles_of(regressor.y_[near, k], weights))
            expected = made_up_skill.features_.actions_from_frame(row[None], local)[0]
            np.testing.assert_allclose([*action.turn, action.feed], expected, rtol=1e-12)
        differences.append(np.ptp([a.feed for a in actions]) / np.abs([a.feed for a in actions]).max())
        own = made_up_skill.act(row)
        given = made_up_skill.act(row, made_up_skill.estimate_alone(row))
        assert (own.turn.tolist(), own.feed) == (given.turn.tolist(), given.feed)
    assert max(differences) > 0.1


# ------------------------------------------------------------------ explain


def test_an_explanation_adds_up_to_the_action(made_up_skill):
    row = measurements(made_up_demonstrations()[1])[60]
    explanation, action = made_up_skill.explain(row, level=0.8), made_up_skill.act(row)
    assert explanation.action.feed == action.feed
    np.testing.assert_array_equal(explanation.action.turn, action.turn)
    np.testing.assert_array_equal(explanation.query.P[0], made_up_skill.estimate_alone(row).states)
    assert explanation.frame_angle == made_up_skill.features_.rotation_angle(row[None])[0]
    used = explanation.neighbours
    sources = made_up_skill.sources_.tolist()
    indices = [sources.index([n, t]) for n, t in used[["demonstration", "time"]].to_numpy()]
    in_frame = used["influence"].to_numpy() @ made_up_skill.regressor_.y_[indices]
    local = made_up_skill.features_.actions_from_frame(row[None], in_frame[None])[0]
    np.testing.assert_allclose(local, [*action.turn, action.feed], rtol=1e-9)
    local, wider = explanation.local, made_up_skill.explain(row).local
    assert (local.lower < in_frame).all()
    assert (in_frame < local.upper).all()
    assert local.support == pytest.approx(used["weight"].sum())
    assert (local.level, wider.level) == (0.8, 0.95)
    assert (wider.lower < local.lower).all()


def test_a_regressor_without_explanations_is_named():
    parts = {**single_state(), "regressor": LinearRegression()}
    skill = ManipulationSkill(**parts).fit(made_up_demonstrations(2))
    with pytest.raises(TypeError, match=r"a LinearRegression cannot explain its predictions; expected .*LWRegressor"):
        skill.explain(np.zeros(7))


# --------------------------------------------------------- other regressors


class WrappedRegressor:
    """A regressor of another package, which offers the same methods as ours."""

    def __init__(self, inner=None):
        self.inner = inner or LWRegressor(ridge=1.0, feature_scale=None)

    def get_params(self, deep=False):
        return {}

    def fit(self, X, y, memberships):
        self.inner.fit(X, y, memberships)
        return self

    def predict(self, X):
        raise AssertionError("expected a prediction with states")

    def predict_with_support(self, X, memberships):
        return self.inner.predict_with_support(X, memberships)

    def support_between(self, groups):
        return self.inner.support_between(groups)

    def explain(self, x, membership, level):
        return self.inner.explain(x, membership, level)


def test_a_foreign_regressor_with_the_same_methods_acts_like_ours(made_up_skill):
    demonstrations = made_up_demonstrations()
    skill = ManipulationSkill(regressor=WrappedRegressor()).fit(demonstrations)
    assert isinstance(skill.regressor_, StateRegressor)
    assert isinstance(skill.regressor_, ExplainableRegressor)
    rows = measurements(demonstrations[0])[::25]
    assert acted(skill, rows) == acted(made_up_skill, rows)
    assert skill.min_log_support_ == made_up_skill.min_log_support_
    assert str(skill.explain(rows[2])) == str(made_up_skill.explain(rows[2]))


# --------------------------------------------------------------------- fit


@pytest.mark.slow
def test_fitting_again_gives_the_same_skill(demonstrations, skill, rows):
    again = ManipulationSkill().fit(demonstrations)
    assert acted(again, rows[::4]) == acted(skill, rows[::4])


def test_actions_are_learnt_from_good_demonstrations_only(skill, demonstrations):
    used = {int(n) for n in skill.sources_[:, 0]}
    assert used == {n for n, d in enumerate(demonstrations) if d.good}
    assert skill.metadata_["demonstrations"] == len(demonstrations)
    assert skill.metadata_["good"] == sum(d.good for d in demonstrations)
    assert skill.period_ == pytest.approx(0.02)


def test_the_samples_of_a_skill_know_their_demonstration_and_time():
    one, bad, two = made_up_demonstrations(3)
    parts = {**single_state(), "still": 0.0, "rough": math.inf}
    skill = ManipulationSkill(**parts).fit([one, replace(bad, good=False, outcome="jammed"), two])
    number, time = skill.sources_.T
    assert set(number) == {0, 2}
    for n, demonstration in ((0, one), (2, two)):
        assert set(time[number == n]) <= set(demonstration.samples["time"])
    assert (np.diff(time[number == 0]) > 0).all()


def test_states_are_discovered_in_all_demonstrations_and_the_graph_counts_their_outcomes():
    one, bad, rough = made_up_demonstrations(3)
    bad, rough = replace(bad, good=False, outcome="jammed"), replace(rough, outcome="inserted roughly")
    skill = ManipulationSkill(**single_state()).fit([one, bad, rough])
    assert dict(zip(skill.graph_.outcomes_, skill.graph_.exits_[0], strict=True)) == {"inserted": 2, "jammed": 1}
    assert skill.graph_.sample_period == pytest.approx(0.02)


class RecordedArguments(CompetitiveAgglomeration):
    """Stores what it is fitted to."""

    def fit(self, X, y=None, *, groups=None, phase=None):
        self.given_ = X, groups, phase
        return super().fit(X, y, groups=groups, phase=phase)


def test_the_states_are_fitted_to_all_samples_with_their_demonstration_and_phase():
    demonstrations = made_up_demonstrations(3)
    demonstrations[1] = replace(demonstrations[1], good=False, outcome="jammed")
    parts = {**single_state(), "states": RecordedArguments(m_init=1)}
    skill = ManipulationSkill(**parts).fit(demonstrations)
    rng = np.random.default_rng(0)
    refined = [skill.with_noise(skill.refined(d), rng) for d in demonstrations]
    Z, groups, phase = skill.states_.given_
    np.testing.assert_array_equal(Z, np.vstack([skill.state_features_.transform_demonstration(r) for r in refined]))
    np.testing.assert_array_equal(groups, [n for n, r in enumerate(refined) for _ in range(len(r))])
    np.testing.assert_allclose(phase, [k / len(r) for r in refined for k in range(len(r))], rtol=1e-12)


def test_a_measurement_is_paired_with_the_intended_action_that_follows_it():
    """A row of a demonstration holds the motion since the previous row. The tilt of the peg decreases about one axis,
    so that the turn that remains is the tilt minus that at the end."""
    demonstration = made_up_demonstrations(1)[0]
    skill = ManipulationSkill(**single_state(), still=0.0, rough=math.inf, force_noise=0.0, moment_noise=0.0)
    skill.correction_time, skill.feed_time = 0.25, 0.02
    skill.fit([demonstration])
    samples = demonstration.samples
    axis, angle = samples[["ax", "ay"]].to_numpy(), samples["angle"].to_numpy()
    turns = (angle[-1] - angle)[:, None] * axis * 0.02 / 0.25
    actions = np.column_stack([turns[:-1], samples["uz"].to_numpy()[1:]])
    moving = np.abs(samples[list(ACTIONS)].to_numpy()[1:]).max(axis=1) > 0.0  # rows without motion are removed
    assert moving.sum() > 50
    np.testing.assert_allclose(skill.regressor_.y_, actions[moving], rtol=1e-9, atol=1e-15)
    np.testing.assert_array_equal(skill.sources_[:, 1], samples["time"].to_numpy()[:-1][moving])
    np.testing.assert_array_equal(skill.regressor_.X_, RawFeatures().transform(samples)[:-1][moving])


def test_demonstrations_are_refined():
    demonstration = made_up_demonstrations(1)[0]
    noise = {"force_noise": 0.0, "moment_noise": 0.0}
    skill = ManipulationSkill(**single_state(), still=1.4e-4, rough=3e-4, **noise).fit([demonstration])
    samples = demonstration.samples.copy()
    samples[list(ACTIONS)] = samples[list(ACTIONS)].shift(-1, fill_value=0.0)
    samples[list(INTENDED)] = intended_actions(samples, correction_time=0.4, feed_time=0.1)
    refined = refine_demonstration(samples, still=1.4e-4, rough=3e-4)
    assert len(refined) < len(samples) - 5
    assert not refined["uz"].isin(refine_demonstration(samples, still=1.4e-4, rough=math.inf)["uz"]).all()  # smoothed
    np.testing.assert_array_equal(skill.regressor_.y_, refined[list(INTENDED[:3])])
    np.testing.assert_array_equal(skill.regressor_.X_, RawFeatures().transform(refined))
    span = refined["time"].iloc[-1] - refined["time"].iloc[0]  # the time of removed samples counts
    assert skill.graph_.dwell_mean_s_[0] == pytest.approx(span, abs=0.05)
    assert span > 0.02 * len(refined) + 0.1


def test_the_noise_of_the_sensor_is_added_to_the_demonstrations():
    demonstrations = made_up_demonstrations(2)
    clean, noisy = (
        ManipulationSkill(**single_state(), force_noise=f, moment_noise=m, random_state=5).fit(demonstrations)
        for f, m in ((0.0, 0.0), (0.3, 0.002))
    )
    change = (noisy.regressor_.X_ - clean.regressor_.X_) * [10, 10, 10, 0.1, 0.1, 0.1, 1]
    draws = np.random.default_rng(5).standard_normal((len(change), 6))  # one demonstration after the other
    np.testing.assert_allclose(change[:, :6], draws * np.repeat([0.3, 0.002], 3), atol=1e-12)
    np.testing.assert_array_equal(change[:, 6], 0.0)


def test_the_covariance_of_a_state_has_a_floor_of_five_percent_of_the_variance(made_up_skill):
    """F_k = sum_i p_ik (z_i - v_k)(z_i - v_k)' / sum_i p_ik + 0.05 var, where the prior does not matter."""
    rng = np.random.default_rng(0)
    refined = [made_up_skill.with_noise(made_up_skill.refined(d), rng) for d in made_up_demonstrations()]
    Z = np.vstack([made_up_skill.state_features_.transform_demonstration(r) for r in refined])
    P, variance = made_up_skill.states_.predict_proba(Z), Z.var(axis=0)
    largest = int(P.sum(axis=0).argmax())
    p = P[:, largest] / P[:, largest].sum()
    scatter = p @ (Z - p @ Z) ** 2
    floor = (np.diag(made_up_skill.states_.covariances_[largest]) - scatter) / variance
    np.testing.assert_allclose(floor, 0.05, rtol=0.2)
    shares = np.array([np.diag(F) / variance for F in made_up_skill.states_.covariances_])
    assert 0.05 <= shares.min() < 0.1


def test_the_feature_scale_is_selected_if_five_demonstrations_are_good(skill):
    """With fewer, the features are standardised."""
    assert not isinstance(skill.regressor_.feature_scale, str)
    states = CompetitiveAgglomeration(m_init=1)
    few = ManipulationSkill(states=states, force_noise=0.0, moment_noise=0.0).fit(made_up_demonstrations(4))
    assert few.regressor_.feature_scale == "standard"
    assert few.regressor_.ridge == 1.0
    spread = (few.regressor_.X_ / few.regressor_.feature_scale_).std(axis=0)
    np.testing.assert_allclose(few.regressor_.feature_scale_[spread > 0], 1.0 / spread[spread > 0])


def test_without_a_good_demonstration_there_is_nothing_to_learn(demonstrations):
    bad = [replace(d, good=False, outcome="jammed") for d in demonstrations[:2]] + [demonstrations[5]]
    with pytest.raises(ValueError, match=r"none of the 3 demonstrations.*jammed"):
        ManipulationSkill().fit(bad)


# ------------------------------------------------------------------ geometry


def with_geometry(demonstration, geometry):
    return replace(demonstration, metadata={"geometry": geometry} if geometry else {})


def test_the_contact_features_have_the_geometry_of_the_demonstrations():
    geometry = {**GEOMETRY, "peg_radius": 0.02, "hole_radius": 0.0203}
    demonstrations = [with_geometry(d, geometry) for d in made_up_demonstrations(2)]
    skill = ManipulationSkill(**single_state()).fit(demonstrations)
    assert skill.state_features_.peg_radius == 0.02
    assert skill.state_features_.play == pytest.approx(3e-4)
    assert skill.metadata_["geometry"] == {**geometry, "section": "round", "corners": [], "mates": []}
    own = ManipulationSkill(**single_state(), state_features=CanonicalFeatures(peg_radius=0.3)).fit(demonstrations)
    assert isinstance(own.state_features_, CanonicalFeatures)
    assert own.state_features_.peg_radius == 0.3


def test_demonstrations_without_a_geometry_get_the_default_features():
    skill = ManipulationSkill(**single_state()).fit([with_geometry(d, None) for d in made_up_demonstrations(2)])
    assert skill.state_features_.get_params() == ContactFeatures().get_params()
    assert skill.metadata_["geometry"] is None


def test_the_file_with_the_odd_geometry_is_named(tmp_path):
    for n, shown in enumerate(made_up_demonstrations(3)):
        odd = with_geometry(shown, {**GEOMETRY, "peg_radius": 0.00995}) if n == 0 else shown
        write_demonstration(odd, tmp_path / f"{n}.parquet")
    found = rf"{tmp_path}/0\.parquet: geometry\.peg_radius 0\.00995 m, not 0\.01 m in 2 of 3 demonstrations"
    message = rf"{found}, such as .*1\.parquet;"
    with pytest.raises(ValueError, match=message):
        ManipulationSkill(**single_state()).fit(read_demonstrations(tmp_path))


# ------------------------------------------------------- states and support


def test_the_estimator_uses_the_measured_features_and_the_moves_of_the_demonstrations(made_up_skill):
    dut = made_up_skill.estimator()
    row = measurements(made_up_demonstrations()[0])[0]
    reference = ContactStateFilter(made_up_skill.states_, made_up_skill.graph_.transition_matrix(), channels=[0, 1, 2])
    found = dut.step(dut.initial().memory, np.array([*row, 0.0, 0.0]))
    features = made_up_skill.state_features_.transform(row[None])[0]
    expected = reference.step(reference.initial_log_belief(), features)
    np.testing.assert_array_equal(found.states, expected.probabilities)
    assert found.known == expected.known
    assert found.state == made_up_skill.estimate_alone(row).state


def test_states_have_numbers_until_they_are_named(made_up_skill):
    assert made_up_skill.state_names() == ["state 0", "state 1", "state 2", "state 3"]
    with pytest.raises(ValueError, match="1 state names"):
        made_up_skill.name_states(["free"])
    made_up_skill.name_states(["a", "b", "c", "d"])
    assert made_up_skill.state_names() == ["a", "b", "c", "d"]
    made_up_skill.names_ = None


def test_one_demonstrated_sample_in_a_hundred_has_less_than_full_support(skill):
    regressor = skill.regressor_
    found = regressor.support_between(skill.sources_[regressor.rows_, 0])
    assert np.mean(found < skill.min_log_support_) == pytest.approx(0.01, abs=1.0 / len(found))


def test_support_is_the_kernel_weight_over_the_minimum_of_the_demonstrations(made_up_skill):
    row = measurements(made_up_demonstrations()[0])[60].copy()
    row[:6] += [3.0, -8.0, 5.0, 0.2, 0.1, 0.3]
    P = made_up_skill.state_probabilities(row[None])
    _, log_w = made_up_skill.regressor_.predict_with_support(made_up_skill.features_.transform(row[None]), P)
    assert log_w[0] < made_up_skill.min_log_support_
    expected = math.exp(log_w[0] - made_up_skill.min_log_support_)
    assert made_up_skill.act(row).support == pytest.approx(expected)


def test_a_single_good_demonstration_has_no_minimum_of_support():
    demonstration = made_up_demonstrations(1)[0]
    skill = ManipulationSkill(**single_state()).fit([demonstration])
    assert skill.min_log_support_ == -math.inf
    assert skill.act(measurements(demonstration)[50]).support == 1.0
    two = ManipulationSkill(**single_state()).fit(made_up_demonstrations(2))
    assert math.isfinite(two.min_log_support_)


def test_the_sample_period_is_the_median_step():
    demonstrations = made_up_demonstrations(3)
    slow = demonstrations[0].samples.assign(time=3.0 * demonstrations[0].samples["time"])
    skill = ManipulationSkill(**single_state()).fit([replace(demonstrations[0], samples=slow), *demonstrations[1:]])
    assert skill.period_ == pytest.approx(0.02)
    assert isinstance(skill.explain(np.zeros(7)).neighbours, pd.DataFrame)
