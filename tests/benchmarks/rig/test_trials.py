"""Trials are performed once and stored; failures do not stop the others."""

from benchmarks.rig import trials
from benchmarks.rig.comparison import summary, wilson
from benchmarks.rig.control_laws import StraightPush
from benchmarks.rig.trials import Entry, Setting, perform
from systems.runs.trial import Arm, trial_scenario


def test_stored_trials_are_not_repeated(setting, performed, push, no_progress):
    entry = Entry("Push, straight", push)
    perform(entry, setting, no_progress)
    assert performed == [7000, 7001, 7002, 7003]
    assert (setting.folder / entry.file).exists()
    more = Setting(**(vars(setting) | {"trials": 6}))
    record = perform(entry, more, no_progress)
    assert performed[4:] == [7004, 7005]
    row = summary(entry, record, setting)
    assert (row["inserted"], row["trials"], row["ends"]) == (3, 4, {"time over": 1})
    assert row["interval"] == list(wilson(3, 4))


def test_draws_share_the_trials(setting, performed, push, no_progress):
    record = perform(Entry("draws", push, draws=2), setting, no_progress)
    assert performed == [7000, 7002, 7001, 7003]
    assert [record.trials[str(n)]["time_s"] for n in (7000, 7001)] == [5.0, 2.5]


def test_an_exception_in_a_trial_is_a_failed_trial(quick_scenario):
    class Broken(StraightPush):
        def act(self, measured, probabilities=None, contexts=None):
            raise ArithmeticError("here")

    row = trials.attempt(quick_scenario, Arm.DEFAULT, Broken(speed=0.01), 7000)
    assert not row["inserted"]
    assert "here" in row["reason"]


def test_the_trials_are_those_of_the_arm(quick_scenario, monkeypatch):
    quick_scenario.rig.pivot_range = 0.003
    found = []
    monkeypatch.setattr(trials, "run_trial", lambda scenario, policy, seed: found.append(scenario))
    trials.attempt(quick_scenario, Arm.STRESS, StraightPush(speed=0.01), 7000)
    assert found == [trial_scenario(quick_scenario, number=7000, arm=Arm.STRESS)]
