import re

import numpy as np
import pytest
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.keys import Keys

from interfaces.reports.states_page import StatesReport, rounded, states_page
from skill.states.phase_agreement import compare_with_phases
from skill.states.state_summary import StateSummary, summarise_states
from tests.browser import blankness, open_page
from tests.state_recordings import CHANNELS, FORCES, MOMENTS, labelled
from tests.states_pages import bands_of, series_of

WRENCHES = np.hstack([FORCES, MOMENTS])
SLY = '</script><b>sly & "quoted"'


def report_of(items, K=3, **changes):
    states = summarise_states(items, K)
    arguments = {"title": "contact states", "about": "", "method": "How.", "made_by": {}}
    arguments |= {"labelled": items, "states": states, "agreement": compare_with_phases(items, K)}
    return StatesReport(**{**arguments, **changes})


def example(number=2, samples=30):
    states = np.repeat([0, 1, 2], samples // 3)
    phases = np.where(states == 0, "reach <i>", "press")
    return [labelled(states, WRENCHES, phases=phases, name=f"{SLY} {k}", probability=0.876) for k in range(number)]


def test_the_series_and_their_axes_are_in_units_that_people_read():
    values = [[1.234567, 0, 0, 0, 0.0123456, 0, 0.0012345], [-40.0, 0, 0, 0, 0.2, 0, 0.0]]
    item = labelled([0, 0, 1], values, channels=(*CHANNELS, "pz"), time=[7.0, 7.02, 7.0412345])
    page = states_page(report_of([item], 2))
    time, series = series_of(page)[0]
    assert time == pytest.approx([0.0, 0.02, 0.0412])
    assert series["fx"] == pytest.approx([1.234567, 1.234567, -40.0], abs=40 / 5000)
    assert series["my"] == pytest.approx([0.0123456, 0.0123456, 0.2], abs=0.2 / 5000)
    assert series["pz"] == pytest.approx([1.2345, 1.2345, 0.0], abs=1.3 / 5000)
    axes = re.findall(r"<h4>(.*?)<small>(.*?)</small></h4><svg viewBox=\"\S+ (\S+) \S+ (\S+)\"", page)
    assert axes == [
        ("force (N)", "-40.0 to 1.2", "-1234.57", "41234.6"),
        ("moment (N m)", "0.000 to 0.200", "-20000", "20000"),
        ("position (mm)", "0.00 to 1.23", "-12345", "12345"),
    ]
    assert re.findall(r'data-digits="(.)"', page) == ["1", "3", "2"]
    assert "from 7 s of the file on" in page
    assert 'data-probability="100 100 100"' in page
    assert bands_of(page, "state") == [[("0", "0"), ("2", "1")]]
    assert bands_of(page, "phase") == []


def test_phases_are_numbered_alike_in_all_recordings():
    phases = [["b", "b", "a"], None, ["a", "c", "c"]]
    items = [labelled([0, 0, 0], WRENCHES, phases=p if p is None else np.array(p)) for p in phases]
    page = states_page(report_of(items, 1))
    assert bands_of(page, "phase") == [[("0", "b"), ("2", "a")], [("0", "a"), ("1", "c")]]
    greys = re.findall(r'title="phase (.)".*?--colour: var\(--phase-(.)\)', page)
    assert greys == [("b", "0"), ("a", "1"), ("a", "1"), ("c", "0")]


def test_long_recordings_are_thinned(monkeypatch):
    assert "The page contains every" not in states_page(report_of(example()))
    monkeypatch.setattr("interfaces.reports.states_page.MAX_SHOWN", 8)
    page = states_page(report_of(example(samples=30)))
    assert "contains every 4th sample" in page
    time, series = series_of(page)[0]
    assert len(time) == len(series["fx"]) == 8
    assert time[:2] == pytest.approx([0.0, 0.4])
    assert bands_of(page, "state")[0] == [("0", "0"), ("3", "1"), ("5", "2")]
    monkeypatch.setattr("interfaces.reports.states_page.MAX_SHOWN_TOGETHER", 12)
    assert "contains every 5th sample" in states_page(report_of(example(samples=30)))


# ------------------------------------------------------------ text


def test_text_that_looks_like_html_is_shown_as_text():
    states = [
        StateSummary(f"{SLY}{k}", s.share, s.visits, s.recordings, s.duration, s.quantities, s.following)
        for k, s in enumerate(summarise_states(example(), 3))
    ]
    page = states_page(
        report_of(example(), states=states, title=SLY, about=SLY, method=SLY, made_by={f"<i>{SLY}": f"$data {SLY}"})
    )
    assert "<b>sly" not in page
    assert page.count("</script>") == 1
    assert "<i>" not in page
    assert series_of(page)


def test_the_table_of_states_worked_by_hand():
    page = states_page(report_of([labelled([0, 0, 0, 1, 1, 0], WRENCHES), labelled([0, 1], WRENCHES)]))
    rows = page.split("<tbody>")[1].split("</tbody>")[0].split("</tr>")
    cells = [re.findall(r"<td[^>]*>(.*?)</td>", row)[1:] for row in rows[:3]]
    assert "</i> 8&nbsp;N along -&NoBreak;z</td>" in rows[1]  # no line ends between a sign and its axis
    assert cells[0][:4] == [
        "62 %",
        "1.5<small>in 2 of 2</small>",
        "0.10<small>0.10 to 0.26</small>",
        "1 (67 %), end (33 %)",
    ]
    assert cells[1][4:] == [f"{x}<small>{x} to {x}</small>" for x in ["8.00", "0.00", "0.00", "-8.00", *["0"] * 4]]
    assert cells[2] == ["0 %", "0.0<small>in 0 of 2</small>", "-", "-", *["-"] * 8]
    headings = re.findall(r"<th>([^<]*)<small>(.*?)</small>", page.split("<thead>")[1].split("</thead>")[0])
    assert [name for name, _ in headings[5:]] == ["|force|", "fx", "fy", "fz", "|moment|", "mx", "my", "mz"]
    assert [unit for _, unit in headings[5:]] == ["N"] * 4 + ["N m"] * 4


def test_phases_have_a_table_if_they_are_known():
    page = states_page(report_of(example()))
    table = page.split("<h2>Known phases</h2>")[1].split("</table>")[0]
    assert "reach &lt;i&gt;" in table
    assert [re.findall(r"<td[^>]*>(.*?)</td>", row)[1:] for row in table.split("</tr>")[1:3]] == [
        ["100 %", "0 %", "0 %", "20"],
        ["0 %", "50 %", "50 %", "40"],
    ]
    assert "Known phases" not in states_page(report_of([labelled([0, 1], WRENCHES)] * 2))


def test_colours_repeat_if_there_are_more_states():
    page = states_page(report_of([labelled([0, 1], WRENCHES)], 40))
    colours = re.findall(r'class="chip" style="--colour: (.*?)"', page.split('id="legend"')[1])
    assert len(colours) == 40
    assert colours[27:] == colours[:13]
    assert len(set(colours)) == 27
    assert (rounded(-0.04, 1), rounded(-0.06, 1), rounded(2.0, 0)) == ("0.0", "-0.1", "2")


# ------------------------------------------------------------ in the browser


@pytest.mark.browser
@pytest.mark.slow
def test_the_page_draws_the_series_and_reads_values_at_the_cursor(tmp_path):
    path, items = tmp_path / "states.html", example(samples=600)
    items[0].recording.values[3] = [1.5, -2.5, -8.0, 0.01, -0.02, 0.0]
    path.write_text(states_page(report_of(items)))
    with open_page(path, size=(1280, 900)) as page:
        plot = page.driver.find_element("css selector", ".plot")
        page.run("arguments[0].scrollIntoView()", plot)
        assert blankness(page.screenshot()).colours > 20

        def reading():
            return page.run("return document.querySelector('.readout').textContent")

        ActionChains(page.driver).move_to_element(plot).perform()
        assert float(reading().split()[0]) == pytest.approx(29.95, abs=0.11)  # the middle
        plot.click()
        for key, expected in [
            (Keys.SHIFT + Keys.ARROW_LEFT, 20.0),
            (Keys.ARROW_LEFT, 19.9),
            (Keys.SHIFT + Keys.ARROW_RIGHT, 20.0),
            (Keys.ARROW_RIGHT, 20.1),
            (Keys.END, 59.9),
            (Keys.ARROW_RIGHT, 59.9),
            (Keys.HOME, 0.0),
        ]:
            plot.send_keys(key)
            assert reading().startswith(f"{expected:.2f} s | state {int(expected >= 20) + int(expected >= 40)}"), key
        plot.send_keys(3 * Keys.ARROW_RIGHT)
        assert reading() == (
            "0.30 s | state 0: free (88 %) | phase reach <i> | fx 1.5  fy -2.5  fz -8.0 N |"
            " mx 0.010  my -0.020  mz 0.000 N m"
        )
        assert page.run("return arguments[0].getAttribute('aria-valuenow')", plot) == "0.3"
        place = page.run("return parseFloat(document.querySelector('.cursor').style.left)")
        assert place == pytest.approx(100 * 0.3 / 59.9, abs=0.01)
        shown = "return getComputedStyle(document.querySelector('path.channel-2')).display"
        assert page.run(shown) != "none"
        page.run("document.getElementById('show-2').click()")
        assert page.run(shown) == "none"
        assert page.run("return document.querySelector('h3').innerText").startswith(SLY)
        page.driver.set_window_size(1000, 900)
        shown, whole = page.run("const s = document.getElementById('states'); return [s.clientWidth, s.scrollWidth]")
        assert whole == shown  # the last channel is not behind a scroll bar
        assert page.errors() == page.requests() == []
