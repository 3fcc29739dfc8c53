import subprocess
import sys
from pathlib import Path

import pytest

import skill

ROOT = Path(__file__).resolve().parents[2]


def run(code):
    """Runs code in a fresh process and returns what it prints."""
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


def test_importing_the_package_imports_no_heavy_package():
    loaded = run("import sys, skill; print(*sys.modules)")
    assert "skill" in loaded
    assert not {"numpy", "sklearn", "pandas", "scipy", "pyarrow", "matplotlib", "pydrake"} & set(loaded)


@pytest.mark.slow
def test_the_learner_needs_no_package_of_an_extra(tmp_path):
    (tmp_path / "wrench.csv").write_text("time,fx\n" + "".join(f"{k / 100},{k % 7}\n" for k in range(50)))
    code = f"""
import sys
for name in ("pyarrow", "matplotlib", "meshcat", "umsgpack", "pydrake", "tornado"):
    sys.modules[name] = None
import skill
for name in skill.__all__:
    getattr(skill, name)
print(len(skill.read_recordings({str(tmp_path / "wrench.csv")!r}, columns=["f=fx"])[0].time))
"""
    assert run(code) == ["50"]


@pytest.mark.parametrize("name", skill.__all__)
def test_every_exported_name_is_defined_in_its_module(name):
    exported = getattr(skill, name)
    assert exported.__name__ == name
    assert exported.__module__ == f"skill.{skill._HOMES[name]}"
    assert name in dir(skill)


def test_the_three_lists_of_exports_agree():
    """The list of names, the table of their modules, and the imports that type checkers read."""
    assert sorted(skill.__all__) == list(skill.__all__) == sorted(skill._HOMES)
    lines = Path(skill.__file__).read_text().split("if TYPE_CHECKING:\n")[1].split("\n\n")[0].splitlines()
    imported = {}
    for line in lines:
        module, names = line.strip().removeprefix("from skill.").split(" import ")
        imported.update(dict.fromkeys(names.split(", "), module))
    assert imported == skill._HOMES
