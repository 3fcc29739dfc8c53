"""The page of a scoreboard: content, links, sorting, and how the page looks in a browser."""

import html
import re
from urllib.parse import unquote

import pytest

from experiments.scoreboard.columns import COLUMNS
from experiments.scoreboard.result_store import read_trials
from experiments.scoreboard.summary import make_scoreboard
from interfaces.reports.scoreboard_page import scoreboard_page
from tests.browser import blankness, open_page
from tests.experiments.scoreboard.simulated_trials import (
    FAILED,
    LAW,
    LEARNT,
    OTHER,
    write_results,
    write_sweep,
    write_trials,
)


def page_of(folder, out=None):
    return scoreboard_page(make_scoreboard(read_trials(folder)), out or folder / "scoreboard.html")


def cells_of(page, name, row=0):
    place = 1 + [column.name for column in COLUMNS].index(name)
    found = re.findall(r"<tr>(.*?)</tr>", page.split("<tbody>")[1].split("</tbody>")[0], re.DOTALL)[row]
    return re.findall(r"<t[hd].*?</t[hd]>", found, re.DOTALL)[place]


def text_of(cell):
    return html.unescape(re.sub(r"<[^>]*>", " ", cell)).split()


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    folder = write_results(tmp_path_factory.mktemp("a folder") / "results")
    old = {"code": "0ld", "began": "2025-01-01T00:00:00+00:00"}
    write_trials(folder, [{"trial": k} | old for k in range(3)], block="0009")
    page = folder.parent / "pages" / "scoreboard.html"
    page.parent.mkdir()
    page.write_text(page_of(folder, page))
    return folder, page


# ------------------------------------------------------------------------ cells


def test_cells_show_the_numbers_of_the_summary(tmp_path):
    rows = [{"demonstration_set": k % 2, "demonstrations": 30, "train_s": 12.25} for k in range(4)]
    write_trials(tmp_path, rows, policy=LEARNT)
    worse = FAILED | {"outcome": "fault", "fault": "pitch stepper blocked or overloaded: steps lost", "trusted": False}
    write_trials(tmp_path, [worse, {}, {}, worse], policy=OTHER)
    page = page_of(tmp_path)
    assert text_of(cells_of(page, "inserted")) == ["4", "of", "4", "2–100", "%"]
    assert text_of(cells_of(page, "sets")) == ["2"]
    assert text_of(cells_of(page, "against")) == ["–"]
    assert text_of(cells_of(page, "shown")) == ["30"]
    assert text_of(cells_of(page, "training")) == ["12.2"]
    assert text_of(cells_of(page, "against", row=1)) == ["+0", "−2", "sets:", "−1", "−1"]
    assert text_of(cells_of(page, "slower by", row=1)) == ["+3.75", "sets:", "+3.75", "+3.75"]
    assert text_of(cells_of(page, "faults", row=1)) == ["2", "2", "pitch", "stepper", "blocked", "or", "overloaded"]
    assert text_of(cells_of(page, "physics", row=1)) == ["2", "of", "4", "not", "trusted"]
    assert 'class="doubtful"' in cells_of(page, "load", row=1)
    assert 'class="more doubtful"' in cells_of(page, "contact", row=1)
    assert "doubtful" not in cells_of(page, "load")


def test_the_page_says_what_is_left_out_and_not_trusted(results, tmp_path):
    page = html.unescape(results[1].read_text())
    assert "3 trials are left out, because other code made them: 3 of 0ld" in page
    assert re.search(r"\d+ of 600 trials have physics that is not trusted", page)
    write_trials(tmp_path, [{}])
    alone = page_of(tmp_path)
    assert "left out" not in alone
    assert "not trusted:" not in alone
    assert "No specification of a sweep" in alone
    assert "<nav" not in alone


def test_the_page_says_how_many_trials_of_a_replaced_policy_are_left_out(tmp_path):
    old = {"skill": "old", "key": "old", "began": "2026-01-01T00:00:00+00:00"}
    write_trials(tmp_path, [old, {"trial": 0, "skill": "new"}])
    assert "1 trial is left out, because the policy has been made anew since" in html.unescape(page_of(tmp_path))


def test_every_policy_links_its_files_and_has_its_commands(results):
    folder, path = results
    page = path.read_text()
    links = re.findall(r'<th scope="row" class="text"><a href="([^"]*)">', page)
    assert len(links) == 5 * 3
    for address in links:
        linked = (path.parent / unquote(address)).resolve()
        assert linked.is_relative_to(folder.resolve())
        assert list(linked.glob("*.parquet"))
    commands = re.findall(r'<details class="row"><summary>(.*?)</summary><dl>(.*?)</dl>', page)
    assert len(commands) == 5 * 3
    for policy, text in commands:
        assert "<pre>haptic-skill sweep" in text
        assert "import pandas" in text
        assert ("pairs with" in text) == (policy != LEARNT)


def test_text_that_looks_like_html_is_shown_as_text(tmp_path):
    write_sweep(tmp_path, title="<i>friction</i> $title")
    write_trials(tmp_path, [{"factors": '{"<b>": "</script>"}'}], policy="<script>alert(1)</script>")
    page = page_of(tmp_path)
    assert page.count("<script>") == page.count("</script>") == 1
    assert "<h1>Scoreboard: &lt;i&gt;friction&lt;/i&gt; $title</h1>" in page


# ---------------------------------------------------------------------- browser


SHOWN = """return [...document.querySelectorAll('thead button')].find(
    b => b.firstChild.textContent === arguments[0]).checkVisibility()"""
ROWS = "[...document.querySelector('table').tBodies[0].rows]"


def column_of(page, name):
    place = 1 + [column.name for column in COLUMNS].index(name)
    return page.run(f"return {ROWS}.map(row => row.cells[arguments[0]].dataset.key)", place)


def names_of(page):
    return page.run(f"return {ROWS}.map(row => row.cells[0].querySelector('a').textContent)")


def click(page, name):
    page.run(
        "[...document.querySelectorAll('thead button')].find(b => b.firstChild.textContent === arguments[0]).click()",
        name,
    )


@pytest.mark.browser
@pytest.mark.slow
def test_the_page_opens_sorts_and_fits(results):
    with open_page(results[1], size=(1280, 720)) as page:
        assert page.run("return document.documentElement.scrollWidth <= innerWidth")
        assert names_of(page) == [LEARNT, OTHER, LAW]
        click(page, "inserted")
        assert names_of(page) == [LEARNT, OTHER, LAW]  # the best first
        click(page, "inserted")
        assert names_of(page) == [LAW, OTHER, LEARNT]
        click(page, "load")
        loads = [float(key) for key in column_of(page, "load")]
        assert loads == sorted(loads)
        assert not page.run(SHOWN, "training")
        page.run("document.getElementById('all').click()")
        assert page.run(SHOWN, "training")
        for _ in range(2):
            click(page, "training")
            assert column_of(page, "training")[-1] == ""  # a policy without training stays last
        click(page, "policy")
        assert names_of(page) == sorted([LEARNT, OTHER, LAW], key=str.lower)
        assert blankness(page.screenshot()).colours > 20
        assert page.errors() == page.requests() == []


@pytest.mark.parametrize(("sets", "few"), [(2, True), (5, True), (6, False), (9, False)])
def test_the_page_says_when_there_are_too_few_sets_for_a_test(tmp_path, sets, few):
    rows = [{"trial": k, "demonstration_set": k} for k in range(sets)]
    write_trials(tmp_path, rows, policy=LEARNT)
    write_trials(tmp_path, [row | FAILED for row in rows], policy=OTHER)
    page = page_of(tmp_path)
    assert ("1 of 1 comparisons have fewer than 6 sets" in page) == few
    note = ["sets:", *["−1"] * sets] if few else ["p", f"{2.0 ** (1 - sets):.3f}"]
    assert text_of(cells_of(page, "against", row=1)) == ["+0", f"−{sets}", *note]
