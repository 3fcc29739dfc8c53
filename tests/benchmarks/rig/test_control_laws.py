"""The control laws follow their equations, and the tuning finds the best parameters."""

import numpy as np
import pytest
from scipy.stats import qmc

from benchmarks.rig.control_laws import FIRST_TUNING, ROUNDS, MomentCompliance, SpiralSearch, tune
from skill.features.measurement import observations
from skill.states.estimate import Estimate, estimates

PERIOD = 0.02


def measured(force=(0.0, 0.0, 0.0), moment=(0.0, 0.0, 0.0), z=-0.01):
    return np.array([*force, *moment, z])


def test_compliance_turns_with_the_moment_about_its_centre():
    law = MomentCompliance(gain=2.0, height=0.01, dead_zone=0.03, speed=0.01, yield_force=20.0)
    # A force of 6 N along y through the centre, 10 mm above the tip, has the moment -0.06 N m about the tip's x.
    action = law.act(measured(force=(0, 6, 0), moment=(-0.06, 0, 0)), Estimate())
    np.testing.assert_allclose(action.turn, 0.0, atol=1e-15)
    action = law.act(measured(moment=(0.03, 0.04, 0)), Estimate())  # 50 mN m, 20 beyond the dead zone
    np.testing.assert_allclose(action.turn, 2.0 * np.array([0.6, 0.8]) * 0.02 * PERIOD)
    assert action.feed == pytest.approx(-0.01 * PERIOD * (1 - 5 / 20))  # a load of 0.05 N m / 10 mm
    assert law.act(measured(force=(0, 0, 500)), Estimate()).feed == pytest.approx(0.5 * 0.01 * PERIOD)


def search(law, loads):
    """The angles (n, 2) of the search after each load, rad."""
    rows = [measured(force=(0, 0, load)) for load in loads]
    found = estimates(law.estimator(), [observations(row, np.zeros(2)) for row in rows])
    return np.cumsum([law.act(row, estimate).turn for row, estimate in zip(rows, found, strict=True)], axis=0)


def test_the_search_follows_a_spiral_at_a_constant_rate_and_returns():
    law = SpiralSearch(spacing=0.01, rate=0.1, outer=0.03, touch=3.0)
    angles = search(law, [5.0] * len(law.state_names()))
    steps = np.linalg.norm(np.diff(angles, axis=0), axis=1)
    np.testing.assert_allclose(steps[10:-1], 0.1 * PERIOD, rtol=0.05)
    radius = np.linalg.norm(angles, axis=1)
    assert radius.max() == pytest.approx(0.03, rel=0.02)
    np.testing.assert_allclose(angles[-1], 0.0, atol=1e-12)
    # Turns are one spacing apart.
    angle = np.unwrap(np.arctan2(angles[:, 1], angles[:, 0]))[: radius.argmax()]
    np.testing.assert_allclose(np.interp(angle[-1] - 2 * np.pi, angle, radius[: len(angle)]), 0.03 - 0.01, rtol=0.03)


def test_tuning_halves_the_candidates_and_chooses_the_lowest_cost_on_its_own_trials(quick_scenario):
    performed = []

    def perform(k, law, numbers):
        performed.extend((k, number) for number in numbers)
        return [{"inserted": True, "time_s": 0.05 / law.speed, "peak_load_n": 10.0} for _ in numbers]

    best, mean_cost = tune(MomentCompliance, quick_scenario, 8, perform)
    # Every trial inserts with the same force, so that the fastest of eight candidates has the lowest cost.
    by_round = [sum(1 for _, n in performed if n == number) for number in range(FIRST_TUNING, FIRST_TUNING + 14)]
    assert by_round == [8, 8, 2, 2, 2, 2, *[1] * 8]
    assert len(performed) == sum(max(1, 8 // share) * trials for share, trials in ROUNDS)
    places = qmc.LatinHypercube(len(MomentCompliance.ranges), seed=0).random(7)
    assert best.speed == max(MomentCompliance.at(place).speed for place in places)
    assert mean_cost == pytest.approx(0.05 / best.speed / quick_scenario.trial.time_limit + 10.0 / 40.0)
