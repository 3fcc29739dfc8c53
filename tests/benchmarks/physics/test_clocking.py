import pytest

from benchmarks.physics.clocking import in_drake, in_exact_engine, law
from models.scenario import Scenario, load_scenario
from models.section import NAMES


@pytest.mark.parametrize("name", [*NAMES[1:], "two_pin_plug"])
def test_the_exact_engine_turns_a_peg_as_far_as_plane_geometry(name):
    scenario = Scenario() if name in NAMES else load_scenario(name)
    scenario.geometry.section = name if name in NAMES else "round"
    assert in_exact_engine(scenario) == pytest.approx(law(scenario.geometry), abs=2e-9)


def test_the_meshes_of_drake_do_so_within_a_thousandth():
    scenario = Scenario()
    scenario.geometry.section = "hexagon"
    assert in_drake(scenario) == pytest.approx(law(scenario.geometry), rel=1e-3)
