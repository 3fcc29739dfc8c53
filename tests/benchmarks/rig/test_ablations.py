"""The entries of the ablations and their figure."""

from benchmarks.rig import ablations, peers
from benchmarks.rig.comparison import compare
from benchmarks.rig.trials import Entry


def test_the_figures_are_drawn_from_the_performed_arms(setting, performed, push, tmp_path):
    names = ("raw features", ablations.PRODUCT)
    summaries = compare("some", [Entry(name, push) for name in names], setting, None)
    ablations.draw(summaries, tmp_path / "ablations.svg")
    assert (tmp_path / "ablations.svg").stat().st_size > 10_000


def test_every_row_of_the_figure_is_an_arm_and_no_two_arms_share_a_file(tmp_path):
    entries = ablations.entries([tmp_path])
    names = {entry.name for entry in entries}
    assert {name for _, rows in ablations.GROUPS for _, name in rows} <= names
    both = {entry.name: entry.file for entry in [*entries, *peers.entries(24)]}
    assert len(set(both.values())) == len(both)
    # The two comparisons share the results of their common entries.
    shared = {ablations.PRODUCT, ablations.STATELESS, ablations.CONTEXTLESS, ablations.CONTEXTS_ALONE}
    assert shared <= {entry.name for entry in peers.entries(24)}
