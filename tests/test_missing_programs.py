"""The tests that open a page or draw a diagram, where the programs for it are missing (see tests/conftest.py)."""

from types import SimpleNamespace

import pytest

from tests.conftest import pytest_runtest_setup


def marked(marker):
    """Stands for a test with one marker."""
    return SimpleNamespace(get_closest_marker=lambda name: name == marker)


def test_they_are_skipped_and_say_why_and_fail_where_the_programs_are_required(monkeypatch, tmp_path):
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("REQUIRE_BROWSER", raising=False)
    pages = "browser test: chromium and chromedriver not found .Debian: apt-get install chromium chromium-driver."
    with pytest.raises(pytest.skip.Exception, match=pages):
        pytest_runtest_setup(marked("browser"))
    pytest_runtest_setup(marked("slow"))
    monkeypatch.setenv("REQUIRE_BROWSER", "1")
    with pytest.raises(pytest.fail.Exception, match="REQUIRE_BROWSER=1, but dot not found"):
        pytest_runtest_setup(marked("graphviz"))
