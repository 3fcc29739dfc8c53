import numpy as np
import pytest
from sklearn.metrics import adjusted_rand_score

from skill.states import contact_states
from skill.states.contact_states import CAUSAL_SHARE, SMOOTHED_SHARE, ContactStates
from skill.states.hidden_markov import forward, smoothed

LENGTHS = (80, 200, 120)
FORCES = np.array([[0.0, 0.0, 0.0], [2.0, -6.0, 0.5], [-1.0, -15.0, -1.0]])
DRIFT = 4.0  # N, across the second state, more than its noise


def recordings(n=6, seed=0):
    """Three contacts of different force; the force of the second drifts, and each begins with an impact.

    The noise is correlated over ten samples, and each recording has its own offset.
    """
    rng = np.random.default_rng(seed)
    X, groups, phases = [], [], []
    for k in range(n):
        phase = np.repeat([0, 1, 2], [int(length * rng.uniform(0.7, 1.3)) for length in LENGTHS])
        force = FORCES[phase]
        ramp = np.concatenate([np.linspace(-0.5, 0.5, count) for count in np.bincount(phase)])
        force[:, 1] += DRIFT * ramp * (phase == 1)
        for change in np.flatnonzero(np.diff(phase)):
            force[change : change + 4] += rng.normal(scale=12.0, size=(4, 3))
        noise = rng.normal(scale=0.4, size=force.shape)
        for t in range(1, len(noise)):
            noise[t] = 0.9 * noise[t - 1] + np.sqrt(1 - 0.81) * noise[t]
        X.append(force + noise + rng.normal(scale=0.2, size=3))
        phases.append(phase)
        groups.append(np.full(len(X[-1]), k))
    return np.vstack(X), np.concatenate(groups), np.concatenate(phases)


@pytest.fixture(scope="module")
def fitted():
    X, groups, _ = recordings()
    return ContactStates(random_state=0).fit(X, groups=groups)


def test_drift_and_impacts_are_no_states(fitted):
    assert fitted.components_.n_clusters_ > 3  # so that there are components to merge
    assert fitted.n_clusters_ == 3
    assert fitted.component_states_.tolist() != list(range(len(fitted.component_states_)))
    X, groups, phases = recordings(seed=1)
    assert adjusted_rand_score(phases, fitted.predict(X, groups)) > 0.95
    assert adjusted_rand_score(phases, fitted.predict(X, groups, causal=True)) > 0.93


def test_states_are_numbered_in_the_order_of_time(fitted):
    X, groups, phases = recordings()
    assert (fitted.labels_ == phases).mean() > 0.97
    np.testing.assert_array_equal(fitted.labels_, fitted.predict(X, groups))


def test_free_space_amid_light_contacts_is_a_state():
    """Contacts begin at no force, in another direction in each recording: no valley separates them from free space."""
    rng = np.random.default_rng(0)
    X, groups, phases = [], [], []
    for k in range(24):
        direction = np.array([np.cos(2.4 * k), np.sin(2.4 * k), 0.2])
        force = np.concatenate([np.zeros(80), np.abs(6.0 * np.sin(np.linspace(0.0, 2.0 * np.pi, 160)))])
        X.append(np.outer(force, direction) + rng.normal(scale=0.05, size=(240, 3)))
        groups.append(np.full(240, k))
        phases.append(np.repeat([0, 1], [80, 160]))
    dut = ContactStates(random_state=0).fit(np.vstack(X), groups=np.concatenate(groups))
    assert dut.n_clusters_ == 2
    assert adjusted_rand_score(np.concatenate(phases), dut.labels_) > 0.7


def test_one_wild_sample_changes_nothing(fitted):
    X, groups, _ = recordings()
    X[333, 2] = 1e9
    dut = ContactStates(random_state=0).fit(X, groups=groups)
    assert dut.n_clusters_ == 3
    assert (dut.labels_ == fitted.labels_).mean() > 0.995
    limited = np.clip(X, *dut.limits_)
    np.testing.assert_array_equal(dut.predict_proba(X, groups), dut.predict_proba(limited, groups))


def test_contacts_whose_directions_differ_from_recording_to_recording():
    """A light contact and a strong one with a moment: no valley of the density of all recordings separates them."""
    rng = np.random.default_rng(0)
    spread = np.array([[0.05, 0.05, 0.05, 5e-3, 5e-3], [0.6, 0.6, 0.4, 0.02, 0.02], [0.6, 0.6, 0.8, 0.1, 0.1]])
    X, groups, phases = [], [], []
    for k in range(16):
        phase = np.repeat([0, 1, 2], rng.integers(40, 90, 3))
        noise = rng.normal(size=(len(phase), 5))
        for t in range(1, len(noise)):
            noise[t] = 0.8 * noise[t - 1] + 0.6 * noise[t]
        light = [*rng.normal(scale=3.0, size=2), 2.0, 0.0, 0.0]
        strong = [*rng.normal(scale=3.0, size=2), 6.0, *rng.normal(scale=0.6, size=2)]
        X.append(np.array([np.zeros(5), light, strong])[phase] + spread[phase] * noise)
        groups.append(np.full(len(phase), k))
        phases.append(phase)
    dut = ContactStates(random_state=0).fit(np.vstack(X), groups=np.concatenate(groups))
    assert dut.n_clusters_ == 3
    assert adjusted_rand_score(np.concatenate(phases), dut.labels_) > 0.95


def test_a_jam_of_one_recording_is_a_state():
    X, groups, phases = recordings()
    last = np.flatnonzero(groups == 5)[-60:]
    X = np.insert(X, last[-1] + 1, X[last] + [0.0, 30.0, -20.0], axis=0)
    groups, phases = np.append(groups, np.full(60, 5)), np.append(phases, np.full(60, 3))
    dut = ContactStates(random_state=0).fit(X, groups=groups)
    assert dut.n_clusters_ == 4
    assert adjusted_rand_score(phases, dut.labels_) > 0.95


def test_the_likelihood_of_a_state_is_the_mixture_of_its_components(fitted):
    X = np.clip(recordings(seed=2)[0][::37], *fitted.limits_)
    likelihoods = fitted.state_log_likelihoods(X)
    together = np.log(np.exp(likelihoods) @ np.bincount(fitted.component_states_, fitted.components_.weights_))
    np.testing.assert_allclose(together, fitted.components_.score_samples(X), atol=1e-9)


@pytest.mark.parametrize(
    ("causal", "method", "share"), [(True, forward, CAUSAL_SHARE), (False, smoothed, SMOOTHED_SHARE)]
)
def test_samples_count_by_a_share_of_the_design_effect(fitted, causal, method, share):
    X, _, _ = recordings(n=1, seed=5)
    evidence = fitted.state_log_likelihoods(X) / (share * fitted.components_.design_effect_)
    np.testing.assert_allclose(fitted.predict_proba(X, causal=causal), method(evidence, fitted.chain_), atol=1e-12)
    assert share * fitted.components_.design_effect_ > 1.0


def test_recordings_do_not_see_each_other(fitted):
    X, groups, _ = recordings(n=2, seed=4)
    both = fitted.predict_proba(X, groups)
    apart = np.vstack([fitted.predict_proba(X[groups == k]) for k in (0, 1)])
    np.testing.assert_allclose(both, apart, atol=1e-12)


def test_the_valley_decides_what_is_merged(monkeypatch):
    X, groups, _ = recordings()
    monkeypatch.setattr(contact_states, "VALLEY", 0.0)
    one = ContactStates(random_state=0).fit(X, groups=groups)
    assert one.n_clusters_ == 1
    np.testing.assert_array_equal(one.predict_proba(X, groups), 1.0)


def test_bad_input_is_named(fitted):
    X, groups, _ = recordings(n=2)
    with pytest.raises(ValueError, match="two or more recordings"):
        ContactStates().fit(X)
    with pytest.raises(ValueError, match="two or more recordings"):
        ContactStates().fit(X, groups=np.zeros(len(X)))
    with pytest.raises(ValueError, match=r"groups has shape \(3,\), expected \(739,\): the recording of each sample"):
        fitted.predict(X, groups[:3])
