"""Trials are performed once and stored; failures do not stop the others."""

from benchmarks.rig import trials
from benchmarks.rig.comparison import summary
from benchmarks.rig.control_laws import StraightPush
from benchmarks.rig.trials import FIRST_TRIAL as FIRST
from benchmarks.rig.trials import Entry, Setting, perform
from systems.runs.trial import Arm, trial_scenario
from systems.scoreboard.paired_statistics import wilson


def test_stored_trials_are_not_repeated(setting, performed, push, no_progress):
    entry = Entry("Push, straight", push)
    perform(entry, setting, no_progress)
    assert performed == [FIRST, FIRST + 2, FIRST + 1, FIRST + 3]
    assert (setting.folder / entry.file).exists()
    more = Setting(**(vars(setting) | {"trials": 6}))
    record = perform(entry, more, no_progress)
    assert performed[4:] == [FIRST + 4, FIRST + 5]
    row = summary(entry, record, setting)
    assert (row["inserted"], row["trials"], row["ends"]) == (3, 4, {"time over": 1})
    assert row["interval"] == list(wilson(3, 4))


def test_the_sets_share_the_trials(setting, performed, push, no_progress):
    record = perform(Entry("learnt", push), setting, no_progress)
    assert performed == [FIRST, FIRST + 2, FIRST + 1, FIRST + 3]
    assert [record.trials[str(n)]["time_s"] for n in (FIRST, FIRST + 1)] == [5.0, 2.5]


def test_a_policy_that_does_not_learn_performs_all_trials_itself(setting, performed, push, no_progress):
    entry = Entry("fixed", push, learns=False)
    record = perform(entry, setting, no_progress)
    assert performed == [FIRST, FIRST + 1, FIRST + 2, FIRST + 3]
    assert [row["time_s"] for row in record.trials.values()] == [5.0] * 4
    row = summary(entry, record, setting)
    assert (row["interval_over_sets"], row["worst_set"]) == (None, None)


def test_the_interval_over_sets_contains_the_sets(setting, performed, push, no_progress):
    entry = Entry("learnt", push)
    row = summary(entry, perform(entry, setting, no_progress), setting)
    assert row["inserted"] == 3  # the second trial fails, which belongs to the second set
    assert row["worst_set"] == 0.5
    assert row["interval_over_sets"] == [0.5, 1.0]


def test_an_exception_in_a_trial_is_a_failed_trial(quick_scenario):
    class Broken(StraightPush):
        def act(self, measured, probabilities=None, contexts=None):
            raise ArithmeticError("here")

    row = trials.attempt(quick_scenario, Arm.DEFAULT, Broken(speed=0.01), FIRST)
    assert not row["inserted"]
    assert "here" in row["reason"]


def test_the_trials_are_those_of_the_arm(quick_scenario, monkeypatch):
    quick_scenario.rig.pivot_range = 0.003
    found = []
    monkeypatch.setattr(trials, "run_trial", lambda scenario, policy, seed: found.append(scenario))
    trials.attempt(quick_scenario, Arm.STRESS, StraightPush(speed=0.01), FIRST)
    assert found == [trial_scenario(quick_scenario, number=FIRST, arm=Arm.STRESS)]
