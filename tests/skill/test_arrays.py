import numpy as np

from skill.arrays import sequences


def test_sequences_are_the_rows_of_each_group_in_their_order():
    found = list(sequences(np.array([2, 0, 2, 0, 1])))
    assert [rows.tolist() for rows in found] == [[1, 3], [4], [0, 2]]
    alternating = np.arange(1000) % 3
    for k, rows in enumerate(sequences(alternating)):
        assert rows.tolist() == list(range(k, 1000, 3))
