import numpy as np
from sklearn.metrics import adjusted_rand_score

from skill.competitive_agglomeration import CompetitiveAgglomeration


def three_blobs(seed=0, n=200):
    rng = np.random.default_rng(seed)
    centres = np.array([[0.0, 0.0, 0.0], [8.0, 0.0, 1.0], [0.0, 9.0, -1.0]])
    return np.vstack([rng.normal(c, 1.0, (n, 3)) for c in centres]), np.repeat(np.arange(3), n)


def test_finds_three_blobs():
    X, y = three_blobs()
    dut = CompetitiveAgglomeration(random_state=0).fit(X)
    assert dut.n_clusters_ == 3
    assert adjusted_rand_score(y, dut.labels_) > 0.98


def test_restored_arrays_predict_identically():
    X, _ = three_blobs()
    dut = CompetitiveAgglomeration(random_state=0).fit(X)
    restored = CompetitiveAgglomeration.from_arrays(dut.to_arrays())
    np.testing.assert_array_equal(restored.predict_proba(X), dut.predict_proba(X))
    np.testing.assert_array_equal(
        restored.predict_proba(X[:, [0, 2]], channels=[0, 2]),
        dut.predict_proba(X[:, [0, 2]], channels=[0, 2]),
    )
