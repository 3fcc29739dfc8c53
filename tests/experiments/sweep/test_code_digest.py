"""The digest of code: it sees every package that a trial needs; a worker with other code does nothing."""

from dataclasses import replace
from importlib.metadata import version

import pytest

from experiments.sweep.code_digest import PACKAGES, Requirements, code_digest, own_packages, values_digest
from experiments.sweep.policies import requirements_of
from experiments.sweep.specification import DemonstrationPlan, PolicyPlan


@pytest.fixture
def package(tmp_path, monkeypatch):
    (tmp_path / "own_package" / "late").mkdir(parents=True)
    (tmp_path / "own_package" / "__init__.py").write_text("")
    (tmp_path / "own_package" / "late" / "deep.py").write_text("x = 1\n")
    (tmp_path / "own_package" / "notes.txt").write_text("no code")
    (tmp_path / "beside.py").write_text("import json\n")
    monkeypatch.syspath_prepend(tmp_path)
    code_digest.cache_clear()
    yield tmp_path / "own_package"
    code_digest.cache_clear()


@pytest.mark.parametrize(("name", "changes"), [("late/deep.py", True), ("__init__.py", True), ("notes.txt", False)])
def test_a_changed_line_of_source_changes_the_digest(package, name, changes):
    before, beside = code_digest(("own_package",)), code_digest(("beside",))
    (package / name).write_text("# changed\n")
    assert code_digest(("own_package",)) == before  # as this process found it first
    code_digest.cache_clear()
    assert (code_digest(("own_package",)) != before) == changes
    assert code_digest(("beside",)) == beside


def test_installed_and_built_in_modules_are_not_a_users_own(package):
    paths = ["numpy:sin", "json:loads", "math:sin", "sys:path", "no_such_module:x", "tests.scripts:x", "models.a:b"]
    assert own_packages([*paths, "own_package.late.deep:x", "beside:y"]) == (
        "beside", "models", "own_package", "tests",
    )  # fmt: skip


def test_a_package_that_is_not_there_is_named():
    with pytest.raises(ValueError, match="no_such_package: no source found"):
        code_digest(("no_such_package",))


def test_a_digest_of_values_does_not_depend_on_the_order_of_keys():
    assert values_digest({"a": 1, "b": DemonstrationPlan()}) == values_digest({"b": DemonstrationPlan(), "a": 1})
    assert values_digest({"a": DemonstrationPlan(good=3)}) != values_digest({"a": DemonstrationPlan(good=4)})


def test_a_policy_requires_the_packages_that_it_names():
    plain = Requirements.of()
    plain.check()
    assert set(plain.packages) == set(PACKAGES)
    make = PolicyPlan("a", None, "joblib:Memory", {"states": "benchmarks.rig.learners:one_state"}, None, False)
    found = requirements_of(make)
    assert "benchmarks" in found.packages
    assert found.code != plain.code
    assert found.versions["joblib"] == version("joblib")
    learn = PolicyPlan("a", None, None, {"regressor": "sklearn.linear_model:Ridge"}, DemonstrationPlan(), False)
    assert requirements_of(learn).versions == {**plain.versions, "scikit-learn": version("scikit-learn")}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"code": "another revision"}, "other code than the client"),
        ({"versions": {"drake": "0.1"}}, r"a worker has drake 1\.\d+.*, the client 0\.1"),
    ],
)
def test_another_revision_or_version_is_refused(change, message):
    with pytest.raises(ValueError, match=message):
        replace(Requirements.of(), **change).check()
