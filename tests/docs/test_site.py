"""The site of the documentation: its pages, links and reference, and the tutorials as scripts."""

import os
import subprocess
import sys
from importlib.util import find_spec

import pytest

from tests.checkout import ROOT, copy_checkout

pytestmark = [pytest.mark.slow, pytest.mark.nightly]

TUTORIALS = sorted((ROOT / "docs" / "tutorials").glob("plot_*.py"))


@pytest.mark.parametrize("tutorial", TUTORIALS, ids=lambda path: path.stem)
def test_a_tutorial_runs(tutorial, tmp_path):
    done = subprocess.run(
        [sys.executable, tutorial],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(ROOT), "MPLBACKEND": "agg"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip()
    assert "Warning" not in done.stderr


@pytest.mark.skipif(find_spec("sphinx") is None, reason="needs Sphinx, the extra [docs]")
def test_the_site_has_no_broken_link_and_no_warning(tmp_path):
    """Tutorials and notebooks are not run: the first have a test of their own, ``make docs`` runs both."""
    copy_checkout(tmp_path)
    options = ["-D", "plot_gallery=0", "-D", "nb_execution_mode=off", "--fail-on-warning", "--keep-going", "--quiet"]
    command = [sys.executable, "-m", "sphinx", *options, "docs", "site"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    for name in ("index", "gallery/plot_own_peg", "notebooks/what_are_the_contact_states", "reference/skill"):
        assert (tmp_path / "site" / f"{name}.html").is_file(), name
