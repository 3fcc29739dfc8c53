import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from sklearn.linear_model import LinearRegression

from skill.clustering.competitive_agglomeration import CompetitiveAgglomeration
from skill.data.demonstration import ACTIONS
from skill.data.refinement import INTENDED, intended_actions, refine_demonstration
from skill.features.contact_features import ContactFeatures
from skill.features.measurement import MEASURED
from skill.features.wrench_features import RawFeatures
from skill.manipulation_skill import ManipulationSkill
from skill.regression.locally_weighted_regression import LWRegressor
from skill.states.contact_state_filter import ContactStateFilter
from skill.states.estimate import Estimate
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
    rows = rows[(np.abs(rows[:, 5]) > 5e-3) & (np.hypot(rows[:, 0], rows[:, 1]) > 1.0)][::10]
    found = [turning.act(row) for row in rows]
    assert all(a.spin * row[5] > 0.0 for a, row in zip(found, rows, strict=True))  # with the moment on the peg
    assert [loaded.act(row).spin for row in rows] == [action.spin for action in found]
    c, s = np.cos(1.1), np.sin(1.1)
    R = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    for row, action in zip(rows, found, strict=True):
        turned = turning.act(np.concatenate([R @ row[:3], R @ row[3:6], row[6:]]))
        np.testing.assert_allclose(turned.turn, R[:2, :2] @ action.turn, atol=1e-9)
        np.testing.assert_allclose([turned.feed, turned.spin], [action.feed, action.spin], atol=1e-9)
    assert made_up_skill.act(rows[0]).spin == 0.0
    assert made_up_skill.metadata_["clocking"] is False


def test_the_states_probabilities_are_those_of_single_measurements(skill, rows):
    np.testing.assert_allclose(
        skill.state_probabilities(rows), [skill.estimate_alone(row).states for row in rows], atol=1e-12
    )
    assert len(skill.state_names()) == len(set(skill.state_names())) == skill.n_states >= 2


def test_the_action_depends_on_the_state(made_up_skill):
    """The regressor is given the states: those of the caller, or those of the measurement."""
    rows, states = measurements(made_up_demonstrations()[0])[20:100:10], np.eye(made_up_skill.n_states)
    feeds = np.array([[made_up_skill.act(row, Estimate(state)).feed for state in states] for row in rows])
    assert (np.ptp(feeds, axis=1) / np.abs(feeds).max(axis=1)).max() > 0.1
    own = [made_up_skill.act(row).feed for row in rows]
    assert own == [made_up_skill.act(row, made_up_skill.estimate_alone(row)).feed for row in rows]


# ------------------------------------------------------------------ explain


def test_an_explanation_adds_up_to_the_action(made_up_skill):
    row = measurements(made_up_demonstrations()[1])[60]
    explanation, action = made_up_skill.explain(row, level=0.8), made_up_skill.act(row)
    np.testing.assert_array_equal(explanation.action.turn, action.turn)
    np.testing.assert_array_equal(explanation.query.P[0], made_up_skill.estimate_alone(row).states)
    assert explanation.frame_angle == made_up_skill.features_.rotation_angle(row[None])[0]
    used = explanation.neighbours
    sources = made_up_skill.sources_.tolist()
    indices = [sources.index([n, t]) for n, t in used[["demonstration", "time"]].to_numpy()]
    in_frame = used["influence"].to_numpy() @ made_up_skill.regressor_.y_[indices]
    local = made_up_skill.features_.actions_from_frame(row[None], in_frame[None])[0]
    np.testing.assert_allclose(local, [*action.turn, action.feed], rtol=1e-9)
    assert (explanation.local.level, made_up_skill.explain(row).local.level) == (0.8, 0.95)


def test_a_regressor_without_explanations_is_named():
    parts = {**single_state(), "regressor": LinearRegression()}
    skill = ManipulationSkill(**parts).fit(made_up_demonstrations(2))
    with pytest.raises(TypeError, match=r"a LinearRegression cannot explain its predictions; expected an LWRegressor"):
        skill.explain(np.zeros(7))


# --------------------------------------------------------------------- fit


def test_actions_are_learnt_from_good_demonstrations_and_states_from_all():
    one, bad, rough = made_up_demonstrations(3)
    bad, rough = replace(bad, good=False, outcome="jammed"), replace(rough, outcome="inserted roughly")
    skill = ManipulationSkill(**single_state(), still=0.0, rough=math.inf).fit([one, bad, rough])
    number, time = skill.sources_.T
    assert set(number) == {0, 2}
    for n, demonstration in ((0, one), (2, rough)):
        assert set(time[number == n]) <= set(demonstration.samples["time"])
    assert (skill.metadata_["demonstrations"], skill.metadata_["good"]) == (3, 2)
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
    np.testing.assert_array_equal(skill.regressor_.y_, refined[list(INTENDED[:3])])
    np.testing.assert_array_equal(skill.regressor_.X_, RawFeatures().transform(refined))
    span = refined["time"].iloc[-1] - refined["time"].iloc[0]  # the time of removed samples counts
    assert skill.graph_.dwell_mean_s_[0] == pytest.approx(span, abs=0.05)


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


def test_the_feature_scale_is_selected_if_five_demonstrations_are_good(skill):
    """With fewer, the features are standardised."""
    assert not isinstance(skill.regressor_.feature_scale, str)
    few = ManipulationSkill(force_noise=0.0, moment_noise=0.0).fit(made_up_demonstrations(4))
    assert few.regressor_.feature_scale == "standard"
    assert few.states_.reg_covar == 0.05
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
    odd = replace(demonstrations[0], source="a.parquet", metadata={"geometry": GEOMETRY})
    message = (
        r"^a\.parquet: geometry\.peg_radius 0\.01 m, not 0\.02 m in 2 of 3 demonstrations, such as demonstration 0"
    )
    with pytest.raises(ValueError, match=message):
        ManipulationSkill(**single_state()).fit([*demonstrations, odd])


def test_demonstrations_without_a_geometry_get_the_default_features():
    skill = ManipulationSkill(**single_state()).fit([with_geometry(d, None) for d in made_up_demonstrations(2)])
    assert skill.state_features_.get_params() == ContactFeatures().get_params()
    assert skill.metadata_["geometry"] is None


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


def test_the_sample_period_is_the_median_step():
    demonstrations = made_up_demonstrations(3)
    slow = demonstrations[0].samples.assign(time=3.0 * demonstrations[0].samples["time"])
    skill = ManipulationSkill(**single_state()).fit([replace(demonstrations[0], samples=slow), *demonstrations[1:]])
    assert skill.period_ == pytest.approx(0.02)
