import numpy as np
import pytest

from skill.states.state_graph import StateGraph

SEQUENCES = [[0, 0, 1, 1, 1, 2], [0, 1, 0, 1, 2, 2], [0, 0, 0, 3], [0, 1, 3, 3, 3, 3]]
OUTCOMES = ["inserted", "inserted", "jammed", "inserted"]


def example():
    return StateGraph(sample_period=0.1).fit(SEQUENCES, OUTCOMES)


def test_counts_worked_by_hand():
    dut = example()
    np.testing.assert_array_equal(dut.counts_, [[0, 4, 0, 1], [1, 0, 2, 1], [0, 0, 0, 0], [0, 0, 0, 0]])
    assert list(dut.outcomes_) == ["inserted", "jammed"]
    np.testing.assert_array_equal(dut.exits_, [[0, 0], [0, 0], [2, 0], [1, 1]])
    np.testing.assert_array_equal(dut.visits_, [5, 4, 2, 2])
    np.testing.assert_allclose(dut.dwell_mean_, [8 / 5, 6 / 4, 3 / 2, 5 / 2])
    np.testing.assert_allclose(dut.dwell_std_[2:], [0.5, 1.5])
    np.testing.assert_allclose(dut.dwell_mean_s_, 0.1 * dut.dwell_mean_)
    np.testing.assert_allclose(dut.dwell_std_s_, 0.1 * dut.dwell_std_)
    assert dut.sample_counts_.sum() == sum(len(s) - 1 for s in SEQUENCES)
    np.testing.assert_array_equal(dut.sample_counts_, [[3, 4, 0, 1], [1, 2, 2, 1], [0, 0, 1, 0], [0, 0, 0, 3]])
    # Samples of state 2 are the last of sequence 0 and the last two of sequence 1.
    assert dut.phase_[2] == pytest.approx((1.0 + 0.8 + 1.0) / 3)
    assert StateGraph(n_states=4).fit(SEQUENCES, OUTCOMES).sample_period == 0.02


def test_probability_of_success_worked_by_hand():
    # b3 = 1/2; b2 = 1; b1 = 1/4 b0 + 1/2 + 1/8; b0 = 4/5 b1 + 1/5 1/2
    dut = example()
    b0 = (0.8 * 0.625 + 0.1) / (1 - 0.2)
    np.testing.assert_allclose(dut.reach_, [b0, 0.25 * b0 + 0.625, 1.0, 0.5])


def test_values_worked_by_hand():
    # V3 = d3 / 2; V2 = d2; V1 = d1 (1/4 V0 + 1/2 V2 + 1/4 V3); V0 = d0 (4/5 V1 + 1/5 V3), with d = exp(-dwell / tau)
    dut, tau = example(), 0.7
    d0, d1, d2, d3 = np.exp(-dut.dwell_mean_s_ / tau)
    v0 = d0 * (0.8 * d1 * (0.5 * d2 + 0.125 * d3) + 0.1 * d3) / (1 - 0.2 * d0 * d1)
    np.testing.assert_allclose(dut.values(tau), [v0, d1 * (0.25 * v0 + 0.5 * d2 + 0.125 * d3), d2, 0.5 * d3])


def test_desired_next_state():
    dut = example()
    assert [dut.desired_next(k) for k in range(4)] == [1, 2, None, None]
    hopeless = StateGraph().fit([[0, 1], [0, 2]], ["jammed", "inserted"])
    assert [hopeless.desired_next(k) for k in range(3)] == [2, 1, None]


def test_desired_next_state_by_its_conditional_probability():
    dut = example()
    moves, reach = dut.moves_, np.append(dut.reach_, 1.0)
    joint = moves[:, :5] * reach  # four states and the outcome "inserted"
    np.testing.assert_allclose(dut.next_given_success_, joint / joint.sum(axis=1, keepdims=True))
    failed = StateGraph().fit([[0, 1]], ["jammed"])
    assert failed.desired_next(0) == 0
    assert not failed.next_given_success_.any()


def test_success_may_have_another_name():
    dut = StateGraph(success="docked").fit([[0, 1], [0, 1]], ["docked", "lost"])
    np.testing.assert_allclose(dut.reach_, [0.5, 0.5])
    assert "P(docked)" in dut.to_frame()
    # An outcome that never occurred has probability zero.
    assert StateGraph().fit([[0]], ["jammed"]).reach_.tolist() == [0.0]


def test_transition_matrix():
    dut = StateGraph(n_states=5).fit(SEQUENCES, OUTCOMES)
    matrix = dut.transition_matrix()
    np.testing.assert_allclose(matrix.sum(axis=1), 1.0)
    assert (matrix > 0).all()
    np.testing.assert_allclose(matrix[4], 0.2)
    np.testing.assert_allclose(matrix[0], np.array([3.2, 4.2, 0.2, 1.2, 0.2]) / 9.0)


def test_states_without_visits():
    dut = StateGraph(n_states=6).fit(SEQUENCES, OUTCOMES)
    assert np.isnan(dut.reach_[4:]).all()
    assert np.isnan(dut.dwell_mean_[4:]).all()
    assert dut.desired_next(5) == 5
    np.testing.assert_array_equal(dut.values(1.0)[4:], 0.0)
    np.testing.assert_allclose(dut.reach_[:4], example().reach_)


def test_table_is_printable():
    table = str(example())
    assert "P(inserted)" in table
    assert len(table.splitlines()) == 6
    frame = example().to_frame()
    assert frame["desired_next"].tolist() == [1, 2, "inserted", "inserted"]
    assert frame["visits"].tolist() == [5, 4, 2, 2]
    assert frame.columns.tolist() == ["visits", "dwell_s", "dwell_std_s", "phase", "P(inserted)", "desired_next"]
    assert StateGraph().fit([[0, 1]], ["jammed"]).to_frame()["desired_next"].tolist() == ["-", "-"]
    assert "StateGraph" in str(StateGraph())


def test_stored_arrays_restore_the_graph(tmp_path):
    dut = StateGraph(n_states=5).fit(SEQUENCES, OUTCOMES)
    np.savez(tmp_path / "graph.npz", **dut.to_arrays())
    with np.load(tmp_path / "graph.npz", allow_pickle=False) as arrays:
        restored = StateGraph.from_arrays(arrays)
    np.testing.assert_array_equal(restored.reach_, dut.reach_)
    np.testing.assert_array_equal(restored.transition_matrix(), dut.transition_matrix())
    assert str(restored) == str(dut)
    assert restored.get_params() == dut.get_params()


@pytest.mark.parametrize(
    ("sequences", "outcomes", "message"),
    [
        ([], [], "at least one demonstration"),
        ([[0]], [], "one outcome for each demonstration"),
        ([[]], ["inserted"], "at least one sample"),
        ([[0, -1]], ["inserted"], "nearest state"),
        ([[0, 0.5]], ["inserted"], "nearest state"),
        ([[0, 9]], ["inserted"], "raise n_states"),
    ],
)
def test_wrong_sequences_are_errors(sequences, outcomes, message):
    with pytest.raises(ValueError, match=message):
        StateGraph(n_states=4).fit(sequences, outcomes)


def test_wrong_arguments_are_errors():
    for state in (-1, 4):
        with pytest.raises(ValueError, match="from 0 to 3"):
            example().desired_next(state)
    with pytest.raises(ValueError, match="seconds"):
        StateGraph(sample_period=0.0).fit(SEQUENCES, OUTCOMES)
    with pytest.raises(ValueError, match="to_arrays"):
        StateGraph.from_arrays({})


def test_times_compensate_for_dropped_samples():
    whole = StateGraph(sample_period=0.1).fit([[0, 0, 0, 1, 1, 1, 2, 2]], ["inserted"])
    thinned = StateGraph(sample_period=0.1).fit([[0, 1, 1, 2, 2]], ["inserted"], times=[[0.0, 0.3, 0.5, 0.6, 0.7]])
    np.testing.assert_allclose(thinned.dwell_mean_s_, whole.dwell_mean_s_)
    np.testing.assert_allclose(whole.dwell_mean_s_, 0.1 * whole.dwell_mean_)
    np.testing.assert_array_equal(thinned.sample_counts_, whole.sample_counts_)
    np.testing.assert_array_equal(thinned.counts_, whole.counts_)
    np.testing.assert_array_equal(thinned.dwell_mean_, [1, 2, 2])
    with pytest.raises(ValueError, match="one time for each label"):
        StateGraph().fit([[0, 1]], ["inserted"], times=[[0.0]])
    later = StateGraph(sample_period=0.1).fit([[0, 1, 1, 2, 2]], ["inserted"], times=[[5.0, 5.3, 5.5, 5.6, 5.7]])
    np.testing.assert_allclose(later.phase_, thinned.phase_)
    np.testing.assert_allclose(thinned.phase_, [0.0, 4.0 / 7.0, 6.5 / 7.0])
    for times in ([0.1, 0.1], [0.0, np.nan], [0.0, np.inf]):
        with pytest.raises(ValueError, match="times of sequence 0 do not increase"):
            StateGraph().fit([[0, 1]], ["inserted"], times=[times])
