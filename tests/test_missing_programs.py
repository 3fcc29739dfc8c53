"""The tests that open a page or draw a diagram, where the programs for it are missing (see tests/conftest.py)."""

import pytest

from tests.conftest import pytest_runtest_setup


class Item:
    """Stands for a test with one marker."""

    def __init__(self, marker):
        self.marker = marker

    def get_closest_marker(self, name):
        return name == self.marker


@pytest.fixture(autouse=True)
def nothing_on_the_path(monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))


def test_they_are_skipped_and_say_why(monkeypatch):
    monkeypatch.delenv("REQUIRE_BROWSER", raising=False)
    pages = "browser test: chromium and chromedriver not found .Debian: apt-get install chromium chromium-driver."
    with pytest.raises(pytest.skip.Exception, match=pages):
        pytest_runtest_setup(Item("browser"))
    with pytest.raises(pytest.skip.Exception, match="graphviz test: dot not found"):
        pytest_runtest_setup(Item("graphviz"))
    pytest_runtest_setup(Item("slow"))


def test_they_fail_where_the_programs_are_required(monkeypatch):
    monkeypatch.setenv("REQUIRE_BROWSER", "1")
    with pytest.raises(pytest.fail.Exception, match="REQUIRE_BROWSER=1, but dot not found"):
        pytest_runtest_setup(Item("graphviz"))
