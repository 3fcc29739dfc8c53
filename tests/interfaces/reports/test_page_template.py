import json
from pathlib import Path

import pytest

import interfaces
from interfaces.reports.page_template import fill_page, script_value


def test_page_contains_its_template_styles_and_script_and_what_comes_before_them():
    values = dict.fromkeys(("about", "table", "made_by", "scenario"), "$x")
    page = fill_page("trials", title="$t", assets=("page", "scoreboard"), style="<a>", script="<b>", **values)
    folder = Path(interfaces.__path__[0]) / "reports"
    styles = "".join((folder / name).read_text() for name in ("page.css", "scoreboard.css"))
    assert f"<style>\n<a>{styles}</style>" in page
    assert f"<script>\n<b>{(folder / 'scoreboard.js').read_text()}</script>" in page
    assert "<title>$t</title>" in page
    assert '<h1>$t</h1><p class="about">$x</p>' in page


@pytest.mark.parametrize("text", ["</script>", "<!--<script>", "\u2028 & \" ' \\ $x", "<\\u003c"])
def test_script_value_keeps_the_text_and_cannot_end_a_script(text):
    value = script_value({"text": [text, None, 1.5]})
    assert json.loads(value) == {"text": [text, None, 1.5]}
    assert "<" not in value
