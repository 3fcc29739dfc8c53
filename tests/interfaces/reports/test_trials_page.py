import re
from dataclasses import replace

from interfaces.reports.trials_page import trials_page
from skill.data.outcome import Outcome
from tests.trial_results import PLAIN

FAILED = replace(PLAIN, seed=4, outcome=Outcome.TIME_OVER, time=10.0, depth=0.011, peak_load=5.0)
RESULTS = [replace(PLAIN, seed=k, time=2.0 + k / 4, peak_load=5.0 + k) for k in range(4)] + [FAILED]


def page_of(results, **changes):
    arguments = {"title": "t", "replays": {0: "r.html", 7: "s.html"}, "made_by": {}, "scenario": "seed: 0\n"}
    return trials_page(results, **{**arguments, **changes})


def cells_of(page):
    rows = page.split("<tbody>")[1].split("</tbody>")[0].split("</tr>")[:-1]
    return [re.findall(r"<td>(.*?)</td>", row) for row in rows]


def test_failures_come_first_by_depth_and_then_insertions_by_load():
    deeper = replace(FAILED, seed=5, depth=0.020, peak_load=99.0)
    order = [re.sub("<.*?>", "", cells[0]) for cells in cells_of(page_of([*RESULTS, deeper]))]
    assert order == ["4", "5", "3", "2", "1", "0"]


def test_heading_gives_counts_the_wilson_interval_and_medians():
    page = page_of([replace(PLAIN, seed=k) for k in range(9)] + [replace(FAILED, trusted=False)])
    assert "9 of 10 inserted (95 % Wilson interval 59.6 to 98.2 %)" in page  # Wilson 1927
    assert "time 2.50 s, peak load 16.0 N, peak contact 15.0 N, overlap 20 um; 1 trials" in page


def test_columns_show_the_units_of_their_headings():
    result = replace(
        PLAIN, seed=7, unsupported_time=0.25, unknown_time=0.5, penetration=31.4e-6, peak_moment=float("nan")
    )
    [cells] = cells_of(page_of([result]))
    assert cells[:7] == ['<a href="s.html">7</a>', "+1.0 -2.0", "inserted", "2.50", "24.7", "16.0", "15.0"]
    assert cells[7:13] == ["20", "0", "31", "0.50", "0.25", "0.25"]
    assert cells[13:] == ["8.0", "0.125", "6.0", "12.0", "–", "0", "trusted", "0 1 2 3"]


def test_text_of_users_is_shown_as_text():
    odd = replace(PLAIN, outcome=Outcome.DIVERGED, detail='<b>"x" & y</b>')
    page = page_of([odd], title="<script>$style ${script}", made_by={"$rows": "<i> 100 $"}, scenario="a: <b> $title")
    assert "<h1>&lt;script&gt;$style ${script}</h1>" in page
    assert "&lt;b&gt;&quot;x&quot; &amp; y&lt;/b&gt;" in page
    assert "<dt>$rows</dt><dd>&lt;i&gt; 100 $</dd>" in page
    assert ">a: &lt;b&gt; $title</pre>" in page
