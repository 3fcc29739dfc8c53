"""Every figure against a stored description of what it draws.

After a wanted change of a figure, write the descriptions anew and look at the figure:

    UPDATE_FIGURES=1 python -m pytest tests/skill/figures/test_figure_descriptions.py
"""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

from skill.data.demonstration import Demonstration
from skill.data.outcome import Outcome
from skill.figures.demonstration_figure import COLOURS, plot_set, summarise
from skill.figures.paper_figures import plot_demonstration, plot_outcomes, plot_run
from skill.figures.practice_figure import plot_practice
from tests.skill.figures.description import describe
from tests.trajectories import make_demonstration, make_rig_run

FOLDER = Path(__file__).parent / "descriptions"


def trials(number: int = 5, slower: float = 1.0) -> pd.DataFrame:
    k = np.arange(1.0, number + 1)
    return pd.DataFrame(
        {
            "inserted": k != 3,
            "time_s": slower * (2.0 + np.sin(k)),
            "peak_load_n": 10.0 + 3.0 * k,
            "peak_contact_n": 15.0 + 4.0 * k,
            "peak_lateral_n": slower * (20.0 + 5.0 * np.cos(k)),
        }
    )


def practice() -> Figure:
    rounds = np.repeat([0, 1, 2], 4)
    costs = 5.0 - rounds + 0.3 * np.cos(np.arange(12.0))
    return plot_practice(
        pd.DataFrame({"round": rounds, "cost": costs, "kept": rounds != 1}), trials(slower=1.3), trials()
    )


def run() -> Figure:
    made = make_rig_run()
    return plot_run(replace(made, result={"reason": "inserted", "time_s": 2.4, "tilt_deg": [1.25, -2.0]}))


def run_with_long_names() -> Figure:
    names = ["free", "against the chamfer of the hole", "c", "d", "e"]
    return plot_run(replace(make_rig_run(), metadata={"state_names": names}))


def demonstration_set() -> Figure:
    outcomes = ["inserted", "inserted", "inserted roughly", "jammed", "another word", "fault"]
    demonstrations = []
    for k, outcome in enumerate(outcomes):
        metadata = {"habit": "expert" if k < 3 else "slams", "operator": k % 2} if k != 3 else {}
        made = make_demonstration(tilt=0.03 + 0.01 * k, **metadata)
        demonstrations.append(Demonstration(made.samples, k < 2, outcome, made.metadata))
    return plot_set(demonstrations, rough_force=30.0)


FIGURES = {
    "demonstration": lambda: plot_demonstration(make_demonstration()),
    "run": run,
    "run_with_long_names": run_with_long_names,
    "outcomes": lambda: plot_outcomes(trials().assign(seed=np.arange(7, 12))),
    "many_outcomes": lambda: plot_outcomes(trials(30)),
    "practice": practice,
    "demonstration_set": demonstration_set,
}


@pytest.mark.slow
@pytest.mark.parametrize("name", FIGURES)
def test_a_figure_matches_its_stored_description(name):
    found = "\n".join(describe(FIGURES[name]())) + "\n"
    path = FOLDER / f"{name}.txt"
    if os.environ.get("UPDATE_FIGURES"):
        path.parent.mkdir(exist_ok=True)
        path.write_text(found)
    assert found.splitlines() == path.read_text().splitlines()


def test_every_outcome_has_its_own_colour():
    assert set(COLOURS) == set(Outcome)
    assert len(set(COLOURS.values())) == len(COLOURS)


def test_an_unknown_outcome_is_drawn_as_other():
    made = make_demonstration()
    foreign = Demonstration(made.samples, False, "dropped", made.metadata)
    figure = plot_set([foreign, made], rough_force=30.0)
    assert [t.get_text() for t in figure.axes[0].get_legend().get_texts()] == ["inserted", "other"]


def test_a_summary_holds_peak_force_duration_and_the_tilt_at_the_start():
    samples = make_demonstration().samples.head(4).copy()
    samples["time"] = [1.0, 1.25, 1.5, 2.0]
    samples["angle"], samples["dangle"] = [0.05, 0.04, 0.06, 0.01], [0.0, 0.01, 0.02, 0.05]
    samples[["fx", "fy", "fz"]] = [[0.0, 0.0, 1.0], [2.0, -3.0, 6.0], [0.0, 4.0, 3.0], [5.0, 0.0, 0.0]]
    first = Demonstration(samples, True, Outcome.INSERTED, {"habit": "expert", "operator": 3})
    second = Demonstration(samples.tail(3), False, Outcome.JAMMED)
    assert summarise([first, second]).to_dict("records") == [
        {"habit": "expert", "person": 3, "good": True, "outcome": Outcome.INSERTED, "peak_force": 7.0, "time": 1.0,
         "tilt": 0.05},
        {"habit": "unknown", "person": 0, "good": False, "outcome": Outcome.JAMMED, "peak_force": 7.0, "time": 0.75,
         "tilt": 0.04},
    ]  # fmt: skip
