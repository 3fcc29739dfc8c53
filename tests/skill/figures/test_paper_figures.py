import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from skill.data.demonstration import CHANNELS
from skill.figures.paper_figures import plot_demonstration, plot_outcomes, plot_run, save_figure
from tests.trajectories import make_demonstration, make_rig_run


def make_outcomes(inserted: list[bool]) -> pd.DataFrame:
    n = len(inserted)
    return pd.DataFrame(
        {
            "inserted": inserted,
            "time_s": np.arange(1.0, n + 1),
            "peak_load_n": np.arange(1.0, n + 1) * 10,
            "peak_contact_n": np.arange(1.0, n + 1) * 20,
        }
    )


def test_every_channel_of_a_demonstration_is_drawn_in_its_unit():
    demonstration = make_demonstration()
    figure = plot_demonstration(demonstration)
    drawn = [line.get_ydata() for axes in figure.axes for line in axes.lines if len(line.get_ydata())]
    factors = dict.fromkeys(("x", "y", "z", "mx", "my", "mz"), 1000.0) | {c: np.degrees(1) for c in ("angle", "dangle")}
    for channel in CHANNELS:
        expected = factors.get(channel, 1.0) * demonstration.samples[channel].to_numpy()
        assert any(np.allclose(expected, values) for values in drawn), channel
    assert len(drawn) == len(CHANNELS) == 14


def test_medians_are_those_of_the_inserted():
    figure = plot_outcomes(make_outcomes([True, True, True, False]))
    assert [axes.texts[0].get_text() for axes in figure.axes] == ["2", "20", "40"]
    assert [t.get_text() for t in figure.legends[0].get_texts()][:2] == ["inserted: 3", "not inserted: 1"]


def test_the_largest_magnitudes_of_a_run_are_given_in_their_units():
    run = make_rig_run()
    samples = run.samples.copy()
    for k, name in enumerate(("fx", "fy", "fz", "mx", "my", "depth")):
        samples[name] = 0.0
        samples.loc[[3, 5], name] = [0.001 * (k + 1), -0.002 * (k + 1)]
    series = plot_run(replace(run, samples=samples)).axes[0]
    (right,) = series.child_axes
    texts = [t.get_text() for t in right.get_yticklabels()]
    assert texts == ["1 = 0.002 N", "1 = 0.004 N", "1 = 0.006 N", "1 = 8 N mm", "1 = 10 N mm", "1 = 12 mm"]
    np.testing.assert_allclose(right.get_yticks(), [0.0, -2.3, -4.6, -6.9, -9.2, -11.5])
    curves = [line.get_ydata() for line in series.lines if len(line.get_ydata()) == len(samples)]
    for height, curve, sign in zip(right.get_yticks(), curves, (1, 1, 1, 1, 1, -1), strict=True):
        np.testing.assert_allclose(curve[[0, 3, 5]] - height, np.array([0.0, 0.5, -1.0]) * sign, atol=1e-12)


def test_a_series_that_is_zero_stays_on_its_line():
    run = make_rig_run()
    series = plot_run(replace(run, samples=run.samples.assign(fy=0.0))).axes[0]
    curves = [line.get_ydata() for line in series.lines if len(line.get_ydata()) == len(run.samples)]
    np.testing.assert_allclose(curves[1], -2.3)


def test_outcomes_need_at_least_one_trial():
    assert len(plot_outcomes(make_outcomes([False, False])).axes) == 3
    with pytest.raises(ValueError, match="0 trials"):
        plot_outcomes(make_outcomes([]))
    with pytest.raises(ValueError, match="time_s"):
        plot_outcomes(make_outcomes([True]).drop(columns="time_s"))


@pytest.mark.slow
@pytest.mark.parametrize("suffix", ["png", "svg", "pdf"])
def test_a_figure_is_written_atomically(tmp_path, suffix):
    path = tmp_path / f"figure.{suffix}"
    save_figure(plot_outcomes(make_outcomes([True, False])), path)
    assert path.stat().st_size > 3000
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


def test_an_unknown_format_is_named_and_nothing_written(tmp_path):
    with pytest.raises(ValueError, match=r"figure\.xyz"):
        save_figure(plot_outcomes(make_outcomes([True])), tmp_path / "figure.xyz")
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
