import re
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from experiments.outputs.output_set import open_set
from experiments.outputs.set_index import RUNS, SetIndex
from interfaces.reports.batch_page import batch_report, worst_trial
from scripts.rig import write_report
from skill.data.outcome import Outcome
from skill.data.rig_run import write_rig_run
from tests.browser import blankness, open_page
from tests.trajectories import STATE_NAMES, make_rig_run
from tests.trial_results import PLAIN


def make_results(n=12):
    rng = np.random.default_rng(1)
    results = [
        replace(PLAIN, seed=k, time=round(float(t), 3), peak_load=round(float(f), 1))
        for k, (t, f) in enumerate(zip(rng.uniform(2, 5, n), rng.uniform(5, 40, n), strict=True))
    ]
    results[4] = replace(results[4], outcome=Outcome.TIME_OVER, time=10.0, depth=0.011, back_offs=5)
    return results


def page_of(results, **changes):
    arguments = {
        "title": "t",
        "state_names": STATE_NAMES,
        "replays": {0: "r.html", 7: "s.html"},
        "made_by": {},
        "scenario": "seed: 0\n",
    }
    return batch_report(results, **{**arguments, **changes})


# ------------------------------------------------------------------ worst trial


def test_worst_trial_is_the_shallowest_failure():
    deeper = replace(PLAIN, seed=1, outcome=Outcome.TIME_OVER, depth=0.020, peak_load=99.0)
    shallower = replace(PLAIN, seed=2, outcome=Outcome.TIME_OVER, depth=0.003, peak_load=1.0)
    assert worst_trial([PLAIN, deeper, shallower]) is shallower


def test_worst_trial_of_insertions_has_the_largest_load():
    hard = replace(PLAIN, seed=1, peak_load=40.0)
    slow = replace(PLAIN, seed=2, time=9.0, peak_axial_force=90.0, peak_lateral_force=90.0)
    assert worst_trial([PLAIN, hard, slow]) is hard


# ------------------------------------------------------------------------- page


def test_summary_gives_counts_and_the_wilson_interval():
    page = page_of(make_results(10))
    assert "9 of 10" in page
    assert "59.6 to 98.2 %" in page  # for 9 of 10, Wilson 1927
    assert "back-offs, in 1 of the trials" in page


def test_text_that_looks_like_html_is_shown_as_text():
    odd = replace(PLAIN, outcome=Outcome.DIVERGED, detail='<b>"x" & y</b>')
    page = page_of([odd], title="<script>alert(1)</script>", made_by={"skill": "<i>.npz"}, scenario="a: <b>")
    assert "<script>alert" not in page
    assert page.count("<script>") == 1
    assert "&lt;b&gt;&quot;x&quot; &amp; y&lt;/b&gt;" in page


def test_dollar_signs_and_names_of_placeholders_are_shown_as_text():
    page = page_of([PLAIN], title="$style ${script}", made_by={"$rows": "100 $"}, scenario="a: $title")
    assert "<h1>$style ${script}</h1>" in page
    assert "<dt>$rows</dt><dd>100 $</dd>" in page
    assert ">a: $title</pre>" in page


def test_columns_show_the_units_of_their_headings():
    result = replace(PLAIN, seed=7, unsupported_time=0.25, unknown_time=0.5, penetration=31.4e-6)
    row = page_of([result]).split("<tbody>")[1].split("</tbody>")[0]
    cells = re.findall(r"<td [^>]*>(.*?)</td>", row)
    assert cells[0] == '<a href="s.html">7</a>'
    assert cells[1:6] == ["+1.0 -2.0", "inserted", "2.50", "24.7", "16.0"]
    assert cells[6].count("<i ") == 4
    assert cells[7:14] == ["15.0", "31", "trusted", "20", "0", "0.50", "0.25"]
    assert cells[14:] == ["0.25", "8.0", "0.125", "6.0", "12.0", "0.10", "0"]


def test_summary_gives_the_forces_and_counts_what_is_not_trusted():
    harder = replace(PLAIN, peak_load=30.0, peak_contact_force=45.0, time_above_20n=0.75)
    page = page_of([PLAIN, harder, replace(harder, trusted=False)])
    assert "<b>30.0 N</b><span>median peak load" in page
    assert "<b>45.0 N</b><span>median peak force of a single contact; load above 20 N for 0.58 s a trial" in page
    assert "<b>1</b><span>trials whose physics is not trusted" in page
    assert "not trusted</td>" in page


@pytest.fixture
def batch(tmp_path):
    results = make_results()
    index = SetIndex(RUNS, {}, tuple(f"run_{r.seed:04d}.parquet" for r in results), ("report.html",))
    with open_set(tmp_path, index, overwrite=False) as runs:
        for name in index.files:
            runs.write(name, partial(write_rig_run, make_rig_run()))
        write_report(runs, results, made_by={}, scenario="seed: 0")
    return tmp_path, results


@pytest.mark.browser
@pytest.mark.slow
def test_report_opens_from_disk_sorts_its_table_and_links_a_replay(batch):
    folder, results = batch
    with open_page(folder / "report.html", size=(1366, 768)) as page:
        page.wait("document.readyState === 'complete'")
        assert page.run("return document.querySelectorAll('#trials tbody tr').length") == len(results)
        assert page.run("return document.querySelectorAll('#trials tr.failed').length") == 1
        assert page.run("return document.querySelectorAll('.panel svg').length") == 4
        for width in (1400, 1280, 420):
            size = {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": False}
            page.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
            parts = "[document.documentElement, document.querySelector('.scroll')]"
            cut = page.run(f"return {parts}.map(part => part.scrollWidth - part.clientWidth)")
            assert cut == [0, 0], f"{width} pixels cut the page or its table"
            states = "return document.querySelector('.visits').getBoundingClientRect().right < innerWidth"
            assert page.run(states)
        heights = "return [...document.querySelectorAll('#trials tbody tr')].map(row => row.offsetHeight)"
        assert len(set(page.run(heights))) == 1
        column = page.run("return [...document.querySelectorAll('th')].findIndex(h => h.innerText.startsWith('time'))")
        times = []
        for _ in range(2):
            page.run("document.querySelectorAll('th')[arguments[0]].click()", column)
            times.append(
                page.run(
                    "return [...document.querySelector('tbody').rows].map(r => +r.cells[arguments[0]].innerText)",
                    column,
                )
            )
        assert times[0] == sorted(times[0])
        assert times[1] == times[0][::-1]
        content = blankness(page.screenshot())
        assert content.colours > 15
        assert content.drawn > 0.03
        link = page.run("return document.querySelector('#worst a').getAttribute('href')")
        assert page.errors() == []
        assert page.requests() == []
    assert link == "replay_0004.html"
    assert "<title>trial 4</title>" in (folder / link).read_text()[:500]
