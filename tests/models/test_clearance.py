"""Numerics and start that follow the clearance."""

import math

import numpy as np
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st

from experiments.trial.trial_result import TRUSTED_OVERLAP
from models.clearance import (
    FOLLOWERS,
    TRUSTED_PART,
    followed,
    following,
    modulus_of_clearance,
    numerics_of_clearance,
    start_of_clearance,
    step_of_clearance,
)
from models.contact_checks import expected_overlap
from models.meshes import MAX_FACETS, facet_sagitta, minimum_clearance
from models.scenario import (
    FIXTURES,
    FREE_FACETS,
    Geometry,
    Scenario,
    dump_scenario,
    load_scenario,
    parse_scenario,
    validate_scenario,
)
from models.validation import leaves
from systems.haptics.coupling_margins import require_margins

RADII = st.floats(1e-4, 0.015)
RATIOS = st.floats(math.log(1e-4), math.log(0.5)).map(math.exp)  # C / r


def scenario_of(ratio, *, radius=0.010, fixture="rig"):
    scenario = Scenario()
    scenario.geometry.peg_radius, scenario.geometry.hole_radius = radius, radius * (1.0 + ratio)
    scenario.fixture = fixture
    if fixture == "free":
        scenario.geometry.facets = MAX_FACETS
    return scenario


def numbers(scenario):
    return scenario.geometry.facets, scenario.contact.modulus, scenario.contact.time_step


def test_the_nominal_scenario_is_unchanged_also_by_rounding():
    for radius in (0.010, 0.0099999999999, 0.0100000000001):
        assert numbers(numerics_of_clearance(scenario_of(0.005, radius=radius))) == (32, 5.5e11, 2e-3)
    assert numerics_of_clearance(Scenario()) == Scenario() == start_of_clearance(Scenario())
    assert numbers(numerics_of_clearance(load_scenario())) == (32, 5.5e11, 2e-3)


@pytest.mark.parametrize(
    ("ratio", "expected"),
    [
        # an overlap of 20 um, a tenth of 40 N / (2e5 N/m): E = 40 N / r^2 (0.121 r / 20 um)^2.5
        *((ratio, (32, 1.14e10, 2e-3)) for ratio in (0.14, 0.038)),
        # 5.5e11 Pa (0.005/0.014)^2.5
        (0.014, (32, 4.19e10, 2e-3)),
        (0.005, (32, 5.5e11, 2e-3)),
        # 32 sqrt(2) = 45.3 facets, the next multiple of 4; twice the modulus; half the step
        (0.0025, (48, 1.1e12, 1e-3)),
        # 32 sqrt(5) = 71.6; 5 times the modulus; a fifth of the step
        (0.001, (72, 2.75e12, 4e-4)),
        # 32 sqrt(10) = 101.2; an overlap of C/4: E = 40 N / r^2 (4 * 0.121 / c)^2.5; a tenth of the step
        (0.0005, (104, 1.17e13, 2e-4)),
    ],
)
def test_the_numerics_of_the_rig_by_hand(ratio, expected):
    facets, modulus, step = numbers(numerics_of_clearance(scenario_of(ratio)))
    assert (facets, modulus) == expected[:2]
    assert step == pytest.approx(expected[2], rel=1e-12)


@pytest.mark.parametrize(
    ("ratio", "facets"),
    # A sagitta of a quarter of the clearance: n = pi / acos(1 - c/4), 62.9, 88.9 and 140.5 facets
    [(0.14, FREE_FACETS), (0.005, FREE_FACETS), (0.0025, 92), (0.001, 144)],
)
def test_a_peg_that_may_rotate_has_facets_with_a_quarter_of_the_sagitta(ratio, facets):
    scenario = numerics_of_clearance(scenario_of(ratio, fixture="free"))
    g = scenario.geometry
    assert g.facets == facets
    assert facet_sagitta(g.hole_radius, g.facets) <= 0.25 * g.clearance


def overlap_over_clearance(clearance, *, radius=0.01, load=40.0):
    modulus = modulus_of_clearance(clearance=clearance, peg_radius=radius, load=load)
    return expected_overlap(modulus=modulus, peg_radius=radius, load=load) / clearance


def test_the_overlap_under_the_force_limit_is_a_part_of_the_clearance():
    nominal = expected_overlap(modulus=5.5e11, peg_radius=0.01, load=40.0) / 50e-6
    assert nominal == pytest.approx(0.0848, rel=1e-3)
    for clearance in (50e-6, 100e-6, 200e-6):
        assert overlap_over_clearance(clearance) == pytest.approx(nominal, rel=3e-3)
    assert overlap_over_clearance(100e-6, load=55.0) == pytest.approx(nominal, rel=3e-3)
    assert overlap_over_clearance(200e-6, radius=0.02) == pytest.approx(nominal, rel=3e-3)
    # E is proportional to 1/C: the part grows with C^-0.6
    assert overlap_over_clearance(25e-6) == pytest.approx(nominal * 2**0.6, rel=3e-3)
    assert overlap_over_clearance(5e-6) == pytest.approx(0.25, rel=3e-3)
    assert TRUSTED_PART == TRUSTED_OVERLAP


def test_the_overlap_is_at_most_a_tenth_of_the_deflection_of_the_mount():
    assert overlap_over_clearance(400e-6) * 400e-6 == pytest.approx(0.1 * 40.0 / 2e5, rel=3e-3)
    assert overlap_over_clearance(400e-6, load=60.0) * 400e-6 == pytest.approx(0.1 * 60.0 / 2e5, rel=3e-3)


def test_a_force_limit_below_the_nominal_one_does_not_count():
    scenario = scenario_of(0.014)
    scenario.controller.guard.force_limit = 80.0
    assert numerics_of_clearance(scenario).contact.modulus == pytest.approx(2 * 4.19e10, rel=3e-3)
    scenario.controller.guard.force_limit = 21.0
    assert numerics_of_clearance(scenario).contact.modulus == 4.19e10


@pytest.mark.parametrize(
    ("controller", "recorder", "step", "expected"),
    [
        (0.02, 0.02, 1e-3, 1e-3),
        (0.025, 0.01, 1e-3, 1e-3),  # 5 ms divide both; 1 ms is the longest common step up to the limit
        (0.003, 0.002, 1e-3, 1e-3),
        (0.0021, 0.0014, 7e-4, 7e-4),
        (7e-5, 19e-5, 1e-5, 1e-5),  # no other step divides both
        (0.0225, 0.015, 7.5e-4, 7.5e-3 / 8),
    ],
)
def test_the_step_divides_both_periods(controller, recorder, step, expected):
    scenario = scenario_of(0.0025)
    scenario.controller.period, scenario.recorder.period, scenario.contact.time_step = controller, recorder, step
    validate_scenario(scenario)
    chosen = numerics_of_clearance(scenario)
    validate_scenario(chosen)
    assert chosen.contact.time_step == pytest.approx(expected, rel=1e-12)


def test_the_step_is_not_below_the_limit_of_a_scenario():
    assert step_of_clearance(25e-6) == pytest.approx(1e-3, rel=1e-12)
    assert step_of_clearance(1e-9) == 1e-5


@given(radius=RADII, ratio=RATIOS, fixture=st.sampled_from(FIXTURES), divisor=st.integers(1, 40))
@example(radius=0.01, ratio=1.0001 * minimum_clearance(0.01) / 0.01, fixture="free", divisor=10)
def test_every_valid_scenario_gets_valid_numerics(radius, ratio, fixture, divisor):
    scenario = scenario_of(ratio, radius=radius, fixture=fixture)
    scenario.contact.modulus = 1e300
    scenario.sensor.force_quantum = scenario.sensor.torque_quantum = 1e-6
    scenario.controller.period, scenario.recorder.period = 0.02, 0.03
    scenario.contact.time_step = 0.01 / divisor
    validate_scenario(scenario)
    before = dump_scenario(scenario)
    chosen = start_of_clearance(numerics_of_clearance(scenario))
    validate_scenario(chosen)
    assert dump_scenario(scenario) == before
    facets, modulus, step = numbers(chosen)
    assert facets >= 32
    assert facets % 4 == 0
    overlap = expected_overlap(modulus=modulus, peg_radius=radius, load=40.0)
    assert overlap < min(0.2506 * chosen.geometry.clearance, 20.1e-6)
    assert step <= 2e-3 * (1 + 1e-9)
    assert numerics_of_clearance(chosen) == chosen


# start


@pytest.mark.parametrize(
    ("ratio", "trial", "demonstrated"),
    # arccos(1/1.0025) / arccos(1/1.005) = 4.0472 / 5.7177 deg = 0.70784
    [(0.14, 3.4, 4.0), (0.014, 3.4, 4.0), (0.0025, 3.4 * 0.70784, 4.0 * 0.70784)],
)
def test_the_start_keeps_its_part_of_the_largest_tilt_that_enters(ratio, trial, demonstrated):
    start = start_of_clearance(scenario_of(ratio)).start
    assert np.degrees(start.tilt_range) == pytest.approx(trial, rel=1e-5)
    assert np.degrees(start.demonstrated_tilt_range) == pytest.approx(demonstrated, rel=1e-5)


def test_smaller_ranges_and_given_tilts_stay():
    scenario = load_scenario("tight")
    scenario.start.tilt = [0.01, -0.02]
    assert start_of_clearance(scenario) == scenario


# what follows the geometry of a file


def own_peg(radius, ratio, depth, rest="", engine=None):
    """The scenario of a file that states radius (m), C/r and depth/r."""
    sizes = f"peg_radius: {radius}, hole_radius: {radius * (1.0 + ratio):.9g}, hole_depth: {radius * depth:.9g}"
    return parse_scenario(f"geometry: {{{sizes}}}\n{rest}", "mine", engine=engine)


def test_a_file_gets_the_numerics_of_its_clearance_key_by_key(tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text("geometry: {peg_radius: 0.004, hole_radius: 0.00404, hole_depth: 0.02}")
    scenario = load_scenario(path)
    assert (
        numbers(scenario) == numbers(numerics_of_clearance(scenario_of(0.01, radius=0.004))) == (32, 6.08e11, 0.02 / 13)
    )
    path.write_text(path.read_text() + "\ncontact: {time_step: 0.001}")
    assert numbers(load_scenario(path)) == (32, 6.08e11, 1e-3)


def test_the_exact_engine_keeps_the_nominal_step():
    assert own_peg(0.003, 0.002, 5.0).contact.time_step == pytest.approx(0.02 / 84)
    assert own_peg(0.003, 0.002, 5.0, engine="exact").contact.time_step == 2e-3
    assert own_peg(0.003, 0.002, 5.0, "contact: {engine: exact, time_step: 0.001}").contact.time_step == 1e-3


def test_other_periods_at_a_large_clearance_must_still_be_multiples_of_the_nominal_step():
    with pytest.raises(ValueError, match=r"controller.period is 0.025 s, expected a multiple of contact.time_step"):
        own_peg(0.01, 0.02, 2.5, "controller: {period: 0.025}")


@pytest.mark.parametrize("engine", [None, "exact"])
def test_what_states_the_nominal_sizes_is_nominal(engine):
    scenario = own_peg(0.01, 0.005, 2.5, engine=engine)
    scenario.contact.engine = "drake"
    assert scenario == Scenario()
    assert followed(scenario) == ""


@pytest.mark.parametrize(
    ("sizes", "expected"),
    [
        # Small and shallow: stock of the nominal size; only what is proportional to the radius shrinks.
        # The guide's damping about the tip is added: 2 * 0.72 + 600 * 0.0045^2 over 2 * 2.4 + 600 * 0.028^2.
        (
            (0.003, 0.005, 0.5),
            {
                "stepper.holding_torque": 0.15,
                "stepper.damping": 0.225,
                "coupling.angular_stiffness": 90.0,
                "coupling.angular_damping": 0.72,
                "coupling.torque_scale": 0.02 / 0.3,
                "coupling.peg_inertia": 2e-2 * 1.45215 / 5.2704,
                "operator.insertion_speed": 0.02 * 0.3**2 * 5.2704 / 1.45215,
            },
        ),
        # As deep as nominal, three times as wide: the wall of 19.95 mm stays.
        (
            (0.03, 0.005, 2.5 / 3),
            {
                "geometry.block_radius": 0.03 + 0.0201,
                "start.height": 0.009,
                "recorder.time_limit": 8.0 * 34 / 28,
                "trial.time_limit": 10.0 * 34 / 28,
                "stepper.holding_torque": 1.5,
                "stepper.damping": 2.25,
                "coupling.angular_stiffness": 900.0,
                "coupling.angular_damping": 7.2,
                "coupling.torque_scale": 0.02 / 3.0,
                "coupling.peg_inertia": 2e-2 * 14.8704 / 5.2704,
                # 1.332 kg of steel where 0.148 kg were: 11.6 N more at 25.1 N/A; the rotor adds 1.579 kg.
                "feed.current_limit": 1.0 + 11.613 / 25.101,
                "feed.speed_kp": 0.05 * 2.911 / 1.727,
                "feed.speed_ki": 2.0 * 2.911 / 1.727,
                # A peg with 300 um of play over 25 mm may be tilted by 12 mrad: 0.36 mm, and 0.1 mm.
                "trial.full_depth_margin": 0.46e-3,
            },
        ),
        # Twice as deep: 2 * 2.4 + 600 * 0.053^2 over 2 * 2.4 + 600 * 0.028^2.
        (
            (0.01, 0.005, 5.0),
            {
                "geometry.peg_length": 0.085,
                "sensor.height": 0.105,
                "recorder.time_limit": 8.0 * 53 / 28,
                "trial.time_limit": 10.0 * 53 / 28,
                "coupling.peg_inertia": 2e-2 * 6.4854 / 5.2704,
                "feed.current_limit": 1.0 + 0.605 / 25.101,  # 62 g more
                "feed.speed_kp": 0.05 * 1.789 / 1.727,
                "feed.speed_ki": 2.0 * 1.789 / 1.727,
                "operator.insertion_speed": 0.02 * 5.2704 / 6.4854,
            },
        ),
        # So loose that not the play, but the tilt of the start bounds how the peg rests: 10 mm * sin(sqrt(2) * 4 deg).
        ((0.01, 0.2, 2.5), {"geometry.block_radius": 0.03195, "trial.full_depth_margin": 1.0857e-3}),
    ],
)
def test_sizes_that_a_file_does_not_state_follow_by_hand(sizes, expected):
    found, nominal = ({path: v for path, v, _ in leaves(s)} for s in (own_peg(*sizes), Scenario()))
    numerics = {"geometry.facets", "contact.modulus", "contact.time_step"}
    for path in set(FOLLOWERS) - numerics:
        assert found[path] == pytest.approx(expected.get(path, nominal[path]), rel=2e-3), path
    stated = {"geometry.peg_radius", "geometry.hole_radius", "geometry.hole_depth"}
    assert {path for path in found if found[path] != nominal[path]} <= {*expected, *numerics, *stated}


@given(
    radius=st.floats(0.003, 0.03),
    ratio=st.floats(math.log(0.002), math.log(0.2)).map(math.exp),
    depth=st.floats(0.5, 5.0),
    shape=st.sampled_from(["", "section: square, ", "section: hexagon, ", "section: rectangle, "]),
    engine=st.sampled_from(["drake", "exact"]),
)
@example(radius=0.03, ratio=0.2, depth=3.0, shape="section: rectangle, ", engine="exact")
@example(radius=0.018, ratio=0.002, depth=5.0, shape="", engine="drake")
def test_every_geometry_of_the_range_is_a_valid_and_stable_scenario(radius, ratio, depth, shape, engine):
    assume(radius * depth + 0.009 < 0.1)  # what the haptic device reaches
    sizes = f"peg_radius: {radius}, hole_radius: {radius * (1.0 + ratio)}, hole_depth: {radius * depth}"
    scenario = parse_scenario(f"geometry: {{{shape}{sizes}}}", "mine", engine=engine)
    assert following(scenario) == scenario
    assert all(margin.factor > 1.2 for margin in require_margins(scenario) if margin.required)
    # What runs is stored with every key, and read again as it was.
    assert parse_scenario(dump_scenario(scenario), "record") == scenario


def test_what_follows_is_said_in_one_line():
    line = followed(own_peg(0.004, 0.01, 2.5, "stepper: {damping: 0.5}"))
    assert line.startswith("contact.modulus 6.08e+11, contact.time_step 0.00154, stepper.holding_torque 0.2, ")
    assert "stepper.damping" not in line


@pytest.mark.parametrize(("radius", "ratio", "depth"), [(0.03, 0.002, 5.0), (0.025, 0.2, 3.9)])
def test_a_hole_deeper_than_the_device_reaches_is_refused_with_a_remedy_that_works(radius, ratio, depth):
    with pytest.raises(ValueError, match=r"mine: geometry\.hole_depth is .* moves from .* mm above .*start\.depth"):
        own_peg(radius, ratio, depth)
    own_peg(radius, ratio, depth, "start: {depth: 0.06}")


@pytest.mark.parametrize(
    ("text", "engine", "facets", "step", "modulus"),
    [
        ("geometry: {section: square}", "exact", Geometry.facets, 0.002, 1e11),
        ("fixture: free", "exact", FREE_FACETS, 0.002, 1e11),
        ("contact: {time_step: 0.004}", "exact", Geometry.facets, 0.004, 1e11),
        ("geometry: {hole_radius: 0.010025}", "drake", 48, 0.001, 1.1e12),
    ],
)
def test_a_file_takes_the_defaults_for_what_neither_it_nor_its_geometry_states(
    tmp_path, text, engine, facets, step, modulus
):
    path = tmp_path / "mine.yaml"
    path.write_text(text)
    device = load_scenario("device")
    found = load_scenario(path, engine, defaults=device)
    assert found.recorder.time_limit == device.recorder.time_limit != Scenario().recorder.time_limit
    assert (found.geometry.facets, found.contact.time_step, found.contact.modulus) == (facets, step, modulus)
    assert device == load_scenario("device")  # the defaults are not changed
