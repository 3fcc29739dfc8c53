"""A published copy of results: it has one file for each policy, and a sweep goes on from what is restored of it."""

import pyarrow.parquet as pq
import pytest

from docs._tools.published_results import publish
from docs._tools.restored_results import restore
from experiments.scoreboard.queries import sweep_commands
from experiments.scoreboard.result_store import read_trials
from experiments.scoreboard.summary import make_scoreboard
from tests.experiments.scoreboard.simulated_trials import write_sweep, write_trials
from tests.experiments.sweeps.conftest import rows_in

pytestmark = pytest.mark.slow
PUSH = {"make": "tests.experiments.sweeps.pushes:push"}


@pytest.mark.nightly
def test_a_sweep_goes_on_from_restored_rows(specification, perform, tmp_path, capsys):
    keys = {"policies": {"push": PUSH}, "vary": {"contact.friction": [0.1, 0.3]}}
    rows = perform(specification(**keys, trials={"first": 84099, "number": 2}))  # in two blocks of each cell
    publish(tmp_path / "results", tmp_path / "published")
    (file,) = (tmp_path / "published" / "trials").rglob("*.parquet")
    assert "scenario" not in pq.read_schema(file).names
    assert restore(tmp_path / "published", tmp_path / "restored") == (4, 4)
    assert rows_in(tmp_path / "restored").equals(rows)  # the scenarios too
    assert restore(tmp_path / "published", tmp_path / "restored") == (0, 4)  # they are there
    capsys.readouterr()
    more = perform(specification(**keys, trials={"first": 84099, "number": 3}), results="restored")
    assert "6 trials, 4 of them done already" in capsys.readouterr().out
    assert more[more.key.isin(rows.key)].reset_index(drop=True).equals(rows)

    with pytest.raises(ValueError, match="holds a published copy of results, with which no sweep goes on"):
        perform(specification(**keys, trials={"first": 84099, "number": 2}), results="published")
    (command,) = sweep_commands(make_scoreboard(read_trials(tmp_path / "published")))
    assert command == f"haptic-skill sweep {tmp_path}/published/sweeps/sweep.yaml --out out/sweeps/published"


def test_rows_of_other_code_are_not_restored(specification, perform, tmp_path, monkeypatch):
    perform(specification(policies={"push": PUSH}, trials={"first": 84000, "number": 1}))
    publish(tmp_path / "results", tmp_path / "published")
    monkeypatch.setattr("experiments.sweeps.trial_rows.trial_code", lambda: "other")
    assert restore(tmp_path / "published", tmp_path / "restored") == (0, 1)
    assert not (tmp_path / "restored").exists()


def test_a_published_copy_is_not_replaced_by_nothing(tmp_path):
    write_sweep(tmp_path / "results")
    write_trials(tmp_path / "results", [{}])
    publish(tmp_path / "results", tmp_path / "copy")
    (tmp_path / "copy" / "scoreboard.html").write_text("its page")
    before = sorted(tmp_path.rglob("copy/**/*"))
    with pytest.raises(ValueError, match="expected a folder that haptic-skill sweep wrote"):
        publish(tmp_path / "none", tmp_path / "copy")
    assert sorted(tmp_path.rglob("copy/**/*")) == before
    publish(tmp_path / "results", tmp_path / "copy")
    with pytest.raises(ValueError, match=r"results: holds .*0000.parquet, which is not replaced"):
        publish(tmp_path / "results", tmp_path / "results")  # results are no published copy
