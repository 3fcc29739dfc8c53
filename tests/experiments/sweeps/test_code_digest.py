"""The digest of code: it sees every module that a trial runs, and no other."""

import json
import sys

import pytest

from experiments.sweeps.code_digest import _closure, _is_module, code_digest, is_local, modules_of
from tests.scripts.commands import run_python

PACKAGE = {
    "__init__.py": "",
    "entry.py": "from own_package import used\nimport own_package.late.deep\n",
    "used.py": "def f():\n    from own_package.lazy import g\n    return g\n",
    "lazy.py": "g = 1\n",
    "late/__init__.py": "",
    "late/deep.py": "import json\n",
    "unused.py": "x = 1\n",
    "late/near.py": "from . import deep\nfrom ..lazy import g\nimport beside\n",
}


@pytest.fixture
def package(tmp_path, monkeypatch):
    for name, text in PACKAGE.items():
        path = tmp_path / "own_package" / name
        path.parent.mkdir(exist_ok=True, parents=True)
        path.write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    yield tmp_path / "own_package"
    for name in [name for name in sys.modules if name.split(".")[0] == "own_package"]:
        del sys.modules[name]


def digest():
    _closure.cache_clear()
    _is_module.cache_clear()
    return code_digest(["own_package.entry"], packages=["own_package"])


def test_modules_are_followed_into_functions_and_packages(package):
    found = modules_of(["own_package.entry"], packages=["own_package"])
    names = ("own_package", "own_package.entry", "own_package.used", "own_package.lazy", "own_package.late")
    assert found == {*names, "own_package.late.deep"}


@pytest.mark.parametrize("name", ["entry.py", "used.py", "lazy.py", "late/__init__.py", "late/deep.py"])
def test_a_changed_line_of_what_is_imported_changes_the_digest(package, name):
    before = digest()
    (package / name).write_text(PACKAGE[name] + "# changed\n")
    assert digest() != before


def test_a_changed_line_of_what_is_not_imported_does_not(package):
    before = digest()
    (package / "unused.py").write_text("x = 2\n")
    assert digest() == before


def test_relative_imports_and_modules_beside_the_package_are_followed(package):
    (package.parent / "beside.py").write_text("import json, numpy\n")
    is_local.cache_clear()
    _closure.cache_clear()
    found = modules_of(["own_package.late.near"])
    names = {"own_package", "own_package.late", "own_package.late.near", "own_package.late.deep", "own_package.lazy"}
    assert found == {*names, "beside"}  # and neither Python's nor installed ones


def test_installed_and_built_in_modules_are_not_local():
    assert [is_local(name) for name in ("numpy", "json", "math", "sys", "no_such_module")] == [False] * 5
    assert is_local("tests")


def test_a_module_that_is_not_there_is_named():
    with pytest.raises(ValueError, match=r"module own_package\.nothing: no source found"):
        code_digest(["own_package.nothing"])


@pytest.mark.slow
def test_every_module_that_a_trial_and_its_training_load_is_in_the_digest(skill_file, demonstration_folder):
    code = f"""
import json, sys
from pathlib import Path
before = set(sys.modules)
from experiments.sweeps.trial_rows import TrialSource, perform
from experiments.sweeps.policies import TrainingContext, make_policy
from experiments.sweeps.specification import DemonstrationPlan, PolicyPlan
from skill.data.demonstration import read_demonstrations
from experiments.trial import Arm
from tests.quick_scenario import make_quick_scenario
scenario = make_quick_scenario()
shown = read_demonstrations(Path({str(demonstration_folder)!r}))
plan = PolicyPlan("a", None, None, {{}}, DemonstrationPlan(), False)
made = make_policy(plan, TrainingContext(scenario, Arm.DEFAULT, shown, 0))
row = perform(TrialSource(scenario, Arm.DEFAULT, "drake", "", "a", "{{}}"), made.policy, 84001, {{}})
loaded = [name for name in sys.modules if name.split(".")[0] in ("models", "skill", "systems", "experiments")]
print(json.dumps([loaded, row["trial"]]))
"""
    done = run_python("-c", code)
    assert done.returncode == 0, done.stderr
    loaded, trial = json.loads(done.stdout.splitlines()[-1])
    entries = ["experiments.sweeps.trial_rows", "experiments.sweeps.policies", "experiments.demonstration_set"]
    assert trial == 84001
    assert len(loaded) > 80
    assert set(loaded) <= modules_of(entries)
