"""A worker with other code or packages than the client does nothing."""

from dataclasses import replace
from importlib.metadata import version

import pytest

from experiments.sweeps.policies import named_packages
from experiments.sweeps.requirements import Requirements
from experiments.sweeps.specification import DemonstrationPlan, PolicyPlan
from tests.scripts.commands import run_python


def test_the_process_that_asks_meets_its_own_requirements():
    own = Requirements.of("drake", ["tests.experiments.sweeps.pushes"])
    own.check()
    assert "tests.experiments.sweeps.pushes" in own.modules
    assert "systems.rig" in own.modules
    assert own.code != Requirements.of("drake").code


def test_the_versions_of_the_packages_that_a_policy_names_are_required(tmp_path):
    learn = {"regressor": "sklearn.linear_model:Ridge", "states": "benchmarks.rig.learners:one_state"}
    plan = PolicyPlan("a", None, None, learn, DemonstrationPlan(), False)
    assert named_packages(plan) == {"scikit-learn"}
    found = dict(Requirements.of("drake", packages=["joblib"]).versions)
    assert found["joblib"] == version("joblib")


def test_a_policy_requires_the_modules_and_packages_that_it_names():
    make = PolicyPlan("a", None, "joblib:Memory", {"states": "benchmarks.rig.learners:one_state"}, None, False)
    found = Requirements.of_policy("drake", make)
    assert "benchmarks.rig.learners" in found.modules
    assert dict(found.versions)["joblib"] == version("joblib")


def test_a_module_counts_as_this_process_found_it_first(tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path)
    for name in ("first_module", "second_module"):
        (tmp_path / f"{name}.py").write_text("x = 1\n")
    before = Requirements.of("drake", ["first_module"])
    (tmp_path / "first_module.py").write_text("x = 2\n")  # too late: it may have been imported
    assert Requirements.of("drake", ["first_module"]) == before
    both = Requirements.of("drake", ["first_module", "second_module"])
    (tmp_path / "first_module.py").write_text("x = 1\n")
    done = run_python(
        "-c",
        "from experiments.sweeps.requirements import Requirements; import sys; sys.path.append(sys.argv[1])\n"
        "print(Requirements.of('drake', ['first_module', 'second_module']).code)",
        str(tmp_path),
    )
    assert done.stdout.strip() == both.code


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"code": "another revision"}, "other code than the client"),
        ({"versions": (("python", "2.7"),)}, r"a worker has python 3\.\d+.*, the client 2\.7"),
        ({"versions": (("drake", "0.1"),)}, r"a worker has drake 1\.\d+.*, the client 0\.1"),
    ],
)
def test_another_revision_or_version_is_refused(change, message):
    with pytest.raises(ValueError, match=message):
        replace(Requirements.of("drake"), **change).check()
