"""Links of the pages on the site."""

import sys

import pytest

from tests.scripts.commands import ROOT

sys.path.append(str(ROOT / "docs" / "_extensions"))
source_links = pytest.importorskip("source_links", reason="needs Sphinx, the extra [docs]")


def test_modules_and_tutorials_have_pages_and_other_links_stay():
    text = "[a](../skill/arrays.py) [b](../skill/data/__init__.py) [c](tutorials/plot_own_peg.py) [](../tests/a.py)"
    made = (
        "[a](reference/skill.arrays.rst) [b](reference/skill.data.rst) [c](gallery/plot_own_peg.rst) [](../tests/a.py)"
    )
    assert source_links.on_the_site(text) == made
