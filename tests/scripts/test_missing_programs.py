"""The tests that open a page or draw a diagram, where the programs for it are missing (see tests/conftest.py)."""

import pytest

from tests.scripts.commands import run_python

pytestmark = pytest.mark.slow

TESTS = """
import subprocess

import pytest

from tests.browser import open_page


class Session:
    def page(self):
        return open_page("x.html")


def show():
    return Session().page()


@pytest.fixture
def page():
    with show() as page:
        yield page


def test_direct():
    with open_page("x.html"):
        pass


def test_through_helpers():
    [show() for _ in range(1)]


def test_through_a_fixture(page):
    pass


@pytest.mark.graphviz
def test_diagram():
    subprocess.run(["dot", "-V"], check=True)


def test_without_programs():
    show = "open_page"
    assert show
"""


@pytest.fixture
def run_tests(tmp_path):
    """Runs these tests in a separate process whose PATH has neither Chromium nor Graphviz."""
    (tmp_path / "test_pages.py").write_text(TESTS)

    def run(*options, **environment):
        arguments = ("-m", "pytest", "-v", "-p", "tests.conftest", "-p", "no:cacheprovider", "--rootdir", tmp_path)
        return run_python(*arguments, *options, tmp_path, cwd=tmp_path, PATH=str(tmp_path), **environment)

    return run


def test_they_are_skipped_with_one_line_that_says_which_and_why(run_tests):
    done = run_tests(REQUIRE_BROWSER="0")
    assert done.returncode == 0, done.stdout
    assert "test_without_programs PASSED" in done.stdout
    assert "1 passed, 4 skipped" in done.stdout
    lines = [line for line in done.stdout.splitlines() if line.startswith("skipped ")]
    assert len(lines) == 1
    assert "3 browser tests: chromium and chromedriver not found" in lines[0]
    assert "1 graphviz tests: dot not found" in lines[0]


def test_they_are_selected_by_marker_and_fail_where_the_programs_are_required(run_tests):
    done = run_tests("-m", "browser or graphviz", REQUIRE_BROWSER="1")
    assert done.returncode == 1
    assert "1 deselected, " in done.stdout
    assert "4 errors in " in done.stdout
    assert "REQUIRE_BROWSER=1, but chromium and chromedriver not found" in done.stdout
    assert "REQUIRE_BROWSER=1, but dot not found" in done.stdout
    assert "\nskipped " not in done.stdout
