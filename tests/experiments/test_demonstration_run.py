import gc
import weakref
from dataclasses import replace

import numpy as np
import pytest
from pydrake.math import RigidTransform

from experiments import demonstration_run
from experiments.demonstration_run import DemonstrationRun
from models.scenario import DEMONSTRATION_STREAM, resolve_scenario
from skill.data.outcome import Ending, Outcome
from systems.virtual_environment import MakeVirtualEnvironment
from tests.quick_scenario import make_quick_scenario


class FailingSimulator:
    """A simulator that raises an exception."""

    def __init__(self, error):
        self.error = error

    def AdvanceTo(self, time):
        raise self.error


@pytest.mark.parametrize(
    ("error", "detail"),
    [(RuntimeError(), "RuntimeError"), (RuntimeError("no solution\nin step 7"), "RuntimeError: no solution")],
)
def test_an_exception_of_the_solver_ends_the_demonstration_as_diverged(quick_scenario, error, detail):
    run = DemonstrationRun(resolve_scenario(quick_scenario, seed=0, stream=DEMONSTRATION_STREAM))
    run.simulator = FailingSimulator(error)
    assert run.advance(0.1) == Ending(Outcome.DIVERGED, detail)


@pytest.fixture(scope="module")
def started():
    """A demonstration after 60 ms, before any contact: its resolved scenario, environment and run."""
    scenario = resolve_scenario(make_quick_scenario(), seed=7, stream=DEMONSTRATION_STREAM)
    environment = MakeVirtualEnvironment(scenario)
    run = DemonstrationRun(scenario, environment)
    assert run.advance(0.06) is None
    return scenario, environment, run


@pytest.fixture
def ended(started, monkeypatch):
    """The same, with an upright peg at full depth in all samples."""
    samples = demonstration_run.DemonstrationRecorder.samples
    upright = {"x": 0.0, "y": 0.0, "z": -started[0].full_depth, "angle": 0.0, "dangle": 0.0}
    monkeypatch.setattr(
        demonstration_run.DemonstrationRecorder, "samples", lambda *given: samples(*given).assign(**upright)
    )
    return started


class Placed:
    """A plant whose peg has a fixed pose."""

    def __init__(self, pose):
        self._pose = pose

    def peg_pose(self, context):
        return self._pose


@pytest.mark.parametrize(
    ("height", "outcome"),
    [
        (0.00199, None),
        (0.00201, Outcome.GIVEN_UP),
        (0.0, None),
        (-0.01169, None),
        (-0.01171, Outcome.INSERTED),
        (np.nan, Outcome.DIVERGED),
    ],
)
def test_the_height_of_the_tip_ends_a_demonstration(started, monkeypatch, height, outcome):
    """The peg starts 1 mm above the mouth and gives up at twice that; 11.7 of the hole's 12 mm are full depth."""
    _, environment, run = started
    pose = RigidTransform([0.0, 0.0, height])
    placed = replace(environment, plant=Placed(pose))
    status = demonstration_run._monitor(run._scenario, placed, run.simulator.get_context())
    assert (status.message() or None) == outcome
    assert (status.system() is None) == (outcome is None)


def test_a_run_that_nobody_needs_frees_its_simulation(quick_scenario):
    """Drake keeps the diagram, but the record and the state of the simulation are the larger part."""
    run = DemonstrationRun(resolve_scenario(quick_scenario, seed=0, stream=DEMONSTRATION_STREAM))
    run.advance(0.02)
    simulator = weakref.ref(run.simulator)
    del run
    gc.collect()
    assert simulator() is None


def test_the_time_limit_ends_a_demonstration(quick_scenario):
    quick_scenario.recorder.time_limit = 0.03
    run = DemonstrationRun(resolve_scenario(quick_scenario, seed=0, stream=DEMONSTRATION_STREAM))
    assert run.advance(0.02) is None
    assert run.simulator.get_context().get_time() == pytest.approx(0.02)
    assert run.advance(0.05) == Ending(Outcome.TIME_OVER)
    assert run.simulator.get_context().get_time() == pytest.approx(0.03)


def test_the_record_has_a_sample_per_period_and_tells_its_origin(ended):
    scenario, environment, run = ended
    found = run.demonstration(Ending(Outcome.INSERTED), operator=3)
    assert found.good
    assert found.outcome is Outcome.INSERTED
    assert found.samples["time"].to_numpy() == pytest.approx([0.0, 0.02, 0.04, 0.06])
    m = found.metadata
    assert (m["seed"], m["habit"], m["operator"]) == (scenario.seed, scenario.operator.habit, 3)
    assert m["penetration_um"] == 0.0
    assert m["lowest_probe_energy_J"] == environment.min_energy(run.simulator.get_context()) < 0.0


def test_the_overlap_is_recorded_in_tenths_of_a_micrometre(ended, monkeypatch):
    monkeypatch.setattr(demonstration_run, "deepest_overlap", lambda *_: 12.3456e-6)
    assert ended[2].demonstration(Ending(Outcome.INSERTED)).metadata["penetration_um"] == 12.3


@pytest.mark.parametrize(("outcome", "good"), [(Outcome.INSERTED, False), (Outcome.STOPPED, True)])
def test_the_operator_may_call_a_demonstration_good_or_bad(ended, outcome, good):
    assert ended[2].demonstration(Ending(outcome), good=good).good == good


def record_with_force(started, monkeypatch, force, ending, **arguments):
    """The demonstration of a resting peg if all its samples had a contact force (2, 3, 6) / 7 of this size, N."""
    scenario, _, run = started
    z = -scenario.full_depth if ending.outcome is Outcome.INSERTED else 0.0
    samples = demonstration_run.DemonstrationRecorder.samples

    def pressed(*given):
        return samples(*given).assign(fx=2 / 7 * force, fy=3 / 7 * force, fz=6 / 7 * force, z=z)

    monkeypatch.setattr(demonstration_run.DemonstrationRecorder, "samples", pressed)
    return run.demonstration(ending, **arguments)


@pytest.mark.parametrize(
    ("force", "outcome"),
    [
        (19.9, Outcome.INSERTED),
        (20.1, Outcome.INSERTED_ROUGHLY),
        (0.99e5, Outcome.INSERTED_ROUGHLY),
        (1.01e5, Outcome.DIVERGED),
    ],
)
def test_the_largest_force_of_an_insertion_decides_its_outcome(started, monkeypatch, force, outcome):
    found = record_with_force(started, monkeypatch, force, Ending(Outcome.INSERTED))
    assert found.outcome is outcome
    assert found.good == (outcome is Outcome.INSERTED)


def test_a_diverged_demonstration_is_bad_whatever_the_operator_says(started, monkeypatch):
    found = record_with_force(started, monkeypatch, 2e5, Ending(Outcome.INSERTED), good=True)
    assert (found.good, found.detail) == (False, "a contact force of 2e+05 N")


def test_a_peg_that_is_pressed_until_the_time_is_over_is_jammed(started, monkeypatch):
    monkeypatch.setattr("experiments.trial.stuck_peg.JAMMED_TIME", 0.03)
    for force, outcome in ((2.9, Outcome.TIME_OVER), (3.1, Outcome.JAMMED)):
        with monkeypatch.context() as patch:
            assert record_with_force(started, patch, force, Ending(Outcome.TIME_OVER)).outcome is outcome
            assert record_with_force(started, patch, force, Ending(Outcome.GIVEN_UP)).outcome is Outcome.GIVEN_UP
