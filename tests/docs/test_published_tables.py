"""The tables of the site are made of the published trials."""

import sys

import pandas as pd
import pytest

from experiments.scoreboard.result_store import read_trials
from experiments.scoreboard.summary import make_scoreboard
from tests.scripts.commands import ROOT

sys.path.append(str(ROOT / "docs" / "_extensions"))
published_tables = pytest.importorskip("published_tables", reason="needs Sphinx, the extra [docs]")

CONDITIONS = ["policy", "trial_set", "engine", "factors"]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ladder", "arms"])
def test_each_policy_has_a_row_for_each_of_its_conditions(name):
    board = make_scoreboard(read_trials(ROOT / "docs" / name))
    text = published_tables.tables(board, name).replace("\N{NO-BREAK SPACE}", " ")
    rows = pd.read_parquet(
        ROOT / "docs" / name / "trials", columns=["policy", "trial_set", "engine", "factors", "inserted"]
    )
    found = rows.groupby(["policy", "trial_set", "engine", "factors"], observed=True).inserted.agg(["sum", "count"])
    lines = [
        line
        for line in text.splitlines()
        if line.startswith("| ") and not line.startswith(("| ---", "| policy", "| cond"))
    ]
    assert len(lines) == len(found)
    for (policy, *_), (inserted, number) in found.iterrows():
        assert any(f"| {policy} |" in line and f"| {inserted} of {number} (" in line for line in lines), policy
    assert text.count("haptic-skill sweep docs/") == len(list((ROOT / "docs" / name / "sweeps").glob("*.yaml")))
