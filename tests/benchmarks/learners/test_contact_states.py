"""The scores of discovered contact states."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("hmmlearn", reason="needs the extra [peers]")

from benchmarks.learners.contact_states import evaluate, recognition
from benchmarks.learners.labelled_demonstrations import label_demonstrations


@pytest.fixture(scope="module")
def data(demonstrations):
    return label_demonstrations(demonstrations, seed=0)


def timeline(data, labels):
    """One demonstration with these true labels and a sample period of 20 ms."""
    n = len(labels)
    return replace(data, labels=np.array(labels), groups=np.zeros(n, dtype=int), times=0.02 * np.arange(n))


def test_delay_and_share_of_recognised_changes(data):
    true = timeline(data, [0] * 5 + [1] * 5 + [2] * 2 + [3] * 5)  # label 2 is too short to count
    delays, share = recognition(true, np.array([0] * 7 + [1] * 3 + [0] * 7))  # label 3 is not recognised
    np.testing.assert_allclose(delays, [0.0, 0.04])
    assert share == pytest.approx(2 / 3)


def test_no_recognised_change_gives_no_delay(data):
    delays, share = recognition(timeline(data, [0] * 5), np.ones(5, dtype=int))
    assert np.isnan(delays).all()
    assert share == 0.0


def test_gaussians_of_the_true_labels_recover_most_of_them(data):
    best, states, _ = evaluate(data, "Gaussians of true labels", 0)
    skill, _, _ = evaluate(data, "CA-FMLE", 0)
    assert len(states) == len(data.labels)
    # One Gaussian a label is no upper bound: discovered states may fit the contacts better.
    assert best["ari"] > 0.8
    assert 0.0 < skill["purity"] <= 1.0
    assert 0.0 <= skill["recognised"] <= 1.0
    assert np.sum(skill["confusion"]) == len(data.labels)
