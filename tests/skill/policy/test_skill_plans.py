"""A skill that plans: learnt, explained, stored."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize
from sklearn.linear_model import LinearRegression

from skill.clustering.competitive_agglomeration import CompetitiveAgglomeration
from skill.data.geometry import PegHoleGeometry
from skill.features.contact_features import ContactFeatures
from skill.features.measurement import MEASURED
from skill.manipulation_skill import ManipulationSkill
from skill.policy import planner
from skill.policy.planning_model import VALUE_TIME
from skill.policy.transitions import loads_of
from skill.regression.locally_weighted_regression import LWRegressor
from tests.crafted_files import sealed_arrays
from tests.trajectories import make_demonstration


def hinged_demonstrations(number=8):
    """Demonstrations whose lateral force grows, and answers to turns about y by 800 N/rad; the turns are noise."""
    rng = np.random.default_rng(3)
    demonstrations = []
    for _ in range(number):
        made = make_demonstration(tilt=math.radians(2.0), direction=0.0)
        samples = made.samples.copy()
        shallow = np.minimum(np.arange(len(samples)) / len(samples), 0.6) * 0.012
        samples["z"] = -shallow - np.where(np.arange(len(samples)) > 0.9 * len(samples), 0.0155, 0.0)
        turns = np.cumsum(rng.normal(0.0, 2e-3, len(samples)))
        samples["ry"] = np.diff(turns, prepend=0.0)
        samples["fx"] = 6.0 + 800.0 * turns + 0.1 * np.arange(len(samples)) + rng.normal(0.0, 0.1, len(samples))
        samples["fy"] = rng.normal(0.0, 0.05, len(samples))
        demonstrations.append(replace(made, samples=samples))
    return demonstrations


@pytest.fixture(scope="module")
def demonstrations():
    return hinged_demonstrations()


@pytest.fixture(scope="module")
def planning(demonstrations):
    return ManipulationSkill(policy="plan", regressor=LWRegressor(ridge=1.0, feature_scale=None)).fit(demonstrations)


@pytest.fixture(scope="module")
def rows(demonstrations):
    return np.vstack([d.samples[list(MEASURED)].to_numpy()[10::9] for d in demonstrations])


def pushed(force=7.0, depth=0.004):
    """A measurement like those of the demonstrations."""
    return np.array([force, 0.0, 0.0, 0.0, 0.0, 0.0, -depth])


def test_a_planned_action_differs_from_the_imitated_one_by_the_plan_alone(planning, monkeypatch):
    row = pushed()
    imitated = planning.imitation().predict(planning._query(row, None))
    assert planning.explain(row).prediction.plan is not None
    assert imitated.plan is None
    monkeypatch.setattr(planner, "LOAD_TOLERANCE", 1e9)
    monkeypatch.setattr(planner, "BOUND_TOLERANCE", 1e9)
    np.testing.assert_allclose(planning.act(row).turn, imitated.action[:2], atol=1e-9)
    assert planning.act(row).support == imitated.support


@pytest.mark.parametrize("row", [pushed(8.0), pushed(35.0), pushed(5.0, 0.006)])
def test_the_action_is_the_minimum_of_the_sum_of_the_module(planning, row):
    """The terms are written out again, and a general optimiser finds their minimum."""
    query, told = planning._query(row, None), planning.explain(row)
    model, plan, frame = planning.planning_, told.prediction.plan, told.frame_angle
    drift, B = model.forward(model.log_weights(query.X[0], query.P[0]))
    assert np.abs(drift).max() > 0.05  # it matters
    imitated = planning.imitation().predict(query)
    near = imitated.samples
    share, actions = near.weights / near.weights.sum(), planning.regressor_.y_[near.rows]
    spread = 5 * np.sqrt(share @ (actions - share @ actions) ** 2) + planner.SMALLEST_SPREAD
    low, high = (query.P[0] @ bounds for bounds in (model.lower, model.upper))
    step = plan.desired.change * 0.1 / max(plan.desired.time, 0.1)

    def terms(motion):
        after = plan.loads + drift + B @ motion
        to_go, unusual = after - plan.loads - step, motion - 5 * imitated.action
        beyond = after - np.clip(after, low, high)
        return to_go / planner.LOAD_TOLERANCE, unusual / spread, beyond / planner.BOUND_TOLERANCE

    best = minimize(
        lambda v: sum(float(t @ t) for t in terms(v * model.largest_input)),
        np.zeros(3),
        bounds=[(-1, 1)] * 3,
        tol=1e-12,
    )
    turn = np.array([[np.cos(frame), np.sin(frame)], [-np.sin(frame), np.cos(frame)]]) @ told.action.turn
    motion = 5 * np.array([*turn, told.action.feed])
    np.testing.assert_allclose(motion / model.largest_input, best.x, atol=2e-4)
    np.testing.assert_allclose(plan.expected, plan.loads + drift + B @ motion, atol=1e-9)
    np.testing.assert_allclose(plan.beyond, terms(motion)[2] * planner.BOUND_TOLERANCE, atol=1e-9)


def test_the_values_are_those_of_the_graph(planning):
    expected = [*planning.graph_.values(VALUE_TIME), 1.0, 0.0]
    np.testing.assert_array_equal(planning.planning_.values, expected)


def test_the_loads_of_a_plan_are_those_of_the_frame(planning):
    geometry = PegHoleGeometry.find(planning.metadata_, "the skill")
    radius = ContactFeatures.of(geometry).peg_radius
    row = np.array([3.0, 4.0, 7.0, 0.02, -0.01, 0.0, -0.004])
    turned = loads_of(row[None], np.arctan2([4.0], [3.0]), radius)[0]
    np.testing.assert_allclose(turned[[0, 1, 4]], [5.0, 0.0, 7.0], atol=1e-12)
    np.testing.assert_allclose(planning.explain(row).prediction.plan.loads, turned, atol=0.05)


def test_a_loaded_skill_plans_bit_identically(planning, rows, tmp_path):
    planning.save(tmp_path / "skill.npz")
    loaded = ManipulationSkill.load(tmp_path / "skill.npz")
    assert loaded.policy == "plan"
    for row in rows:
        one, other = planning.act(row), loaded.act(row)
        assert (*one.turn, one.feed, one.support) == (*other.turn, other.feed, other.support)


def changed(planning, folder, change):
    planning.save(folder / "skill.npz")
    with np.load(folder / "skill.npz") as stored:
        arrays = dict(stored)
    change(arrays)
    path = folder / "changed.npz"
    path.write_bytes(sealed_arrays(arrays))
    return path


def without_plan(arrays):
    for name in [name for name in arrays if name.startswith("planning/")]:
        del arrays[name]


def with_another_state(arrays):
    for name in ("lower", "upper"):
        arrays[f"planning/{name}"] = np.vstack([arrays[f"planning/{name}"], np.zeros((1, 5))])
    arrays["planning/values"] = np.append(arrays["planning/values"], 0.0)
    P = arrays["planning/memberships"]
    arrays["planning/memberships"] = np.hstack([P, np.zeros((len(P), 1))])


def as_imitation(arrays):
    header = bytes(arrays["header"]).replace(b'"policy": "plan"', b'"policy": "imitate"')
    arrays["header"] = np.frombuffer(header, dtype=np.uint8)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (without_plan, "planning: missing for this policy"),
        (as_imitation, "planning: unexpected for this policy"),
        (with_another_state, "planning: .* features, inputs, outputs and states, expected"),
    ],
)
def test_a_file_whose_plan_does_not_fit_is_refused(planning, tmp_path, change, message):
    with pytest.raises(ValueError, match=message):
        ManipulationSkill.load(changed(planning, tmp_path, change))


def test_policies_are_checked(demonstrations):
    with pytest.raises(ValueError, match=r"policy 'dream'; expected one of \['imitate', 'plan'\]"):
        ManipulationSkill(policy="dream").fit(demonstrations)
    foreign = ManipulationSkill(
        policy="plan", states=CompetitiveAgglomeration(m_init=1), regressor=LinearRegression(), random_state=None
    )
    with pytest.raises(TypeError, match="a LinearRegression has no neighbours; expected one such as LWRegressor"):
        foreign.fit(demonstrations[:2])
