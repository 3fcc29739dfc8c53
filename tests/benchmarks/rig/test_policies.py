"""The skill with corrections practises, asks and learns again, from the demonstrations that it is given."""

from dataclasses import replace
from types import SimpleNamespace

import pytest

from benchmarks.rig import policies
from benchmarks.rig.policies import corrected, first, tuned_compliance
from experiments.corrections import CorrectionPlan
from experiments.sweep.policies import TrainingContext
from experiments.trial.trial_set import TrialSet
from models.scenario import load_scenario
from skill.policy.query_state import QueryState

STUCK = QueryState(
    **{"trial": 0, "time": 1.0, "depth": 0.01, "tilt": (0.0, 0.0), "clocking": 0.0},
    **{"load": 20.0, "state": "", "pivot_height": 0.0, "friction": 0.2},
)


def shown(number):
    return [SimpleNamespace(good=k % 5 < 4, name=k) for k in range(number)]


@pytest.fixture
def practice(monkeypatch):
    """What was learnt and practised; the skill is stuck in every practice trial but the first of a round."""
    done = SimpleNamespace(learnt=[], numbers=[], asked=[])

    def ask(scenario, policy, numbers, *, jobs):
        done.numbers.append(numbers)
        return ((None, None if number == numbers[0] else replace(STUCK, trial=number)) for number in numbers)

    def demonstrate(scenario, query_states, *, seed, jobs):
        done.asked.append([query_state.trial for query_state in query_states.values()])
        return ((k, SimpleNamespace(good=True, name=f"correction {s.trial}")) for k, s in query_states.items())

    def learn(training_context, **options):
        done.learnt.append([d.name for d in training_context.demonstrations])
        return "skill"

    monkeypatch.setattr(policies, "run_practice", ask)
    monkeypatch.setattr(policies, "demonstrate_corrections", demonstrate)
    monkeypatch.setattr(policies, "learn", learn)
    return done


def training_context(number, seed=3):
    return TrainingContext(load_scenario(), TrialSet.USUAL, shown(number), seed)


def test_corrections_are_asked_for_in_the_trials_of_the_product(practice):
    assert corrected(training_context(5), trials=4, most=2) == "skill"
    plan = CorrectionPlan(rounds=2, trials=4, most=2, seed=3)
    assert practice.numbers == [plan.numbers(1), plan.numbers(2)]
    assert practice.asked == [list(plan.numbers(k))[1:3] for k in (1, 2)]
    assert [len(names) for names in practice.learnt] == [5, 7, 9]
    assert practice.learnt[0] == practice.learnt[2][:5]


def test_a_share_of_the_demonstrations_is_replaced_by_corrections(practice):
    corrected(training_context(10), trials=4, most=None, share=0.2)
    assert [len(names) for names in practice.learnt] == [6, 8, 10]
    assert practice.learnt[0] == [0, 1, 2, 3, 5, 4]  # five good ones and a bad one


def test_a_law_that_is_tuned_for_an_arm_is_not_made_for_all():
    with pytest.raises(ValueError, match="MomentCompliance is tuned for one set of trials"):
        tuned_compliance(TrainingContext(load_scenario(), None, [], 0))


@pytest.mark.parametrize(("number", "good"), [(1, 1), (2, 2), (5, 4), (10, 8)])
def test_the_first_demonstrations_keep_the_share_of_good_ones(number, good):
    found = first(shown(10), number)
    assert len(found) == number
    assert sum(d.good for d in found) == good
