"""Sets of demonstrations differ more than trials do: how often a difference is found where there is none, and where."""

import numpy as np
import pandas as pd
import pytest

from experiments.scoreboard.paired_statistics import wilson_over_sets
from experiments.scoreboard.summary import compare

LIMIT, SPREAD = 10.0, 0.8  # between the sets, in units of s and of the logit; the times of a set's trials: 0.3 s


def performed(rng, sets, trials, *, crossed, better=0.0):
    """The trials of a policy, each of whose skills has a share of insertions and a duration of its own."""
    taught = np.repeat(np.arange(sets), trials) if crossed else np.arange(trials * sets) % sets
    share = 1.0 / (1.0 + np.exp(-(1.0 + better + rng.normal(0.0, 2.0 * SPREAD, sets))))
    time = 3.0 - better / 2.0 + rng.normal(0.0, SPREAD, sets)
    return pd.DataFrame(
        {
            "trial": np.tile(np.arange(trials), sets) if crossed else np.arange(trials * sets),
            "demonstration_set": taught.astype(float),
            "inserted": rng.random(len(taught)) < share[taught],
            "time_s": np.clip(time[taught] + rng.normal(0.0, 0.3, len(taught)), 0.5, LIMIT),
            "time_limit_s": LIMIT,
        }
    )


def found(count, sets, seed, **one):
    """Shares of the comparisons with p < 0.05: of insertions, of times, of times with a policy without sets."""
    rng = np.random.default_rng(seed)
    p = []
    for k in range(count):
        crossed = {"crossed": k % 2 == 0}
        a, b = performed(rng, sets, 20, **crossed, **one), performed(rng, sets, 20, **crossed)
        pair = compare(a, b)
        law = b.drop_duplicates("trial").assign(demonstration_set=np.nan, inserted=True, time_s=3.0)
        p.append([pair.p, pair.p_time, compare(a.assign(inserted=True), law).p_time])
    return (np.array(p) < 0.05).mean(axis=0)


def test_nothing_is_found_where_only_the_sets_differ():
    """At 5 % with ten sets, up to the error of 300 simulations (2.5 of 1.3 %); never with four."""
    assert (found(300, 10, seed=1) <= 0.0815).all()
    assert (found(20, 4, seed=2) == 0.0).all()


def test_a_difference_is_found_over_ten_sets():
    """Mean logits of 4 and 1, mean times of 1.5 and 3 s: insertions, times, and times against a law."""
    assert (found(60, 10, seed=3, better=3.0) > [0.6, 0.85, 0.9]).all()


@pytest.mark.parametrize("sets", [4, 10])
@pytest.mark.parametrize("likeness", [5.0, 20.0])
def test_the_interval_covers_the_share_of_all_sets(sets, likeness):
    """Shares of sets are of a beta distribution with the mean 0.9 and a standard deviation of 0.12 or 0.07; each set
    performs 25 trials, whose mean has one of up to 0.06.
    """
    rng = np.random.default_rng(4)
    won = rng.binomial(25, rng.beta(0.9 * likeness, 0.1 * likeness, (2000, sets)))
    covered = [low <= 0.9 <= high for low, high in (wilson_over_sets(row, [25] * sets) for row in won)]
    assert np.mean(covered) > 0.9
