import json
from pathlib import Path

import pytest

import interfaces
from interfaces.reports.page_template import fill_page, script_value


def test_missing_value_is_an_error():
    with pytest.raises(KeyError, match="title"):
        fill_page("replay", viewer="", data="0", scene_commands="[]")


def test_page_contains_its_style_and_its_script():
    page = fill_page("replay", title="t", viewer="/* viewer */", data="0", scene_commands="[]")
    folder = Path(interfaces.__path__[0]) / "reports"
    assert (folder / "replay.css").read_text() in page
    assert (folder / "replay.js").read_text() in page
    assert page.index("/* viewer */") < page.index("const data = 0;") < page.index("new MeshCat.Viewer")


@pytest.mark.parametrize("text", ["</script>", "<!--<script>", "\u2028 & \" ' \\ $x", "<\\u003c"])
def test_script_value_keeps_the_text_and_cannot_end_a_script(text):
    value = script_value({"text": [text, None, 1.5]})
    assert json.loads(value) == {"text": [text, None, 1.5]}
    assert "<" not in value
