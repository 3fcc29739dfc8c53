import base64
import io
import json
import re

import numpy as np
import pytest
from PIL import Image
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.keys import Keys

from interfaces.reports.states_page import StatesReport, ink_on, page_colours, page_data, rounded, states_page
from skill.states.phase_agreement import compare_with_phases
from skill.states.state_summary import StateSummary, summarise_states
from tests.browser import blankness, open_page
from tests.state_recordings import FORCES, MOMENTS, labelled

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


def data_of(page):
    return json.loads(re.search(r"^const data = (.*);$", page, re.MULTILINE)[1])


# ------------------------------------------------------------ data


def test_the_page_contains_the_series_in_units_that_people_read():
    values = [[1.234567, 0, 0, 0, 0.0123456, 0, 0.0012345], [-40.0, 0, 0, 0, 0.2, 0, 0.0]]
    item = labelled(
        [0, 0, 1], values, channels=(*["fx", "fy", "fz", "mx", "my", "mz"], "pz"), time=[7.0, 7.02, 7.0412345]
    )
    data = page_data([item], summarise_states([item], 2), ["#000000", "#ffffff"])
    assert [(g["name"], g["unit"], g["channels"]) for g in data["groups"]] == [
        ("force", "N", ("fx", "fy", "fz")),
        ("moment", "N m", ("mx", "my", "mz")),
        ("position", "mm", ("pz",)),
    ]
    (trial,) = data["trials"]
    assert trial["time"] == [0.0, 0.02, 0.0412]
    force, moment, position = (g["step"] for g in data["groups"])
    assert np.array(trial["values"][0]) * force == pytest.approx([1.234567, 1.234567, -40.0], abs=40 / 5000)
    assert np.array(trial["values"][4]) * moment == pytest.approx([0.0123456, 0.0123456, 0.2], abs=0.2 / 5000)
    assert np.array(trial["values"][6]) * position == pytest.approx([1.2345, 1.2345, 0.0], abs=1.3 / 5000)
    assert [g["digits"] for g in data["groups"]] == [1, 3, 2]
    assert trial["states"] == [[0, 0], [2, 1]]
    assert trial["probability"] == [100, 100, 100]
    assert trial["phases"] is None
    assert data["groups"][0]["low"] == -40.0
    assert data["groups"][0]["high"] == pytest.approx(1.234567)
    assert not data["groups"][0]["cut"]


def test_phases_are_numbered_alike_in_all_recordings():
    a = labelled([0, 0, 0], WRENCHES, phases=np.array(["b", "b", "a"]))
    b = labelled([0, 0, 0], WRENCHES)
    c = labelled([0, 0, 0], WRENCHES, phases=np.array(["a", "c", "c"]))
    data = page_data([a, b, c], summarise_states([a, b, c], 1), ["#000000"])
    assert data["phases"] == ("b", "a", "c")
    assert [trial["phases"] for trial in data["trials"]] == [[[0, 0], [2, 1]], None, [[0, 1], [1, 2]]]


def test_a_rare_peak_does_not_flatten_the_series():
    item = labelled([0] * 2000, [[0.0] * 6])
    item.recording.values[:, 2] = np.tile([-10.0, 10.0], 1000)
    item.recording.values[7, 2] = 500.0
    group = page_data([item], summarise_states([item], 1), ["#000000"])["groups"][0]
    assert (group["low"], group["high"], group["cut"]) == (-10.0, 20.0, True)


def test_long_recordings_are_thinned(monkeypatch):
    monkeypatch.setattr("interfaces.reports.states_page.MAX_SHOWN", 8)
    page = states_page(report_of(example(samples=30)))
    assert "contains every 4th sample" in page
    trial = data_of(page)["trials"][0]
    assert len(trial["time"]) == len(trial["values"][0]) == len(trial["probability"]) == 8
    assert trial["time"][:2] == [0.0, 0.4]
    assert trial["states"] == [[0, 0], [3, 1], [5, 2]]
    assert "every" not in states_page(report_of(example(samples=6))).split("<h2>Recordings")[1].split("toolbar")[0]


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
    assert "<i>" not in page.replace('<i class="chip"', "")
    data = data_of(page)
    assert data["states"][1]["name"] == f"{SLY}1"
    assert data["phases"] == ["reach <i>", "press"]


def test_the_table_of_states_worked_by_hand():
    page = states_page(report_of([labelled([0, 0, 0, 1, 1, 0], WRENCHES), labelled([0, 1], WRENCHES)]))
    rows = page.split("<tbody>")[1].split("</tbody>")[0].split("</tr>")
    cells = [re.findall(r"<td[^>]*>(.*?)</td>", row) for row in rows]
    assert cells[0][:4] == [
        "62 %",
        "1.5<small>in 2 of 2</small>",
        "0.10<small>0.10 to 0.26</small>",
        "<span>1 (67 %)</span>, <span>end (33 %)</span>",
    ]
    assert cells[1][4:] == [f"{x}<small>{x} to {x}</small>" for x in ["8.00", "0.00", "0.00", "-8.00", *["0"] * 4]]
    assert cells[2] == ["0 %", "0.0<small>in 0 of 2</small>", "-", "-", *["-"] * 8]
    headings = re.findall(r"<th [^>]*>([^<]*)<small>(.*?)</small>", page.split("<thead>")[1].split("</thead>")[0])
    assert [name for name, _ in headings[5:]] == ["|force|", "fx", "fy", "fz", "|moment|", "mx", "my", "mz"]
    assert [unit for _, unit in headings[5:]] == ["N"] * 4 + ["N m"] * 4


def test_phases_have_a_table_if_they_are_known():
    page = states_page(report_of(example()))
    table = page.split("<h2>Known phases</h2>")[1].split("</table>")[0]
    assert "reach &lt;i&gt;" in table
    assert [re.findall(r"<td[^>]*>(.*?)</td>", row) for row in table.split("</tr>")[1:3]] == [
        ["100 %", "0 %", "0 %", "20"],
        ["0 %", "50 %", "50 %", "40"],
    ]
    assert "Known phases" not in states_page(report_of([labelled([0, 1], WRENCHES)] * 2))


def test_colours_repeat_and_numbers_on_them_can_be_read():
    colours = page_colours(40)
    assert len(colours) == 40
    assert colours[27:] == colours[:13]
    assert [ink_on(colour) for colour in ("#000000", "#0072B2", "#FFFFFF", "#E69F00")] == [
        "#fff",
        "#fff",
        "#000",
        "#000",
    ]
    assert (rounded(-0.04, 1), rounded(-0.06, 1), rounded(2.0, 0)) == ("0.0", "-0.1", "2")


# ------------------------------------------------------------ in the browser


@pytest.fixture
def page_file(tmp_path):
    path = tmp_path / "states.html"
    items = example(number=12, samples=600)
    rng = np.random.default_rng(0)
    for item in items:
        item.recording.values[:] += rng.normal(scale=[0.5] * 3 + [0.02] * 3, size=item.recording.values.shape)
    items[0].recording.values[300] = [1.5, -2.5, -8.0, 0.01, -0.02, 0.0]
    path.write_text(states_page(report_of(items)))
    return path


READOUT = "return [...document.querySelectorAll('#trial-0 .readout span')].map(s => s.textContent).join(' | ')"


def picture(page, trial):
    """The canvas of a recording as (height, width, 4)."""
    address = page.run(f"return document.querySelector('#trial-{trial} canvas').toDataURL()")
    return np.asarray(Image.open(io.BytesIO(base64.b64decode(address.partition(",")[2]))).convert("RGBA"))


@pytest.mark.browser
@pytest.mark.slow
def test_the_page_draws_what_is_in_view_and_reads_values_at_the_cursor(page_file):
    with open_page(page_file, size=(1280, 900)) as page:
        page.wait("window.statesPage && statesPage.ready")
        assert page.run("return document.querySelector('#trial-11 canvas').width") == 0  # far below
        page.run("document.getElementById('trial-0').scrollIntoView()")
        page.wait("document.querySelector('#trial-0 canvas').width > 500")
        drawn = picture(page, 0)
        assert blankness(drawn[..., :3]).colours > 20
        middle, bands = drawn.shape[1] // 2, drawn[-60:, drawn.shape[1] // 2]
        for colour in ("#E69F00", "#B9C3CC"):  # of state 1 and of the second phase
            rgb = [int(colour[i : i + 2], 16) for i in (1, 3, 5)]
            assert (np.abs(bands[:, :3].astype(int) - rgb).max(axis=1) < 4).sum() > 8, colour
        page.run("statesPage.show(0, 30.0)")
        readout = page.run(READOUT)
        assert readout.startswith("30.00 s | state 1: 8 N along -z (88 %) | phase press | fx 1.5  fy -2.5  fz -8.0 N |")
        assert readout.endswith("| mx 0.010  my -0.020  mz 0.000 N m")
        page.run("statesPage.show(0, 20.0)")  # the first sample of the state
        assert page.run(READOUT).startswith("20.00 s | state 1")
        page.run("statesPage.show(0, 30.0)")
        slider = "return document.querySelector('#trial-0 .plot').getAttribute(arguments[0])"
        assert page.run(slider, "aria-valuenow") == "30"
        assert page.run(slider, "aria-valuetext").startswith("30.00 s; state 1")
        place = "return parseFloat(document.querySelector('#trial-0 .cursor').style.left)"
        assert abs(page.run(place) - middle) < 25
        plot = page.driver.find_element("css selector", "#trial-0 .plot")
        page.run("arguments[0].focus(); statesPage.show(0, 10.0)", plot)
        keys = [(Keys.ARROW_RIGHT, 10.1), (Keys.ARROW_LEFT, 10.0), (Keys.SHIFT + Keys.ARROW_RIGHT, 20.0)]
        for key, expected in [*keys, (Keys.END, 59.9), (Keys.ARROW_RIGHT, 59.9), (Keys.HOME, 0.0)]:
            plot.send_keys(key)
            assert page.run(READOUT).startswith(f"{expected:.2f} s"), key
        ActionChains(page.driver).move_to_element(plot).perform()
        assert float(page.run(READOUT).split()[0]) == pytest.approx(29.95, abs=1.5)  # near the middle
        # Another recording comes into view, and this one is dropped.
        page.run("document.getElementById('trial-11').scrollIntoView()")
        page.wait("document.querySelector('#trial-11 canvas').width > 500")
        page.wait("document.querySelector('#trial-0 canvas').width === 0")
        assert page.run("return document.querySelectorAll('b, i:not(.chip):not(#toolbar i)').length") == 5  # tiles
        assert page.run("return document.querySelector('h3').innerText").startswith(SLY)
        assert page.errors() == []
        assert page.requests() == []


@pytest.mark.browser
@pytest.mark.nightly
def test_a_gap_has_no_colour_of_a_state(tmp_path):
    time = [7.0 + 0.1 * k + (3.0 if k >= 15 else 0.0) for k in range(30)]  # from 1.5 to 4.4 s there are no samples
    path = tmp_path / "states.html"
    path.write_text(states_page(report_of([labelled(np.repeat([0, 1, 2], 10), WRENCHES, time=time)])))
    with open_page(path, size=(1280, 900)) as page:
        page.wait("window.statesPage && statesPage.ready")
        page.run("document.getElementById('trial-0').scrollIntoView()")
        page.wait("document.querySelector('#trial-0 canvas').width > 500")
        drawn = picture(page, 0)[..., 3] > 0
        width = drawn.shape[1]

        def painted(time):
            return drawn[:, round(50 + (width - 60) * time / 5.9)].mean()

        assert painted(3.0) < 0.2
        assert min(painted(time) for time in (0.55, 1.25, 4.65, 5.5)) > 0.6
        assert "from 7 s of the file on" in page.run("return document.querySelector('#trial-0 h3').textContent")
        assert page.errors() == []


@pytest.mark.browser
@pytest.mark.nightly
def test_channels_are_switched_off_and_a_phone_is_wide_enough(page_file):
    with open_page(page_file, size=(1280, 900)) as page:
        page.wait("window.statesPage && statesPage.ready")
        page.run("document.getElementById('trial-0').scrollIntoView(); statesPage.show(0, 30.0)")
        page.wait("document.querySelector('#trial-0 canvas').width > 500")
        before = picture(page, 0)
        page.run("document.querySelectorAll('#toolbar button')[2].click()")
        pressed = "return document.querySelectorAll('#toolbar button')[2].getAttribute('aria-pressed')"
        assert page.run(pressed) == "false"
        after = picture(page, 0)
        force = slice(0, 121)
        assert (before[force] != after[force]).any()
        assert np.array_equal(before[140:], after[140:])  # moments and bands are as before
        assert "fz" not in page.run(READOUT)
        page.run("document.querySelectorAll('#toolbar button')[2].click()")
        assert np.array_equal(picture(page, 0), before)
        metrics = {"width": 390, "height": 844, "deviceScaleFactor": 2, "mobile": True}
        page.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
        page.wait("window.innerWidth === 390")
        page.run("document.getElementById('trial-0').scrollIntoView()")
        page.wait("document.querySelector('#trial-0 canvas').width > 500")
        page.wait("document.querySelector('#trial-0 canvas').width < 780")
        assert page.run("return document.documentElement.scrollWidth") <= 390
        assert page.errors() == []
