import json
from pathlib import Path

import pytest

import interfaces
from interfaces.reports.page_template import fill_page, script_value


def test_missing_value_is_an_error():
    with pytest.raises(KeyError, match="title"):
        fill_page("states", hidden="")


def test_page_contains_its_style_and_its_script():
    names = ("title", "about", "table", "made_by", "scenario")
    page = fill_page("trials", assets="scoreboard", **dict.fromkeys(names, "$x"))
    folder = Path(interfaces.__path__[0]) / "reports"
    for asset in ("page.css", "scoreboard.css", "scoreboard.js"):
        assert (folder / asset).read_text() in page


@pytest.mark.parametrize("text", ["</script>", "<!--<script>", "\u2028 & \" ' \\ $x", "<\\u003c"])
def test_script_value_keeps_the_text_and_cannot_end_a_script(text):
    value = script_value({"text": [text, None, 1.5]})
    assert json.loads(value) == {"text": [text, None, 1.5]}
    assert "<" not in value
