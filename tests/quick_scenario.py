"""A scenario that simulates quickly, and the demonstrations that the tests record in it."""

from experiments.demonstration_set import Request
from models.scenario import Scenario

REQUESTS = [*(Request(number, "expert", True) for number in range(5)), Request(5, "slams", False)]


def make_quick_scenario() -> Scenario:
    """A shallow hole just below the peg: an insertion takes half a second."""
    scenario = Scenario()
    scenario.geometry.hole_depth = 0.012
    scenario.geometry.peg_length = 0.040
    scenario.start.height = 0.001
    # Five demonstrations cover less than thirty, so the gimbal's pivot and the friction vary less.
    scenario.rig.pivot_range = scenario.rig.demonstrated_pivot_range = 0.001
    scenario.contact.friction_spread = 0.1
    scenario.recorder.time_limit = 3.0
    scenario.trial.time_limit = 3.0
    return scenario
