"""The predictability of actions, against figures worked by hand."""

import numpy as np
import pytest

from benchmarks.learners.intention import WINDOWS, figures, predicted, targets_of
from tests.trajectories import make_demonstration


def test_figures_by_hand():
    """Turns of 1 and -1 predicted as 0.5 and 0.5: 1 - (0.25 + 2.25)/2, half of the signs; feeds 1, 1 as 1, 0."""
    Y = np.array([[0.0, 1.0, 1.0], [0.0, -1.0, 1.0]])
    found = np.array([[0.0, 0.5, 1.0], [0.0, 0.5, 0.0]])
    Y[:, 0] = 1.0
    assert figures(Y, found) == {"turn": pytest.approx(-0.25), "sign": 0.5, "feed": pytest.approx(0.5)}


def test_the_windows_are_means_of_what_follows():
    demonstration = make_demonstration()
    shown = demonstration.samples["uz"].shift(-1, fill_value=0.0).to_numpy()
    targets = targets_of(demonstration)
    k = int(np.flatnonzero(demonstration.samples["time"] == targets["time"][10])[0])
    for name, length in WINDOWS.items():
        assert targets[f"{name}/uz"][10] == pytest.approx(shown[k : k + length].mean())


def test_an_intention_is_easier_to_predict_than_a_stroke():
    """Strokes at random times lead to the same end: the next action is luck, the remaining rotation is not."""
    rng = np.random.default_rng(0)
    demonstrations = []
    for tilt in np.radians(rng.uniform(1.5, 4.0, 6)):
        shown = make_demonstration(tilt=tilt, direction=rng.uniform(-3.0, 3.0))
        turns = shown.samples[["rx", "ry"]].to_numpy()
        jerky = np.zeros_like(turns)
        for start in range(0, len(turns), 10):  # all of ten samples' motion in one of them
            jerky[min(start + rng.integers(10), len(turns) - 1)] = turns[start : start + 10].sum(axis=0)
        shown.samples[["rx", "ry"]] = jerky
        demonstrations.append(shown)
    rows = {row["target"]: row for row in predicted(demonstrations)}
    assert rows["intended"]["turn"] > 0.5 > rows["next action"]["turn"]
    assert rows["intended"]["sign"] > 0.9
