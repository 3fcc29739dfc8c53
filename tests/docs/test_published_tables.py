"""The figures of the site, and those of README, are those of the published trials."""

import sys

import pytest

from tests.checkout import ROOT

sys.path.append(str(ROOT / "docs" / "_extensions"))
published_tables = pytest.importorskip("published_tables", reason="needs Sphinx, the extra [docs]")


@pytest.fixture(scope="module")
def arms():
    return published_tables.published(ROOT / "docs" / "arms")


def test_a_table_counts_the_insertions(arms):
    assert published_tables.inserted(arms[arms.policy == "skill"]) == "196 of 200"
    table = published_tables.insertions(arms, ["policy"], ["trial_set", "engine"])
    assert table.loc[table.policy == "skill"].to_numpy().tolist() == [["skill", "196 of 200"]]
    lines = published_tables.markdown(published_tables.summary(arms)).splitlines()
    assert len(lines) == 2 + arms.policy.nunique()
    assert lines[-1].endswith("| straight push | 13 of 20 | 6.4 | 41.65 | 100.0 | 0 |")


@pytest.mark.parametrize(
    ("name", "query", "row"),
    [
        ("fresh", "policy == 'skill' and engine == 'exact'", "| {} of 400 | {} of 400 | `haptic"),
        ("fresh", "policy == 'skill with corrections' and engine == 'exact'", "| {} of 400 | {} of 400 | the same |"),
        ("learning", "policy == 'skill' and value == 10", "| {} of 1,000 (998) | {} of 1,000 (982) |"),
        ("sections", "policy == 'skill with corrections'", "| {:,} of 2,000 | {:,} of 2,000 |"),
        ("scoreboard", "policy == 'CA states + LWR'", "| {}, 98, 91 of 100 | {}, 90, 83 of 100 |"),
    ],
)
def test_the_results_of_readme_are_those_of_the_rows(name, query, row):
    rows = published_tables.published(ROOT / "docs" / name).query(
        f"{query} and factor in ['', 'training.size', 'section']"
    )
    assert row.format(*rows.groupby("trial_set", observed=True).inserted.sum()) in (ROOT / "README.md").read_text()
