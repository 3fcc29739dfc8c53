import pytest

from models.scenario import DEMONSTRATION_STREAM, resolve_scenario
from skill.data.outcome import Ending, Outcome
from systems.runs.demonstration_run import DemonstrationRun


class FailingSimulator:
    """A simulator that raises an exception."""

    def __init__(self, error):
        self.error = error

    def AdvanceTo(self, time):
        raise self.error


@pytest.mark.parametrize(
    ("error", "detail"),
    [(RuntimeError(), "RuntimeError: "), (RuntimeError("no solution\nin step 7"), "RuntimeError: no solution")],
)
def test_an_exception_of_the_solver_ends_the_demonstration_as_diverged(quick_scenario, error, detail):
    run = DemonstrationRun(resolve_scenario(quick_scenario, seed=0, stream=DEMONSTRATION_STREAM))
    run.simulator = FailingSimulator(error)
    assert run.advance(0.1) == Ending(Outcome.DIVERGED, detail)
