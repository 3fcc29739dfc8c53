"""Samples of demonstrations are labelled, standardised and complete."""

import numpy as np
import pytest

from benchmarks.learners.labelled_demonstrations import label_demonstrations
from models.exact_geometry import ContactLabel


@pytest.fixture(scope="module")
def data(demonstrations):
    return label_demonstrations(demonstrations, seed=0)


def test_every_sample_has_features_a_label_and_a_group(data, demonstrations):
    n = len(data.labels)
    assert data.Z.shape[0] == data.regressor_Z.shape[0] == len(data.groups) == len(data.phase) == len(data.times) == n
    assert sum(data.lengths) == n
    assert len(data.lengths) == len(demonstrations)
    assert set(data.labels) <= {int(label) for label in ContactLabel}


def test_the_features_are_standardised(data):
    for Z in (data.Z, data.regressor_Z, data.as_the_regressor_sees_it().Z):
        np.testing.assert_allclose(Z.mean(axis=0), 0.0, atol=1e-9)
        np.testing.assert_allclose(Z.std(axis=0), 1.0, atol=1e-9)


def test_geometry_and_force_agree_about_contact(data):
    assert data.contact_agreement > 0.95
    assert 0.0 < data.deepest_overlap < 1e-3
