"""The controls among the compared skills."""

import numpy as np
import pytest

from benchmarks.rig.learners import Extrapolating, RandomSign, ShuffledNeighbour
from skill.features.measurement import MEASURED


def test_shuffled_actions_are_the_demonstrated_ones_in_another_order():
    rng = np.random.default_rng(0)
    X, y = rng.standard_normal((200, 3)), rng.standard_normal((200, 2))
    predicted = ShuffledNeighbour().fit(X, y).predict(X)
    np.testing.assert_array_equal(np.sort(predicted, axis=0), np.sort(y, axis=0))
    assert abs(np.corrcoef(predicted[:, 0], y[:, 0])[0, 1]) < 0.2


@pytest.mark.slow
def test_an_extrapolating_skill_acts_as_its_regressor_says(skill, demonstrations):
    dut = Extrapolating().fit(demonstrations)
    differs = 0
    for row in demonstrations[0].samples[list(MEASURED)].to_numpy()[::10]:
        P = dut.state_probabilities(row[None])
        X = dut.features_.transform(row[None])
        bare = dut.features_.actions_from_frame(row[None], dut.regressor_.predict(X, memberships=P))[0]
        action = dut.act(row)
        np.testing.assert_allclose([*action.turn, action.feed], bare, rtol=1e-12)
        differs += not np.allclose(skill.act(row).turn, action.turn)
    assert differs > 0


@pytest.mark.slow
def test_a_random_sign_changes_nothing_but_the_direction_of_the_turn(skill, demonstrations):
    random = RandomSign().fit(demonstrations)
    rows = np.vstack([d.samples[["fx", "fy", "fz", "mx", "my", "mz", "z"]].to_numpy() for d in demonstrations])[::40]
    signs = []
    for row in rows:
        true, changed = skill.act(row), random.act(row)
        assert changed.feed == true.feed
        sign = float(np.sign(changed.turn @ true.turn))
        np.testing.assert_array_equal(changed.turn, sign * true.turn)
        np.testing.assert_array_equal(changed.turn, random.act(row).turn)
        signs.append(sign)
    assert 0.2 < np.mean(np.array(signs) > 0) < 0.8
