"""The benchmark of recordings, on recordings that it has made itself."""

import json

import numpy as np
import pandas as pd
import pytest

pytest.importorskip("hmmlearn", reason="needs the extra [peers]")
pytest.importorskip("ruptures", reason="needs the extra [peers]")


from benchmarks.learners.state_learners import Samples
from benchmarks.recordings import PEERS, TOLD, change_points, lasting, main, selected
from skill.recordings.recording import Recording
from tests.state_recordings import CHANNELS, three_contacts


def three_phases(n_trials=6):
    """Arrays of trials of three contacts, whose phases are numbers."""
    tables = [three_contacts(seed).assign(trial=seed) for seed in range(1, n_trials + 1)]
    table = pd.concat(tables, ignore_index=True)
    phase = pd.Categorical(table["phase"], ["reach <i>", "touch", "press"]).codes.astype(int)
    return {
        "time": table["time"].to_numpy(),
        "wrench": table[list(CHANNELS)].to_numpy(),
        "trial": table["trial"].to_numpy(),
        "phase": phase,
    }


@pytest.mark.nightly
def test_figures_of_all_learners(tmp_path, capsys):
    data, out = tmp_path / "three.npz", tmp_path / "figures.json"
    np.savez(data, **three_phases())
    main(data=data, train_trials="1-3", test_trials="4,5-6", json=out)
    figures = json.loads(out.read_text())
    keys = {"states", "ari", "nmi", "boundary_f1"}
    assert figures["states"] == 3
    assert min(figures[key] for key in keys) > 0.9
    assert set(figures["peers"]) == {*PEERS, *(f"{name}, told 3" for name in TOLD)}
    assert all(set(row) == keys for row in figures["peers"].values())
    assert min(figures["peers"][name]["ari"] for name in ("CompetitiveAgglomeration", "GMM-BIC")) > 0.9
    assert figures["on_line"]["accuracy"] > 0.9
    assert 0.0 <= figures["on_line"]["delay_mean_s"] < 0.2
    assert "ContactStates" in capsys.readouterr().out


def samples(**changes):
    arrays = three_phases()
    parts = {"Z": arrays["wrench"], "times": arrays["time"], "groups": arrays["trial"], "labels": arrays["phase"]}
    return Samples(**{**parts, **changes})


def test_change_points_are_counted_from_the_beginning_of_each_trial():
    data = samples()
    number, states, _ = change_points(data, data, 0, 3)
    assert number == 3
    assert (states == data.labels).mean() > 0.95
    constant = samples(Z=np.random.default_rng(0).normal(size=data.Z.shape))
    assert change_points(constant, constant, 0, None)[0] == 1


@pytest.mark.parametrize(
    ("phases", "expected"),
    [
        ([0, 0, 0, 1, 2, 2, 2], [0, 0, 0, 2, 2, 2, 2]),
        ([1, 2, 2, 2, 3], [2, 2, 2, 2, 3]),  # the last one has no next one
        ([0, 0, 0, 1, 1, 3, 0, 0, 0], [0, 0, 0, 0, 0, 0, 0, 0, 0]),
        ([4, 4, 4], [4, 4, 4]),
    ],
)
def test_brief_phases_count_as_the_next_one(phases, expected):
    assert lasting(np.array(phases)).tolist() == expected


def recording(trial, phases=(0, 0, 1)):
    values = np.zeros((3, 1))
    return Recording(f"x, trial {trial}", np.arange(3.0), values, ("fx",), phases and np.array(phases), trial)


def test_trials_are_chosen_by_their_numbers():
    recordings = [recording(trial) for trial in ("1", "2", "3", "5", "7")]
    assert [r.trial for r in selected(recordings, "1-3,7", 50.0)] == ["1", "2", "3", "7"]
    with pytest.raises(ValueError, match=r"no trials \[4\]; there are 1, 2, 3, 5, 7"):
        selected(recordings, "3-5", 50.0)
    with pytest.raises(ValueError, match="trials '1-', expected numbers such as"):
        selected(recordings, "1-", 50.0)
    with pytest.raises(ValueError, match="no phases, expected an array 'phase' of integers"):
        selected([recording("1", ("a", "a", "b"))], "1", 50.0)
