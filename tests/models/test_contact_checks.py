import pytest

from models.contact_checks import STATED_LOAD, expected_overlap, softest_modulus
from models.scenario import Scenario, parse_scenario, validate_scenario


@pytest.mark.parametrize(
    ("modulus", "load", "measured"),
    [
        *((1e8, 5.0, 57.3e-6), (1e9, 5.0, 22.9e-6), (1e10, 5.0, 9.27e-6), (1e11, 5.0, 3.12e-6)),
        *((1e8, 20.0, 111.9e-6), (1e9, 20.0, 42.5e-6), (1e10, 20.0, 16.2e-6), (1e11, 20.0, 5.78e-6)),
        *((1e8, 50.0, 164.0e-6), (1e9, 50.0, 62.4e-6), (1e10, 50.0, 21.9e-6), (1e11, 50.0, 8.07e-6)),
    ],
)
def test_the_overlap_is_the_measured_one(modulus, load, measured):
    """Measured with 24 facets; see the module."""
    assert expected_overlap(modulus=modulus, peg_radius=0.01, load=load) == pytest.approx(measured, rel=0.2)


def test_the_overlap_of_a_body_of_another_size_is_similar():
    one = expected_overlap(modulus=1e9, peg_radius=0.01, load=5.0)
    assert expected_overlap(modulus=1e9, peg_radius=0.02, load=20.0) == pytest.approx(2 * one)


@pytest.mark.parametrize("clearance", [1e-6, 5e-5, 1e-3])
@pytest.mark.parametrize("peg_radius", [1e-3, 0.01])
def test_the_softest_contact_overlaps_by_the_clearance(clearance, peg_radius):
    modulus = softest_modulus(clearance=clearance, peg_radius=peg_radius)
    assert expected_overlap(modulus=modulus, peg_radius=peg_radius) == pytest.approx(clearance)
    assert Scenario().controller.guard.soft_force == STATED_LOAD


def test_a_contact_through_which_the_bodies_pass_is_refused():
    softest = softest_modulus(clearance=5e-5, peg_radius=0.01)
    assert softest == pytest.approx(2.9e8, rel=0.02)
    scenario = Scenario()
    scenario.contact.modulus = 1.01 * softest
    validate_scenario(scenario)
    scenario.contact.modulus = 0.99 * softest
    with pytest.raises(ValueError, match=r"contact.modulus is .* Pa \(an overlap of 50.2 um under 10 N\), expected at"):
        validate_scenario(scenario)
    with pytest.raises(
        ValueError, match=r"mine: contact.modulus is 0.001 Pa .*at least 2.9e\+08 Pa.*clearance of 50 um"
    ):
        parse_scenario("contact: {modulus: 1e-3}", "mine")
    parse_scenario("contact: {modulus: 1e8}\ngeometry: {hole_radius: 0.0102}", "a wider hole needs less")
