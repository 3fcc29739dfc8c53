"""Docstrings are prepared for reStructuredText: blocks stay as they are, text has no accidental markup."""

import sys

import pytest

from tests.scripts.commands import ROOT

sys.path.append(str(ROOT / "docs" / "_extensions"))
plain_docstrings = pytest.importorskip("plain_docstrings", reason="needs Sphinx, the extra [docs]")


def prepared(text):
    return "\n".join(plain_docstrings.prepared(text.split("\n")))


def test_an_indented_equation_is_a_block_of_its_own():
    text = "The weight is\n\n    w = exp(-|x|^2) * c_\n\nand |x| its norm."
    assert prepared(text) == "The weight is\n\n::\n\n    w = exp(-|x|^2) * c_\n\nand \\|x\\| its norm."


def test_sections_items_and_directives_are_no_blocks():
    text = "Args:\n    x: a number,\n        and more.\n\n.. pydrake_system::\n\n    name: A|B\n\n* one *good*\n  item"
    assert prepared(text) == text.replace("pydrake_system::", "code-block:: yaml")


def test_markup_is_escaped_outside_of_quotes_only():
    assert prepared("``a|b`` and `c_` but d_ and *args") == "``a|b`` and `c_` but d\\_ and \\*args"
