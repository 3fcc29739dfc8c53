"""The table of a comparison and the choice of its policies."""

import numpy as np
import pytest
from statsmodels.stats.contingency_tables import mcnemar as reference
from statsmodels.stats.proportion import proportion_confint

from benchmarks.rig.comparison import PRODUCT, compare, mcnemar, selected, wilson
from benchmarks.rig.trials import Entry


@pytest.mark.parametrize(("successes", "n"), [(0, 20), (1, 20), (13, 20), (20, 20), (99, 100)])
def test_the_interval_is_wilsons(successes, n):
    assert wilson(successes, n) == pytest.approx(proportion_confint(successes, n, method="wilson"), abs=1e-6)


def test_the_paired_test_is_the_exact_one_of_mcnemar():
    rng = np.random.default_rng(3)
    a, b = (rng.random(40) < share for share in (0.9, 0.6))
    rows = [[{"seed": k, "inserted": bool(x)} for k, x in enumerate(values)] for values in (a, b)]
    table = [[int((a & b).sum()), int((a & ~b).sum())], [int((~a & b).sum()), int((~a & ~b).sum())]]
    assert mcnemar(*rows) == pytest.approx(reference(table, exact=True).pvalue)
    assert mcnemar(rows[0], rows[1][:20]) == mcnemar(rows[0][:20], rows[1][:20])  # trials of one policy do not count
    assert mcnemar(rows[0], rows[0]) == 1.0


def test_every_policy_is_compared_with_the_product(setting, performed, push, tmp_path):
    rows = compare("two", [Entry("push", push), Entry(PRODUCT, push)], setting, tmp_path / "two.json")
    assert [row["p"] for row in rows] == [1.0, None]
    rows = compare("one", [Entry("push", push)], setting, None)
    assert rows[0]["p"] is None


def test_a_policy_whose_training_fails_does_not_stop_the_others(setting, performed, push, tmp_path, capsys):
    def broken(setting, record, advance, number):
        raise FloatingPointError("no such number")

    rows = compare("both", [Entry("broken", broken), Entry("push", push)], setting, tmp_path / "both.json")
    assert rows[0]["error"] == "set 1 not trained: FloatingPointError: no such number"
    assert rows[1]["inserted"] == 3
    assert "no such number" in capsys.readouterr().out
    assert (tmp_path / "both.json").stat().st_size > 100


def test_policies_are_selected_by_a_part_of_their_name(push):
    entries = [Entry("LWR without states", push), Entry("CA states + LWR", push), Entry("no correction", push)]
    assert selected(entries, None) == entries
    assert selected(entries, ["lwr"]) == entries[:2]
    with pytest.raises(ValueError, match=r"--only \['transformer'\] matches none of the policies"):
        selected(entries, ["transformer"])
