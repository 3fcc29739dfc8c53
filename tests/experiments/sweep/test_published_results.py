"""A published copy of results: it has one file for each policy, and no sweep goes on in it."""

import pyarrow.parquet as pq
import pytest

from docs._tools.published_results import publish
from experiments.scoreboard.queries import sweep_commands
from experiments.scoreboard.result_store import read_trials
from experiments.scoreboard.summary import make_scoreboard

pytestmark = pytest.mark.slow


def test_a_copy_has_the_rows_and_no_sweep_goes_on_in_it(specification, perform, tmp_path):
    push = {"make": "tests.experiments.sweep.pushes:push"}
    keys = {"policies": {"push": push}, "vary": {"contact.friction": [0.1, 0.3]}}
    trials = {"first": 84099, "number": 2}  # in two blocks of each cell
    rows = perform(specification(**keys, trials=trials))
    publish(tmp_path / "results", tmp_path / "published")
    (file,) = (tmp_path / "published" / "trials").rglob("*.parquet")
    copy = pq.ParquetFile(file).read().to_pandas()
    assert "scenario" not in copy
    assert sorted(copy.key) == sorted(rows.key)
    with pytest.raises(ValueError, match="holds a published copy of results, with which no sweep goes on"):
        perform(specification(**keys, trials=trials), results="published")
    (command,) = sweep_commands(make_scoreboard(read_trials(tmp_path / "published")))
    assert command == f"haptic-skill sweep {tmp_path}/published/sweeps/sweep.yaml --out out/sweeps/published"
