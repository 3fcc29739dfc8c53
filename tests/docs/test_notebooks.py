"""The code of notebooks and tutorials calls functions as they are; only `make docs` runs it, which takes minutes."""

import json
import subprocess
import sys

import pytest

from tests.checkout import ROOT

LEFT_OUT = ("no-untyped-def", "assignment")  # a reader needs neither types nor a new name for each result


@pytest.mark.slow
@pytest.mark.nightly
def test_notebooks_and_tutorials_have_the_right_types(tmp_path):
    files = sorted((ROOT / "docs" / "tutorials").glob("*.py"))
    for notebook in (ROOT / "docs" / "notebooks").glob("*.ipynb"):
        cells = [cell for cell in json.loads(notebook.read_text())["cells"] if cell["cell_type"] == "code"]
        lines = "\n".join("".join(cell["source"]) for cell in cells).splitlines()
        files.append(tmp_path / f"{notebook.stem}.py")
        files[-1].write_text("\n".join(line for line in lines if not line.startswith("%")))
    options = [f"--disable-error-code={code}" for code in LEFT_OUT]
    done = subprocess.run([sys.executable, "-m", "mypy", *options, *files], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
