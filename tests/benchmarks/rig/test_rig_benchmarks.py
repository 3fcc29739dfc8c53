"""The comparisons on the rig: what their figures rest on."""

import numpy as np
import pytest
from statsmodels.stats.proportion import proportion_confint

from benchmarks.rig import ablations, peers, trials
from benchmarks.rig.control_laws import MomentCompliance, SpiralSearch, StraightPush, cost, tuned, tuning_trials
from benchmarks.rig.trials import FIRST_TRIAL, FIRST_TUNING, Arm, Setting, compare, perform, wilson

PERIOD = 0.02


def measured(force=(0.0, 0.0, 0.0), moment=(0.0, 0.0, 0.0), z=-0.01):
    return np.array([*force, *moment, z])


@pytest.mark.parametrize(("successes", "n"), [(0, 20), (1, 20), (13, 20), (20, 20), (99, 100)])
def test_the_interval_is_wilsons(successes, n):
    assert wilson(successes, n) == pytest.approx(proportion_confint(successes, n, method="wilson"), abs=1e-6)


def test_compliance_yields_to_the_moment_about_its_centre():
    law = MomentCompliance(gain=2.0, height=0.01, dead_zone=0.03, speed=0.01, yield_force=20.0)
    # A force of 6 N along y through the centre, 10 mm above the tip, has the moment -0.06 N m about the tip's x.
    action = law.act(measured(force=(0, 6, 0), moment=(-0.06, 0, 0)))
    np.testing.assert_allclose(action.turn, 0.0, atol=1e-15)
    action = law.act(measured(moment=(0.03, 0.04, 0)))  # 50 mN m, 20 beyond the dead zone
    np.testing.assert_allclose(action.turn, 2.0 * np.array([0.6, 0.8]) * 0.02 * PERIOD)
    assert action.feed == pytest.approx(-0.01 * PERIOD * (1 - 5 / 20))  # a load of 0.05 N m / 10 mm
    assert law.act(measured(force=(0, 0, 500))).feed == pytest.approx(0.5 * 0.01 * PERIOD)


def walk(law, loads):
    """Where the search has turned to after each load."""
    follower = law.state_filter()
    belief, place, places = follower.initial_log_belief(), np.zeros(2), []
    for load in loads:
        row = measured(force=(0, 0, load))
        estimate = follower.step(belief, law.measured_features(row))
        belief = estimate.log_belief
        place = place + law.act(row, estimate.probabilities).turn
        places.append(place)
    return np.array(places)


def test_the_search_walks_a_spiral_at_a_steady_rate_and_comes_back():
    law = SpiralSearch(spacing=0.01, rate=0.1, outer=0.03, touch=3.0)
    places = walk(law, [5.0] * law.n_states)
    steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
    np.testing.assert_allclose(steps[10:-1], 0.1 * PERIOD, rtol=0.05)
    radius = np.linalg.norm(places, axis=1)
    assert radius.max() == pytest.approx(0.03, rel=0.02)
    np.testing.assert_allclose(places[-1], 0.0, atol=1e-12)
    # Turns are one spacing apart.
    angle = np.unwrap(np.arctan2(places[:, 1], places[:, 0]))[: radius.argmax()]
    np.testing.assert_allclose(np.interp(angle[-1] - 2 * np.pi, angle, radius[: len(angle)]), 0.03 - 0.01, rtol=0.03)


def test_the_search_rests_where_nothing_resists():
    law = SpiralSearch(touch=3.0)
    places = walk(law, [5.0] * 20 + [1.0] * 20 + [5.0])
    np.testing.assert_array_equal(places[20:40], np.tile(places[19], (20, 1)))
    np.testing.assert_allclose(places[40], walk(law, [5.0] * 21)[-1])


@pytest.fixture
def performed(monkeypatch):
    """Trials that cost nothing; the fixture lists them. Trials of a slower law insert later, number 7001 fails."""
    made = []

    def attempt(scenario, policy, number):
        made.append(number)
        good = number != FIRST_TRIAL + 1
        return {
            "seed": number,
            "inserted": good,
            "reason": "inserted" if good else "time over",
            "time_s": 0.05 / policy.speed,
            "peak_lateral_n": 10.0,
            "cpu_s": 0.5,
        }

    monkeypatch.setattr(trials, "attempt", attempt)
    return made


@pytest.fixture
def setting(quick_scenario, demonstrations, tmp_path):
    return Setting(quick_scenario, demonstrations, tmp_path / "results", trials=4, jobs=1, candidates=8)


def push(setting, record, advance, draw):
    return StraightPush(speed=0.01 * (1 + draw))


def nothing(note):
    pass


def test_what_is_stored_is_not_done_again(setting, performed):
    arm = Arm("Push, straight", push)
    perform(arm, setting, nothing)
    assert performed == [7000, 7001, 7002, 7003]
    assert (setting.folder / arm.file).exists()
    more = Setting(**(vars(setting) | {"trials": 6}))
    record = perform(arm, more, nothing)
    assert performed[4:] == [7004, 7005]
    row = trials.summary(arm, record, setting)
    assert (row["inserted"], row["trials"], row["ends"]) == (3, 4, {"time over": 1})
    assert row["interval"] == list(wilson(3, 4))


def test_draws_share_the_trials(setting, performed):
    record = perform(Arm("draws", push, draws=2), setting, nothing)
    assert performed == [7000, 7002, 7001, 7003]
    assert [record.trials[str(n)]["time_s"] for n in (7000, 7001)] == [5.0, 2.5]


def test_a_policy_that_cannot_be_trained_does_not_take_the_others_along(setting, performed, tmp_path, capsys):
    def broken(setting, record, advance, draw):
        raise FloatingPointError("no such number")

    rows = compare("both", [Arm("broken", broken), Arm("push", push)], setting, tmp_path / "both.json")
    assert rows[0]["error"] == "draw 0 not trained: FloatingPointError: no such number"
    assert rows[1]["inserted"] == 3
    assert "no such number" in capsys.readouterr().out


def test_an_exception_in_a_trial_is_a_row(quick_scenario):
    class Broken(StraightPush):
        def act(self, measured, probabilities=None):
            raise ArithmeticError("here")

    row = trials.attempt(quick_scenario, Broken(speed=0.01), 7000)
    assert not row["inserted"]
    assert "here" in row["reason"]


def test_tuning_takes_the_cheapest_on_trials_of_its_own_and_goes_on_where_it_was(setting, performed):
    arm = Arm("tuned", lambda s, record, advance, draw: tuned(MomentCompliance, s, record, advance))
    record = perform(arm, setting, nothing)
    own = [n for n in performed if n >= FIRST_TUNING]
    assert len(own) == len(record.tuning) == tuning_trials(8)
    assert set(performed) - set(own) == set(setting.numbers)
    # Every trial inserts with the same force, so that the fastest of eight speeds is the cheapest.
    first = [k for k in range(8) if f"{k}:{FIRST_TUNING}" in record.tuning]
    times = {k: record.tuning[f"{k}:{FIRST_TUNING}"]["time_s"] for k in first}
    assert record.content["tuned"]["speed"] == pytest.approx(0.05 / min(times.values()))
    assert record.content["train_s"]["0"] == 0.5 * tuning_trials(8)
    more = Setting(**(vars(setting) | {"trials": 5}))
    perform(arm, more, nothing)
    assert performed[-1] == 7004
    assert [n for n in performed if n >= FIRST_TUNING] == own


def test_a_failure_costs_more_than_any_insertion(setting):
    slow = {"inserted": True, "time_s": setting.scenario.trial.time_limit, "peak_lateral_n": 90.0}
    assert cost(slow, setting) < cost({"inserted": False}, setting)


def test_the_figures_show_what_was_performed(setting, performed, tmp_path):
    names = ("1 demonstration", "3 demonstrations", "raw features", ablations.SKILL)
    summaries = compare("some", [Arm(name, push) for name in names], setting, None)
    ablations.draw(summaries, tmp_path, whole=30)
    assert (tmp_path / "learning_curve.svg").stat().st_size > 10_000
    assert (tmp_path / "ablations.svg").stat().st_size > 10_000


def test_every_row_of_the_figure_is_an_arm_and_no_two_share_a_file(tmp_path):
    arms = ablations.arms(tmp_path)
    names = {arm.name for arm in arms}
    assert {name for _, rows in ablations.GROUPS for _, name in rows} <= names
    assert {ablations.curve_name(size) for size in ablations.SIZES} <= names
    both = {arm.name: arm.file for arm in [*arms, *peers.arms(24)]}
    assert len(set(both.values())) == len(both)
    # What both comparisons perform, they share.
    assert {ablations.SKILL, ablations.STATELESS} <= {arm.name for arm in peers.arms(24)}


@pytest.mark.parametrize("size", [1, 2, 3, 5])
def test_small_sets_are_of_the_right_size_and_hold_a_good_one(demonstrations, size):
    chosen = ablations.drawn(size)(demonstrations, 2)
    assert len(chosen) == size
    assert chosen[0].good
    assert {id(d) for d in ablations.drawn(1)(demonstrations, 2)} <= {id(d) for d in chosen}
