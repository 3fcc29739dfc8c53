"""Every figure against a stored description of what it draws.

After a wanted change of a figure, write the descriptions anew and look at the figure:

    UPDATE_FIGURES=1 python -m pytest tests/skill/figures
"""

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from matplotlib.axes import Axes
from matplotlib.collections import Collection, LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle
from matplotlib.text import Text
from matplotlib.ticker import FixedLocator

from skill.data.demonstration import Demonstration
from skill.data.outcome import Outcome
from skill.figures.demonstration_figure import COLOURS, plot_set
from skill.figures.paper_figures import plot_demonstration, plot_outcomes, plot_run, save_figure
from skill.figures.practice_figure import plot_practice
from tests.trajectories import make_demonstration, make_rig_run

FOLDER = Path(__file__).parent / "descriptions"

DRAWN = {
    Axes: ("xlim", "ylim", "aspect", "axisbelow"),
    Line2D: ("xdata", "ydata", "color", "linewidth", "linestyle", "drawstyle", "marker", "markersize"),
    Text: ("text", "color", "fontsize", "ha", "va"),
    Rectangle: ("bbox", "facecolor", "edgecolor", "linewidth"),
    LineCollection: ("segments", "color", "linewidth"),
    Collection: ("offsets", "sizes", "facecolor", "linewidth"),
}
"""What is told of each kind of artist. Positions on the page are left out: they depend on the fonts of the machine."""


def describe(figure: Figure) -> list[str]:
    """One line for each visible artist: its kind, data, colour and style, in the order of drawing."""
    figure.canvas.draw()
    axes = [axis for axes in figure.axes for axis in (axes.xaxis, axes.yaxis)]
    # Automatic ticks depend on the size of the axes on the page, and so on the fonts.
    automatic = [axis for axis in axes if not isinstance(axis.get_major_locator(), FixedLocator)]
    hidden = {id(artist) for axis in automatic for tick in axis.get_major_ticks() for artist in tick.findobj()}
    lines = [f"figure {shown(figure.get_size_inches())}"]
    for artist in figure.findobj():
        kind = next((kind for kind in DRAWN if isinstance(artist, kind)), None)
        if kind and artist.get_visible() and id(artist) not in hidden and (kind is not Text or artist.get_text()):
            found = [shown(getattr(artist, f"get_{name}")()) for name in ("zorder", "alpha", *DRAWN[kind])]
            lines.append(f"{type(artist).__name__} {' '.join(found)}")
    return lines


def shown(value: object) -> str:
    """Numbers with six digits; of many, only their number, sum, extremes and second moment. Else the text."""
    try:
        array = np.ravel(np.ma.filled(np.ma.asarray(np.asarray(value, dtype=float)), np.nan))
    except (TypeError, ValueError):
        return repr(value)
    if len(array) > 12:
        finite = array[np.isfinite(array)]
        array = np.array([len(array), finite.sum(), finite.min(), finite.max(), (finite**2).sum()])
    return ",".join(f"{number:.6g}" for number in array + 0.0)


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
    made, result = make_rig_run(), {"reason": "inserted", "time_s": 2.4, "tilt_deg": [1.25, -2.0]}
    return plot_run(replace(made, samples=made.samples.assign(fy=0.0), result=result))


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


def test_outcomes_need_at_least_one_trial():
    assert len(plot_outcomes(trials().assign(inserted=False)).axes) == 3
    with pytest.raises(ValueError, match="0 trials"):
        plot_outcomes(trials(0))
    with pytest.raises(ValueError, match="time_s"):
        plot_outcomes(trials().drop(columns="time_s"))


@pytest.mark.slow
@pytest.mark.parametrize("suffix", ["png", "svg", "pdf"])
def test_a_figure_is_written_atomically(tmp_path, suffix):
    path = tmp_path / f"figure.{suffix}"
    save_figure(plot_outcomes(trials()), path)
    assert path.stat().st_size > 3000
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


def test_an_unknown_format_is_named_and_nothing_written(tmp_path):
    with pytest.raises(ValueError, match=r"figure\.xyz"):
        save_figure(plot_outcomes(trials()), tmp_path / "figure.xyz")
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_figures_do_not_use_the_global_state_of_matplotlib():
    script = (
        "import sys; from tests.trajectories import *; from skill.figures.paper_figures import *; "
        "plot_demonstration(make_demonstration()); plot_run(make_rig_run()); "
        "assert 'matplotlib.pyplot' not in sys.modules; assert 'pydrake' not in sys.modules"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=Path(__file__).parents[3], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
