"""How the policies of a sweep are found and made; what is wrong with one is told in one line."""

import pytest

from experiments.sweep.policies import TrainingContext, check_imports, make_policy
from experiments.sweep.specification import PolicyPlan
from experiments.trial.trial_set import TrialSet
from models.scenario import load_scenario

PUSHES = "tests.experiments.sweep.pushes"


def plan(make, **options):
    return PolicyPlan("push", None, make, options, None, False)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (plan(f"{PUSHES}:shove"), "sweep: policies.push: .*pushes:shove: cannot be imported"),
        (plan("no_such_package:push"), "policies.push: no_such_package:push: cannot be imported"),
        (plan(f"{PUSHES}:unwilling", speed=3), "policies.push: .*speed"),
        (plan(None, regresor="json:loads"), "policies.push: .*regresor"),
        (plan(None, skill="json:nothing"), "policies.push: json:nothing: cannot be imported"),
    ],
)
def test_what_cannot_be_imported_or_is_unknown_is_named_before_anything_is_made(wrong, message):
    with pytest.raises(ValueError, match=message) as error:
        check_imports(wrong, "sweep")
    assert "\n" not in str(error.value)


def test_a_policy_that_cannot_be_made_is_named():
    context = TrainingContext(load_scenario(), TrialSet.USUAL, [], 0)
    with pytest.raises(ValueError, match=r"policies.push: cannot be made and sent \(TypeError: .*speed"):
        make_policy(plan(f"{PUSHES}:push", speed=3), context)
    made = make_policy(plan(f"{PUSHES}:push", depth=0.003), context)
    assert (made.policy.depth, made.query_ms, made.demonstrations) == (0.003, None, None)


@pytest.mark.parametrize("what", ["lock", "database"])
def test_a_policy_that_cannot_be_sent_to_another_process_is_named(what):
    with pytest.raises(ValueError, match=r"policies.push: cannot be made and sent \(TypeError") as error:
        make_policy(plan(f"{PUSHES}:holding", what=what), TrainingContext(load_scenario(), TrialSet.USUAL, [], 0))
    assert "\n" not in str(error.value)
