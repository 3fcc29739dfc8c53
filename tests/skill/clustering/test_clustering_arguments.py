import warnings

import numpy as np
import pytest
from sklearn.exceptions import ConvergenceWarning

from benchmarks.learners.cluster_sets import spheres
from skill.clustering.clustering_arguments import checked_groups, checked_phase, checked_sensor_variance
from skill.clustering.competitive_agglomeration import CompetitiveAgglomeration


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        (
            {"distance": "cosine"},
            "'distance' parameter of CompetitiveAgglomeration must be a str among .* Got 'cosine'",
        ),
        ({"bias": "none"}, "'bias' .* Got 'none'"),
        ({"schedule": "linear"}, "'schedule' .* Got 'linear'"),
        ({"covariance_type": "tied"}, "'covariance_type' .* Got 'tied'"),
        ({"merge": "aic"}, "'merge' .* Got 'aic'"),
        ({"init": "random"}, "'init' .* Got 'random'"),
        ({"init": "phase"}, r"pass fit\(X, phase=...\)"),
        ({"init": np.zeros((3, 9))}, r"expected centres \(M, 2\)"),
        ({"m_init": 0}, r"'m_init' .* must be an int in the range \[1, inf\). Got 0"),
        ({"n_init": 1.5}, "'n_init' .* Got 1.5"),
        ({"tau": 0.0}, r"'tau' .* must be a float in the range \(0.0, inf\). Got 0.0"),
        ({"reg_covar": -1.0}, "'reg_covar' .* Got -1.0"),
        ({"eta0": np.inf}, "'eta0' .* Got inf"),
        ({"sensor_variance": [1.0]}, r"sensor_variance has shape \(1,\), expected \(2,\)"),
        ({"sensor_variance": [1.0, -1.0]}, "expected finite variances of at least 0"),
        ({"sensor_variance": [1.0, np.inf]}, "expected finite variances of at least 0"),
        ({"sensor_variance": "none"}, "'sensor_variance' .* Got 'none'"),
        ({"max_iter": 0}, "'max_iter' .* Got 0"),
        ({"n_init": 0}, "'n_init' .* Got 0"),
        ({"m_init": None}, "'m_init' .* Got None"),
        ({"tol": np.nan}, "'tol' .* Got nan"),
        ({"tau": -1.0}, "'tau' .* Got -1.0"),
        ({"min_cardinality": -1}, "'min_cardinality' .* Got -1"),
        ({"shrinkage": -0.5}, "'shrinkage' .* Got -0.5"),
        ({"rise": -1}, r"'rise' .* must be an int in the range \[0, inf\). Got -1"),
        ({"decay": 1.5}, "'decay' .* Got 1.5"),
        ({"standardize": "yes"}, "'standardize' .* Got 'yes'"),
        ({"random_state": "seed"}, "'random_state' .* Got 'seed'"),
        ({"init": 3}, "'init' .* Got 3"),
    ],
)
def test_parameters_out_of_range_are_errors(parameters, message):
    with pytest.raises(ValueError, match=message):
        CompetitiveAgglomeration(**parameters).fit(spheres(0)[0])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"groups": [0, 1]}, r"groups has shape \(2,\), expected \(575,\)"),
        ({"phase": [0.5]}, r"phase has shape \(1,\)"),
        ({"phase": np.linspace(0, 2, 575)}, "divide the time since the start"),
        ({"phase": np.linspace(-0.1, 1, 575)}, r"phase lies between -0.1 and 1, expected \[0, 1\]"),
        ({"phase": np.full(575, np.nan)}, r"expected \[0, 1\]"),
    ],
)
def test_wrong_groups_and_phases_are_errors(arguments, message):
    with pytest.raises(ValueError, match=message):
        CompetitiveAgglomeration().fit(spheres(0)[0], **arguments)


@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_samples_that_are_not_finite_are_errors(value):
    X, _ = spheres(0)
    X[7, 1] = value
    with pytest.raises(ValueError, match=r"NaN|infinity"):
        CompetitiveAgglomeration().fit(X)


def test_error_of_a_singular_covariance_names_the_parameter_to_raise():
    X = np.column_stack([np.arange(100.0), np.arange(100.0)])
    with pytest.raises(ValueError, match="raise reg_covar"):
        CompetitiveAgglomeration(reg_covar=0.0, shrinkage=0.0).fit(X)


def test_smallest_and_largest_allowed_parameters():
    X, _ = spheres(0)
    parameters = {
        "m_init": 1,
        "n_init": 1,
        "max_iter": 1,
        "eta0": 0.0,
        "min_cardinality": 0,
        "shrinkage": 0,
        "reg_covar": 0.0,
        "tol": 0,
        "rise": 0,
        "decay": 0,
        "sensor_variance": [0.0, 0.0],
        "random_state": np.random.RandomState(0),
    }
    with pytest.warns(ConvergenceWarning):
        assert CompetitiveAgglomeration(**parameters).fit(X).n_clusters_ == 1


def test_checked_groups_are_indices():
    np.testing.assert_array_equal(checked_groups(["b", "a", "b"], 3), [1, 0, 1])
    assert checked_groups(None, 3) is None


def test_two_demonstrations_are_enough():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert checked_groups([0, 0, 1], 3) is not None


def test_single_demonstration_warns():
    with pytest.warns(UserWarning, match="use two or more demonstrations"):
        assert checked_groups([4, 4, 4], 3) is None


def test_checked_phase_includes_both_ends():
    np.testing.assert_array_equal(checked_phase([0, 1], 2), [0.0, 1.0])
    assert checked_phase(None, 2) is None


def test_checked_sensor_variance():
    np.testing.assert_array_equal(checked_sensor_variance(None, 2), [0.0, 0.0])
    np.testing.assert_array_equal(checked_sensor_variance([0, 2], 2), [0.0, 2.0])
