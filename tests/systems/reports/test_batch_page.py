import math
import re
from dataclasses import replace

import numpy as np
import pytest

from models.scenario import Scenario
from scripts.run_rig import write_report
from skill.data.outcome import Outcome
from skill.data.rig_run import write_rig_run
from systems.reports.batch_page import batch_report, worst_trial
from systems.reports.histogram import bin_edges, histogram, nice_step
from systems.runs.trial_result import TrialResult
from tests.browser import blankness, open_page
from tests.trajectories import STATE_NAMES, make_rig_run

PLAIN = TrialResult(
    seed=0,
    tilt=(math.radians(1.0), math.radians(-2.0)),
    outcome=Outcome.INSERTED,
    time=2.5,
    depth=0.0247,
    peak_axial_force=6.0,
    peak_lateral_force=12.0,
    peak_moment=0.1,
    penetration=20e-6,
    steps=20,
    lost_steps=0,
    back_offs=0,
    unknown_time=0.1,
    unsupported_time=0.0,
    states=(0, 1, 2, 3),
)


def make_results(n=12):
    rng = np.random.default_rng(1)
    results = [
        replace(PLAIN, seed=k, time=round(float(t), 3), peak_lateral_force=round(float(f), 1))
        for k, (t, f) in enumerate(zip(rng.uniform(2, 5, n), rng.uniform(5, 40, n), strict=True))
    ]
    results[4] = replace(results[4], outcome=Outcome.TIME_OVER, time=10.0, depth=0.011, back_offs=5)
    return results


def page_of(results, **changes):
    about = {"title": "t", "state_names": STATE_NAMES, "replay": "r.html", "made_by": {}, "scenario": "seed: 0\n"}
    return batch_report(results, **{**about, **changes})


# ------------------------------------------------------------------ worst trial


def test_the_worst_is_the_shallowest_that_failed():
    deeper = replace(PLAIN, seed=1, outcome=Outcome.TIME_OVER, depth=0.020, peak_lateral_force=99.0)
    shallower = replace(PLAIN, seed=2, outcome=Outcome.TIME_OVER, depth=0.003, peak_lateral_force=1.0)
    assert worst_trial([PLAIN, deeper, shallower]) is shallower


def test_where_all_inserted_the_worst_pushed_hardest_across():
    hard = replace(PLAIN, seed=1, peak_lateral_force=40.0)
    long_ = replace(PLAIN, seed=2, time=9.0, peak_axial_force=90.0)
    assert worst_trial([PLAIN, hard, long_]) is hard


# -------------------------------------------------------------------- histogram


@pytest.mark.parametrize(
    ("span", "maximum", "step"), [(10, 10, 1), (10.1, 10, 2), (0.3, 10, 0.05), (45, 10, 5), (0, 5, 0.2)]
)
def test_steps_are_round_and_no_more_than_asked(span, maximum, step):
    assert nice_step(span, maximum) == pytest.approx(step)


@pytest.mark.parametrize("values", [[0.0], [0.0, 0.0], [1.0, 10.0], [2.999, 3.0], list(range(100))])
def test_every_value_lies_in_a_bin(values):
    edges = bin_edges(np.array(values, dtype=float))
    assert edges[0] == 0
    assert edges[-1] > max(values)
    assert len(edges) <= 30


def test_bars_are_as_high_as_their_counts():
    """Three of five in the first bin, one of them not good; the tallest bar fills the height."""
    drawn = histogram(np.array([0.1, 0.1, 0.1, 9.9, 9.9]), np.array([True, True, False, True, True]), unit="s")
    bars = re.findall(r'<rect [^>]*height="([\d.]+)" fill="(#\w+)"', drawn)
    heights = {colour: [float(h) for h, c in bars if c == colour] for _, colour in bars}
    unit = heights["#c1121f"][0]
    assert heights["#0072b2"] == pytest.approx([2 * unit, 2 * unit], rel=0.01)
    assert ">0.1 s<" in drawn  # the median


# ------------------------------------------------------------------------- page


def test_the_summary_counts_and_gives_wilsons_interval():
    page = page_of(make_results(10))
    assert "9 of 10" in page
    assert "59.6 to 98.2 %" in page  # of 9 in 10, Wilson 1927
    assert "back-offs, in 1 of the trials" in page


def test_what_is_named_oddly_is_shown_and_not_obeyed():
    odd = replace(PLAIN, outcome=Outcome.DIVERGED, detail='<b>"x" & y</b>')
    page = page_of([odd], title="<script>alert(1)</script>", made_by={"skill": "<i>.npz"}, scenario="a: <b>")
    assert "<script>alert" not in page
    assert page.count("<script>") == 1
    assert "&lt;b&gt;&quot;x&quot; &amp; y&lt;/b&gt;" in page


@pytest.fixture
def batch(tmp_path):
    results = make_results()
    for r in results:
        write_rig_run(make_rig_run(), tmp_path / f"run_{r.seed:04d}.parquet")
    write_report(results, tmp_path, title="twelve insertions", skill="skill.npz", scenario=Scenario())
    return tmp_path, results


def test_the_report_opens_from_disk_with_a_row_a_trial_and_its_link_leads_to_a_replay(batch):
    folder, results = batch
    with open_page(folder / "report.html", size=(1366, 768)) as page:
        page.wait("document.readyState === 'complete'")
        assert page.run("return document.querySelectorAll('#trials tbody tr').length") == len(results)
        assert page.run("return document.querySelectorAll('#trials tr.failed').length") == 1
        assert page.run("return document.querySelectorAll('svg rect').length") > 8
        wide = "return document.documentElement.scrollWidth <= window.innerWidth"
        assert page.run(wide), "the page is wider than a laptop's screen"
        column = page.run("return [...document.querySelectorAll('th')].findIndex(h => h.innerText.startsWith('time'))")
        shown = []
        for _ in range(2):
            page.run("document.querySelectorAll('th')[arguments[0]].click()", column)
            shown.append(
                page.run(
                    "return [...document.querySelector('tbody').rows].map(r => +r.cells[arguments[0]].innerText)",
                    column,
                )
            )
        assert shown[0] == sorted(shown[0])
        assert shown[1] == shown[0][::-1]
        seen = blankness(page.screenshot())
        assert seen.colours > 15
        assert seen.drawn > 0.03
        link = page.run("return document.querySelector('#worst a').getAttribute('href')")
        assert page.errors() == []
        assert page.requests() == []
    assert link == "replay_0004.html"
    assert "<title>trial 4</title>" in (folder / link).read_text()[:500]
