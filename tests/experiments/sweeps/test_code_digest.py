"""The digest of code: it sees every module that a trial runs, and no other; a worker with other code does nothing."""

import json
import sys
from dataclasses import replace
from importlib.metadata import version

import pytest

from experiments.sweeps import code_digest as digests
from experiments.sweeps.code_digest import code_digest, is_own, modules_of
from experiments.sweeps.policies import named_packages
from experiments.sweeps.policy_store import requirements_of
from experiments.sweeps.specification import DemonstrationPlan, PolicyPlan
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
    (tmp_path / "beside.py").write_text("import json, numpy\n")
    monkeypatch.syspath_prepend(tmp_path)
    forget()
    yield tmp_path / "own_package"
    forget()
    for name in [name for name in sys.modules if name.split(".")[0] == "own_package"]:
        del sys.modules[name]


def forget():
    for known in (digests._own_imports, digests._is_module, digests._source, digests._file_digest, is_own):
        known.cache_clear()


def test_modules_are_followed_into_functions_packages_and_relative_imports(package):
    common = {"own_package", "own_package.lazy", "own_package.late", "own_package.late.deep"}
    assert modules_of(["own_package.entry"]) == {*common, "own_package.entry", "own_package.used"}
    assert modules_of(["own_package.late.near"]) == {*common, "own_package.late.near", "beside"}  # no installed ones


@pytest.mark.parametrize(("name", "changes"), [("lazy.py", True), ("late/__init__.py", True), ("unused.py", False)])
def test_a_changed_line_of_what_is_imported_changes_the_digest_and_no_other(package, name, changes):
    before = code_digest(modules_of(["own_package.entry"]))
    (package / name).write_text(PACKAGE[name] + "# changed\n")
    assert code_digest(modules_of(["own_package.entry"])) == before  # as this process found it first
    forget()
    assert (code_digest(modules_of(["own_package.entry"])) != before) == changes


def test_installed_and_built_in_modules_are_not_a_users_own():
    assert [is_own(name) for name in ("numpy", "json", "math", "sys", "no_such_module")] == [False] * 5
    assert is_own("tests")
    assert is_own("models")


def test_a_module_that_is_not_there_is_named():
    with pytest.raises(ValueError, match=r"module own_package\.nothing: no source found"):
        code_digest(["own_package.nothing"])


def test_a_policy_requires_the_modules_and_packages_that_it_names():
    plain = requirements_of()
    plain.check()
    assert "systems.rig" in plain.modules
    make = PolicyPlan("a", None, "joblib:Memory", {"states": "benchmarks.rig.learners:one_state"}, None, False)
    found = requirements_of(make)
    assert "benchmarks.rig.learners" in found.modules
    assert found.code != plain.code
    assert dict(found.versions)["joblib"] == version("joblib")
    learn = PolicyPlan("a", None, None, {"regressor": "sklearn.linear_model:Ridge"}, DemonstrationPlan(), False)
    assert named_packages(learn) == {"scikit-learn": version("scikit-learn")}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"code": "another revision"}, "other code than the client"),
        ({"versions": (("drake", "0.1"),)}, r"a worker has drake 1\.\d+.*, the client 0\.1"),
    ],
)
def test_another_revision_or_version_is_refused(change, message):
    with pytest.raises(ValueError, match=message):
        replace(requirements_of(), **change).check()


@pytest.mark.nightly
@pytest.mark.slow
def test_every_module_that_a_trial_and_its_training_load_is_in_the_digest(skill_file, demonstration_folder):
    code = f"""
import json, sys
from pathlib import Path
from experiments.sweeps.trial_rows import TrialSource, perform, trial_modules
from experiments.sweeps.policies import TrainingContext, make_policy
from experiments.sweeps.specification import DemonstrationPlan, PolicyPlan
from skill.data.demonstration import read_demonstrations
from experiments.trial.trial_set import TrialSet
from tests.quick_scenario import make_quick_scenario
scenario = make_quick_scenario()
shown = read_demonstrations(Path({str(demonstration_folder)!r}))
plan = PolicyPlan("a", None, None, {{}}, DemonstrationPlan(), False)
made = make_policy(plan, TrainingContext(scenario, TrialSet.USUAL, shown, 0))
row = perform(TrialSource(scenario, TrialSet.USUAL, "", "a", "{{}}"), made.policy, 84001, {{}})
loaded = [name for name in sys.modules if name.split(".")[0] in ("models", "skill", "systems", "experiments")]
print(json.dumps([loaded, trial_modules(), row["trial"]]))
"""
    done = run_python("-c", code)
    assert done.returncode == 0, done.stderr
    loaded, known, trial = json.loads(done.stdout.splitlines()[-1])
    assert trial == 84001
    assert len(loaded) > 80
    assert set(loaded) <= set(known)
