import numpy as np

from skill.states.estimate import Estimate


def acted(skill, rows):
    """Actions with and without an estimate, as exact texts."""
    estimate = Estimate(np.full(skill.n_states, 1 / skill.n_states))
    return [
        [v.hex() for v in (*map(float, a.turn), a.feed, a.support)]
        for row in rows
        for a in (skill.act(row), skill.act(row, estimate))
    ]
