"""The figures of README and docs are those of the published rows, and each says where it comes from."""

import shutil

import pytest

from docs._tools.figures_check import problems
from tests.checkout import ROOT

pytestmark = pytest.mark.slow


def test_the_figures_of_the_pages_are_those_of_the_rows():
    assert problems(ROOT) == []


@pytest.mark.parametrize(
    ("page", "old", "new", "told"),
    [
        ("README.md", "| 397 of 400 |", "| 398 of 400 |", "says '| 398 of 400 | 396 of 400 | `haptic-skill"),
        ("docs/results.md", "| 976 | 39, 39 |", "| 976 | 39, 38 |", "the rows say '| 976 | 39, 39 | 25, 24 | 40, 40 |"),
        ("docs/results.md", "(p 0.008, 0.012;", "(p 0.008, 0.002;", "(p 0.008, 0.012;'"),
        (
            "docs/sections.md",
            "# Other",
            "In short, 12 of 13.\n\n# Other",
            "sections.md:1: '12 of 13' has neither a query",
        ),
        ("docs/results.md", "As demonstrated it is", "As demonstrated\nit is", None),
        ("docs/limits.md", "One rig.", "One rig (p 0.03).", "'p 0.03' has neither a query nor a command"),
        (
            "docs/physics.md",
            "| setting |",
            "| of 7 | b |\n|---|---|\n| x | 3 |\n\n| setting |",
            "'| x | 3 |' has neither",
        ),
        (
            "docs/exports.md",
            "### An imitation policy",
            "### A policy",
            "docs/exports.md: has no '### An imitation policy",
        ),
    ],
)
def test_a_figure_that_no_row_gives_is_told(page, old, new, told, tmp_path):
    (tmp_path / "docs").mkdir()
    for path in [ROOT / "README.md", *(ROOT / "docs").glob("*.md")]:
        shutil.copy(path, tmp_path / path.relative_to(ROOT))
    text = (tmp_path / page).read_text()
    assert old in text
    (tmp_path / page).write_text(text.replace(old, new, 1))
    found = problems(tmp_path)
    assert any(line.startswith(page) and told in line for line in found) if told else found == []
