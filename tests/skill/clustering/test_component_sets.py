import numpy as np
import pytest
from scipy.stats import norm

from skill.clustering.component_sets import (
    BANDWIDTH,
    component_sets,
    densest_component,
    density_valley,
    discriminant,
    recurrence_of_components,
)

MANY = 1e5  # effective samples, so that the kernel is narrow


def memberships_of(labels, M=None):
    return np.eye(max(labels) + 1 if M is None else M)[labels]


def normal_samples(mean, n=20_000):
    """Samples of a normal distribution of standard deviation 1 without randomness: its quantiles."""
    return mean + norm.ppf((np.arange(n) + 0.5) / n)


@pytest.mark.parametrize("distance", [2.0, 3.0, 4.0])
def test_valley_between_two_normal_distributions_worked_by_hand(distance):
    """A kernel of width h makes each wider, sqrt(1 + h^2); the valley is half way, the peaks nearly at the means."""
    A, B = normal_samples(0.0), normal_samples(distance)
    h = BANDWIDTH * (MANY / 2) ** -0.2
    width = 1.0 + h**2
    density = lambda x: np.exp(-0.5 * x**2 / width) + np.exp(-0.5 * (x - distance) ** 2 / width)  # noqa: E731
    expected = density(distance / 2.0) / density(0.0)
    assert density_valley(A, B, MANY) == pytest.approx(min(expected, 1.0), abs=0.03)


def test_equal_numbers_have_no_valley():
    assert density_valley(np.ones(5), np.ones(3), 8.0) == 1.0


def test_few_effective_samples_show_no_valley():
    """Single visits of a ramp leave gaps, which are no valleys; with as many independent samples they are."""
    A, B = normal_samples(0.0), normal_samples(3.5)
    assert density_valley(A, B, 4.0) > 0.8 > 0.6 > density_valley(A, B, 400.0)
    assert density_valley(A, B + 9.0, 0.1) == density_valley(A, B + 9.0, 2.0) < 0.9  # at least two


def test_discriminant_worked_by_hand():
    """Means differ by (1, 1); the variances are 1/4 and 1 in each group, so that the direction is (1/0.5, 1/2)."""
    cross = np.array([[0.5, 0.0], [-0.5, 0.0], [0.0, 1.0], [0.0, -1.0]])
    variances = cross.var(axis=0, ddof=1)
    direction = discriminant(cross + 1.0, cross)
    np.testing.assert_allclose(direction, 1.0 / (2.0 * variances), rtol=1e-5)


def ramp_and_blob(rng):
    """A ramp that three components divide, and a blob apart from it."""
    ramp = np.column_stack([rng.uniform(0.0, 6.0, 3000), rng.normal(0.0, 0.3, 3000)])
    blob = rng.normal([3.0, 8.0], 0.3, size=(1000, 2))
    labels = np.concatenate([np.minimum(ramp[:, 0] // 2.0, 2).astype(int), np.full(1000, 3)])
    return np.vstack([ramp, blob]), labels


def test_components_of_a_ramp_are_one_set_and_a_blob_is_another():
    Z, labels = ramp_and_blob(np.random.default_rng(1))
    assert component_sets(Z, memberships_of(labels), design_effect=4.0, threshold=0.4).tolist() == [0, 0, 0, 1]


@pytest.mark.parametrize(("threshold", "number"), [(0.0, 1), (1.0, 4)])
def test_the_threshold_decides_how_deep_a_valley_must_be(threshold, number):
    Z, labels = ramp_and_blob(np.random.default_rng(1))
    sets = component_sets(Z, memberships_of(labels), design_effect=4.0, threshold=threshold)
    assert len(set(sets)) == number


def test_a_design_effect_leaves_few_samples_to_show_a_valley():
    A, B = normal_samples(0.0, 500), normal_samples(3.5, 500)
    Z, memberships = np.concatenate([A, B])[:, None], memberships_of(np.repeat([0, 1], 500))
    found = [len(set(component_sets(Z, memberships, design_effect=tau, threshold=0.8))) for tau in (1.0, 250.0)]
    assert found == [2, 1]


def test_sets_are_compared_as_wholes():
    """The valley between the ends of a ramp is deep; their sets touch once the middle belongs to one of them."""
    x = np.linspace(0.0, 9.0, 9000)
    labels = (x // 3.0).clip(max=2).astype(int)
    assert density_valley(x[labels == 0], x[labels == 2], 1000.0) < 0.1
    assert component_sets(x[:, None], memberships_of(labels), design_effect=9.0, threshold=0.6).tolist() == [0, 0, 0]


def test_a_component_without_samples_belongs_to_the_one_that_it_overlaps_most():
    Z, labels = ramp_and_blob(np.random.default_rng(1))
    memberships = memberships_of(labels, 5) * 0.9
    memberships[labels == 3, 4] = 0.1
    assert component_sets(Z, memberships, design_effect=4.0, threshold=0.4).tolist() == [0, 0, 0, 1, 1]
    memberships = memberships_of(labels, 5) * 0.9
    memberships[labels == 0, 4] = 0.1
    assert component_sets(Z, memberships, design_effect=4.0, threshold=1.0).tolist() == [0, 1, 2, 3, 0]


def core_and_ring(rng):
    """A narrow core in the middle of a wide ring that begins at the core, and that four components divide."""
    core = rng.normal(scale=0.05, size=(1000, 2))
    ring = rng.normal(scale=1.0, size=(3000, 2))
    quadrant = (ring[:, 0] > 0).astype(int) + 2 * (ring[:, 1] > 0).astype(int)
    return np.vstack([core, ring]), np.concatenate([np.zeros(1000, dtype=int), 1 + quadrant])


def test_a_component_alone_is_merged_with_no_other():
    Z, labels = core_and_ring(np.random.default_rng(1))
    memberships = memberships_of(labels)
    assert set(component_sets(Z, memberships, design_effect=4.0, threshold=0.4)) == {0}
    found = component_sets(Z, memberships, design_effect=4.0, threshold=0.4, alone=0)
    assert found.tolist() == [0, 1, 1, 1, 1]


def test_the_densest_component_worked_by_hand():
    """Peaks P / sqrt(det): 0.5 / 1, 0.25 / 0.25, and 0.25 / s with the standard deviations (s, 1)."""
    weights, wide = np.array([0.5, 0.25, 0.25]), np.diag([0.25, 0.25])

    def densest(s):
        return densest_component(weights, np.stack([np.eye(2), wide, np.diag([s**2, 1.0])]))

    assert densest(0.25 / 8.01) == 2  # the next has 1
    assert densest(0.25 / 7.99) is None
    assert densest_component(np.ones(1), np.eye(2)[None]) is None


def test_recurrence_of_components_worked_by_hand():
    """Of a set of two components, one is in one recording and the other in two; a component alone does not count."""
    labels, groups = np.array([0, 0, 1, 1, 2, 2]), np.array([0, 0, 1, 2, 0, 2])
    sets = np.array([0, 0, 1])
    of_set = 4.0 * np.sqrt(2.0) / 2.0  # exp H of shares 1/2, 1/4, 1/4
    assert recurrence_of_components(labels, sets, groups) == pytest.approx((2 * 1 + 2 * 2) / (4 * of_set))
    assert recurrence_of_components(labels, np.arange(3), groups) == 1.0


def test_groups_without_noise_are_told_apart():
    A, B = np.tile([0.0, 2.0], (9, 1)), np.tile([1.0, 2.0], (9, 1))
    direction = discriminant(A, B)
    assert np.isfinite(direction).all()
    assert density_valley(A @ direction, B @ direction, 10.0) < 0.01
