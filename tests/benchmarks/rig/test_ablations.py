"""The entries of the ablations, the sets of the learning curve, and the figures."""

import pytest

from benchmarks.rig import ablations, peers
from benchmarks.rig.comparison import compare
from benchmarks.rig.trials import Entry


def test_the_figures_are_drawn_from_the_performed_arms(setting, performed, push, tmp_path):
    names = ("1 demonstration", "3 demonstrations", "raw features", ablations.PRODUCT)
    summaries = compare("some", [Entry(name, push) for name in names], setting, None)
    ablations.draw(summaries, tmp_path, whole=30)
    assert (tmp_path / "learning_curve.svg").stat().st_size > 10_000
    assert (tmp_path / "ablations.svg").stat().st_size > 10_000


def test_every_row_of_the_figure_is_an_arm_and_no_two_arms_share_a_file(tmp_path):
    entries = ablations.entries(tmp_path)
    names = {entry.name for entry in entries}
    assert {name for _, rows in ablations.GROUPS for _, name in rows} <= names
    assert {ablations.curve_name(size) for size in ablations.SIZES} <= names
    both = {entry.name: entry.file for entry in [*entries, *peers.entries(24)]}
    assert len(set(both.values())) == len(both)
    # The two comparisons share the results of their common entries.
    shared = {ablations.PRODUCT, ablations.STATELESS, ablations.CONTEXTLESS, ablations.CONTEXTS_ALONE}
    assert shared <= {entry.name for entry in peers.entries(24)}


@pytest.mark.parametrize("size", [1, 2, 3, 5])
def test_small_sets_have_the_right_size_and_a_good_demonstration(demonstrations, size):
    chosen = ablations.drawn(size)(demonstrations, 2)
    assert len(chosen) == size
    assert chosen[0].good
    assert {id(d) for d in ablations.drawn(1)(demonstrations, 2)} <= {id(d) for d in chosen}
