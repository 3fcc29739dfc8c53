"""A skill whose demonstrations have contexts: discovered, used, stored."""

import math
from copy import copy
from dataclasses import replace

import numpy as np
import pytest

from skill.features.wrench_features import MEASURED
from skill.manipulation_skill import ManipulationSkill
from skill.regression.locally_weighted_regression import LWRegressor
from skill.states.context_mixture import ContextMixture
from tests.crafted_files import sealed_arrays
from tests.trajectories import make_demonstration


def hinged_demonstrations(number=8):
    """Synthetic demonstrations in which the lateral force answers to turns about y, with opposite signs in two halves.

    The turns are noise: those with even numbers act like those with odd numbers.
    """
    rng = np.random.default_rng(3)
    demonstrations = []
    for k in range(number):
        made = make_demonstration(tilt=math.radians(2.0), direction=0.0)
        samples, sign = made.samples.copy(), 1.0 if k % 2 == 0 else -1.0
        shallow = np.minimum(np.arange(len(samples)) / len(samples), 0.6) * 0.012
        samples["z"] = -shallow - np.where(np.arange(len(samples)) > 0.9 * len(samples), 0.0155, 0.0)
        turns = np.cumsum(rng.normal(0.0, 2e-3, len(samples)))
        samples["ry"] = np.diff(turns, prepend=0.0)
        samples["fx"] = 6.0 + sign * 800.0 * turns + rng.normal(0.0, 0.1, len(samples))
        samples["fy"] = rng.normal(0.0, 0.05, len(samples))
        demonstrations.append(replace(made, samples=samples))
    return demonstrations


@pytest.fixture(scope="module")
def skill_with_contexts():
    return ManipulationSkill(contexts=ContextMixture(), regressor=LWRegressor(ridge=1.0, feature_scale=None)).fit(
        hinged_demonstrations()
    )


def test_contexts_are_discovered_in_the_answers_to_motions(skill_with_contexts):
    found = skill_with_contexts.contexts_
    assert found.n_contexts_ == 2
    side = found.responsibilities_.argmax(axis=1)
    assert len(set(side[::2])) == len(set(side[1::2])) == 1
    assert side[0] != side[1]
    assert skill_with_contexts.estimator().initial().contexts.shape == (2,)
    assert skill_with_contexts.regressor_.memberships_.shape[1] == 2 * skill_with_contexts.n_states


def in_context(skill, row, contexts):
    """The estimate from one measurement with given probabilities of the contexts."""
    return replace(skill.estimate_alone(row), contexts=np.array(contexts))


def share_of_context(skill, row, context):
    """Share of the weights of an explanation that belongs to the demonstrations of a context, and the explanation."""
    explained = skill.explain(row, in_context(skill, row, np.eye(2)[context]))
    number = explained.neighbours["demonstration"].to_numpy()
    weights = explained.neighbours["weight"].to_numpy()
    side = skill.contexts_.responsibilities_.argmax(axis=1)
    return weights[side[number] == context].sum() / weights.sum(), explained


def test_where_contexts_act_differently_an_action_is_that_of_its_context(skill_with_contexts):
    opposed = copy(skill_with_contexts)
    stored = skill_with_contexts.regressor_.to_arrays()
    side = opposed.contexts_.probabilities_of(opposed.sources_[:, 0]).argmax(axis=1)
    turns = np.where(side == 0, 1e-3, -1e-3) + 1e-4 * np.random.default_rng(0).standard_normal(len(side))
    opposed.regressor_ = LWRegressor.from_arrays(
        {**stored, "y": np.column_stack([0.0 * turns, turns, stored["y"][:, 2]])}
    )
    row = hinged_demonstrations()[0].samples[list(MEASURED)].to_numpy()[40]
    for context, sign in ((0, 1.0), (1, -1.0)):
        share, explained = share_of_context(opposed, row, context)
        assert explained.prediction.relevance > 0.99
        assert share > 0.99
        np.testing.assert_array_equal(explained.query.Q[0], np.eye(2)[context])
        angle = explained.frame_angle  # to the frame of the features
        assert explained.action.turn @ [-np.sin(angle), np.cos(angle)] == pytest.approx(sign * 1e-3, rel=0.2)
    text = str(opposed.explain(row))
    assert "contexts: A " in text
    assert "the context matters by " in text


def test_where_contexts_act_alike_all_demonstrations_count(skill_with_contexts):
    """The other half is as much evidence, and support is that of all samples."""
    rows = hinged_demonstrations()[0].samples[list(MEASURED)].to_numpy()[20:80:4]
    found = [share_of_context(skill_with_contexts, row, 0) for row in rows]
    assert np.median([share for share, _ in found]) == pytest.approx(0.5, abs=0.1)
    assert np.median([explained.prediction.relevance for _, explained in found]) < 0.2
    free = ManipulationSkill(
        contexts=ContextMixture(max_contexts=1), regressor=LWRegressor(ridge=1.0, feature_scale=None)
    )
    free.fit(hinged_demonstrations())
    given = [in_context(skill_with_contexts, row, [1.0, 0.0]) for row in rows]
    supports = [
        (skill_with_contexts.act(row, estimate).support, free.act(row).support)
        for row, estimate in zip(rows, given, strict=True)
    ]
    assert np.median([one / other for one, other in supports]) == pytest.approx(1.0, abs=0.1)


def test_without_contexts_given_their_shares_in_the_demonstrations_count(skill_with_contexts):
    row = hinged_demonstrations()[0].samples[list(MEASURED)].to_numpy()[40]
    alone = skill_with_contexts.estimate_alone(row)
    np.testing.assert_array_equal(skill_with_contexts.act(row).turn, skill_with_contexts.act(row, alone).turn)
    np.testing.assert_allclose(alone.contexts, 0.5, atol=0.01)


def test_a_skill_with_contexts_is_stored(skill_with_contexts, tmp_path):
    skill_with_contexts.save(tmp_path / "skill.npz")
    again = ManipulationSkill.load(tmp_path / "skill.npz")
    row = hinged_demonstrations()[0].samples[list(MEASURED)].to_numpy()[40]
    for context in (0, 1):
        one, other = (s.act(row, in_context(s, row, np.eye(2)[context])) for s in (skill_with_contexts, again))
        np.testing.assert_array_equal(one.turn, other.turn)
        assert one.feed == other.feed
    rng = np.random.default_rng(0)
    filters = [s.estimator() for s in (skill_with_contexts, again)]
    memories = [f.initial().memory for f in filters]
    for k in range(10):
        observation = np.array([6.0 + k, *rng.normal(0.0, 0.1, 5) * 0.1, -0.003, 0.0, 1e-3 * k])
        memories = [f.step(m, observation).memory for f, m in zip(filters, memories, strict=True)]
        np.testing.assert_array_equal(memories[0], memories[1])


def test_fewer_than_two_demonstrations_that_answer_have_a_single_context():
    dut = ManipulationSkill(contexts=ContextMixture(), regressor=LWRegressor(ridge=1.0, feature_scale=None))
    assert dut.fit(hinged_demonstrations(1)).contexts_ is None


def test_a_skill_may_be_limited_to_a_single_context():
    dut = ManipulationSkill(
        contexts=ContextMixture(max_contexts=1), regressor=LWRegressor(ridge=1.0, feature_scale=None)
    )
    dut.fit(hinged_demonstrations(4))
    assert dut.contexts_ is None
    assert dut.estimator().initial().contexts.tolist() == [1.0]
    assert dut.regressor_.memberships_.shape[1] == dut.n_states


def test_stored_contexts_must_fit_the_other_parts(skill_with_contexts, tmp_path):
    skill_with_contexts.save(tmp_path / "skill.npz")
    with np.load(tmp_path / "skill.npz") as stored:
        arrays = dict(stored)
    for name in ("contexts/features", "contexts/feature_spread"):
        arrays[name] = arrays[name][..., 1:]
    (tmp_path / "skill.npz").write_bytes(sealed_arrays(arrays))
    with pytest.raises(ValueError, match=r"contexts: \(6, 3, 5\) features, inputs and outputs, expected \(7, 3, 5\)"):
        ManipulationSkill.load(tmp_path / "skill.npz")
