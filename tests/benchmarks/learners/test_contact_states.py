"""The scores of discovered contact states."""

import numpy as np
import pytest

pytest.importorskip("hmmlearn", reason="needs the extra [peers]")

from benchmarks.learners.contact_states import evaluate
from benchmarks.learners.labelled_demonstrations import label_demonstrations


@pytest.fixture(scope="module")
def data(demonstrations):
    return label_demonstrations(demonstrations, seed=0)


@pytest.mark.nightly
def test_gaussians_of_the_true_labels_recover_most_of_them(data):
    best = evaluate(data, "Gaussians of true labels", 0)
    skill = evaluate(data, "CA-FMLE", 0)
    # One Gaussian a label is no upper bound: discovered states may fit the contacts better.
    assert best["ari"] > 0.8
    assert 0.0 < skill["purity"] <= 1.0
    assert 0.0 <= skill["recognised"] <= 1.0
    assert np.sum(skill["confusion"]) == len(data.labels)
