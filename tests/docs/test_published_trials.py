"""Links of the scoreboard on the site."""

import sys

import pytest

from tests.scripts.commands import ROOT

sys.path.append(str(ROOT / "docs" / "_extensions"))
published_trials = pytest.importorskip("published_trials", reason="needs Sphinx, the extra [docs]")


def test_links_of_trials_are_downloads_and_others_stay():
    text = r"| [LWR \<x\>](scoreboard/trials/policy%3DLWR%2520x/a.parquet) | [spec](scoreboard/sweeps/a.yaml) |"
    role = "{download}`LWR <x> <scoreboard/trials/policy=LWR%20x/a.parquet>`"
    assert published_trials.with_downloads(text) == f"| {role} | [spec](scoreboard/sweeps/a.yaml) |"
