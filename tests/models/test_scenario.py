import copy
import math
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
import yaml

from models.meshes import minimum_clearance, minimum_facets
from models.operator import HABITS, OperatorParameters
from models.scenario import (
    DEMONSTRATION_STREAM,
    SCENARIO_FOLDER,
    TRIAL_STREAM,
    Scenario,
    dump_scenario,
    load_scenario,
    parse_scenario,
    resolve_scenario,
    validate_scenario,
)
from models.validation import copied, leaves

FILES = sorted(SCENARIO_FOLDER.glob("*.yaml"))


def values(scenario):
    """The values of a scenario by their dotted names."""
    return {path: value for path, value, _ in leaves(scenario)}


def flat(mapping, path=""):
    """Yields (dotted name, value) of every value of a nested mapping."""
    for key, value in mapping.items():
        if isinstance(value, dict):
            yield from flat(value, f"{path}{key}.")
        else:
            yield f"{path}{key}", value


def test_a_copy_is_equal_and_shares_nothing_that_changes():
    for path in FILES:
        scenario = load_scenario(path)
        before, found = copy.deepcopy(scenario), copied(scenario)
        assert found == before
        found.geometry.facets, found.controller.guard.force_limit = 7, 1.0
        found.geometry.corners.append([0.0])
        found.sensor.force_range[0] = 3.0
        assert scenario == before


# files


@pytest.mark.parametrize("path", FILES, ids=lambda p: p.stem)
def test_every_value_of_a_file_is_loaded(path):
    written = dict(flat(yaml.safe_load(path.read_text())))
    loaded = values(load_scenario(path.stem))
    assert written == {name: loaded[name] for name in written}


@pytest.mark.parametrize("path", FILES, ids=lambda p: p.stem)
@pytest.mark.parametrize("stream", [DEMONSTRATION_STREAM, TRIAL_STREAM])
def test_a_resolved_scenario_survives_dump_and_parse(path, stream):
    resolved = resolve_scenario(load_scenario(path), seed=3, stream=stream)
    assert values(parse_scenario(dump_scenario(resolved), "record")) == values(resolved)


def test_one_of_everything_has_every_key_with_a_value_other_than_the_default():
    written = dict(flat(yaml.safe_load((SCENARIO_FOLDER / "one_of_everything.yaml").read_text())))
    defaults = values(Scenario())
    assert sorted(written) == sorted(defaults)
    assert [name for name in written if written[name] == defaults[name]] == []


def test_the_stiffness_of_the_stepper_is_that_of_a_sine_with_a_period_of_four_steps():
    # T = T_h sin(2 pi theta/(4 step)) has the slope (pi/2) T_h/step at 0.
    p = Scenario().stepper
    torque = [p.holding_torque * math.sin(math.pi / 2 * angle / p.step_angle) for angle in (-1e-7, 1e-7)]
    assert p.stiffness == pytest.approx((torque[1] - torque[0]) / 2e-7, rel=1e-6)


# invalid input

INVALID = {
    "an unknown key": ("contact: {fricton: 0.2}", "fricton"),
    "a string for a number": ("contact: {friction: much}", "friction"),
    "invalid YAML": ("contact: {friction: 0.2", "mine.yaml"),
    "torque of a device without": (
        "device: inverse3",
        "coupling.torque_scale is 0.02, expected 0: the device 'inverse3'",
    ),
    "NaN": ("contact: {friction: .nan}", "contact.friction is nan"),
    "a hole narrower than the peg": ("geometry: {hole_radius: 0.0099}", "clearance .* is -0.1 mm"),
    "a negative radius": ("geometry: {peg_radius: -0.01}", "geometry.peg_radius is -0.01"),
    "a chamfer deeper than the hole": ("geometry: {chamfer: 0.03}", "geometry.chamfer is 0.03"),
    "an unknown section": ("geometry: {section: oval}", "geometry.section is oval, expected another shape: .*one of"),
    "a section without place for a chamfer": (
        "geometry: {section: key, chamfer: 0.002}",
        "geometry.section is key, .*a concave arc of the radius 0.00145 is too small",
    ),
    "a square that is wider than the block": (
        "geometry: {section: square, block_radius: 0.0144}",
        "geometry.block_radius is 0.0144 m, expected > 0.01448",
    ),
    "a peg shorter than the hole": ("geometry: {peg_length: 0.02}", "geometry.peg_length is 0.02"),
    "a block narrower than the hole": ("geometry: {block_radius: 0.0102}", "geometry.block_radius is 0.0102"),
    "a zero time step": ("contact: {time_step: 0.0}", "contact.time_step is 0.0"),
    "an unknown device": ("device: joystick", "device is 'joystick'"),
    "an unknown habit": ("operator: {habit: lazy}", "operator.habit is 'lazy'"),
    "a tilt at which the peg cannot enter": (
        "start: {tilt: [0.0, 0.11]}",
        "start.tilt about y is 6.3 deg.*below 5.72 deg",
    ),
    "a controller period that is no multiple of the time step": (
        "controller: {period: 0.0105}",
        "controller.period is 0.0105 s.*multiple",
    ),
    "a tilt about one axis only": ("start: {tilt: [0.01]}", "start.tilt"),
    "an unknown contact model": ("contact: {approximation: rigid}", "contact.approximation"),
    "a start inside the hole": ("start: {height: -0.001}", "start.height"),
    "a round part with a clocking stage": (
        "rig: {clocking_stage: true}",
        "rig.clocking_stage is true, .*a round part has no angle about its axis",
    ),
    "a sensor too coarse for the force guard": (
        "sensor: {force_quantum: 2.0}",
        "16.13 N of load, expected at most 10 N of load",
    ),
    "a sensor delay that is no multiple of its period": (
        "sensor: {delay: 0.0015}",
        "sensor.delay is 0.0015 s.*multiple of sensor.period",
    ),
    "a friction that may become negative": ("contact: {friction_spread: 1.1}", "contact.friction_spread is 1.1"),
    "a correction longer than its period": (
        "operator: {correction_time: 0.4, correction_period: 0.3}",
        "operator.correction_time is 0.4 s.*at most operator.correction_period 0.3 s",
    ),
    "a soft force above the hold force": (
        "controller: {guard: {soft_force: 25.0}}",
        "controller.guard.hold_force is 20.0 N, expected above soft_force 25.0 N",
    ),
    "a hold force above the force limit": (
        "controller: {guard: {force_limit: 15.0}}",
        "controller.guard.hold_force is 20.0 N.*below force_limit 15.0 N",
    ),
    "a margin of most of the hole": (
        "trial: {full_depth_margin: 0.013}",
        "trial.full_depth_margin is 0.013 m, expected at most half of geometry.hole_depth 0.025 m",
    ),
    "an element beyond all limits": ("sensor: {force_range: [1, 1, 1e13]}", "sensor.force_range is 10000000000000.0, "),
    "a seed of more than 63 bits": (
        "seed: 9223372036854775808",
        "seed is 9223372036854775808, expected a whole number",
    ),
    "a clearance of one rounding step": (
        "geometry: {hole_radius: 0.010000000000000002}",
        "clearance .* is 1.735e-15 mm, expected at least 0.000753 mm, which 512 facets can resolve",
    ),
    "a torque quantum above a tenth of the smallest range": (
        "sensor: {torque_quantum: 0.2, torque_range: [5.0, 1.9, 5.0]}",
        "sensor.torque_quantum is 0.2 N m, expected at most a tenth of sensor.torque_range, 0.19 N m",
    ),
    "a delay of many periods": (
        "sensor: {delay: 1.001}",
        "sensor.delay is 1.001 s, expected at most 1000 times sensor.period 0.001 s",
    ),
    "an encoder so coarse that a moving feed seems to be still": (
        "rig: {encoder_resolution: 0.00051}",
        "rig.encoder_resolution is 0.00051 m, expected at most half of controller.drive_monitor.stall_distance 0.001 m",
    ),
    "a depth of a stall that a moving feed does not reach": (
        "controller: {drive_monitor: {stall_depth: 0.002}}",
        "drive_monitor.stall_depth is 0.002 m, expected at most half of .*stall_distance 0.001 m",
    ),
}


@pytest.mark.parametrize(("text", "message"), INVALID.values(), ids=INVALID)
def test_an_invalid_file_raises_an_error_that_names_the_file_and_the_problem(tmp_path, text, message):
    path = tmp_path / "mine.yaml"
    path.write_text(text)
    with pytest.raises(ValueError, match=message) as caught:
        load_scenario(path)
    assert str(path) in str(caught.value)


LARGEST = """
seed: 9223372036854775807
geometry: {facets: 512}
contact: {time_step: 0.00001}
sensor: {force_quantum: 1.2, delay: 1.0}
rig: {encoder_resolution: 0.0005}
trial: {time_limit: 3600}
"""


def test_values_at_their_limits_are_valid():
    scenario = parse_scenario(LARGEST, "largest")
    assert (scenario.geometry.facets, scenario.sensor.delay) == (512, 1.0)
    scenario.geometry.peg_radius = scenario.geometry.hole_radius - 1.001 * minimum_clearance(0.01005)
    scenario.contact.modulus = 1e14
    validate_scenario(scenario)
    assert minimum_facets(0.01005, scenario.geometry.clearance) == 512


def test_the_error_for_an_unknown_scenario_lists_the_known_ones():
    with pytest.raises(ValueError, match=r"nothing_like_it.*nominal"):
        load_scenario("nothing_like_it")
    with pytest.raises(ValueError, match=r"nowhere.yaml: no such file"):
        load_scenario(Path("nowhere.yaml"))


def test_a_scenario_file_may_have_any_suffix(tmp_path):
    (tmp_path / "mine.yml").write_text("geometry: {peg_radius: 0.009, hole_radius: 0.00905}\n")
    assert load_scenario(tmp_path / "mine.yml").geometry.peg_radius == 0.009


@pytest.mark.parametrize(("fixture", "minimum"), [("free", 63), ("rig", 23), ("axial", 23)])
def test_the_minimum_number_of_facets_is_that_of_the_fixture(fixture, minimum):
    scenario = Scenario(fixture=fixture)
    scenario.geometry.facets = minimum
    validate_scenario(scenario)
    scenario.geometry.facets = minimum - 1
    with pytest.raises(ValueError, match=r"geometry\.facets"):
        validate_scenario(scenario)


def test_a_file_with_the_free_fixture_has_enough_facets_by_default():
    assert parse_scenario("fixture: free", "a").geometry.facets == 64
    assert parse_scenario("{fixture: free, geometry: {facets: 128}}", "a").geometry.facets == 128
    assert parse_scenario("fixture: axial", "a").geometry.facets == Scenario().geometry.facets


@pytest.mark.parametrize(("axis", "sign"), [(0, -1.0), (1, 1.0)])
def test_the_maximum_tilt_is_the_largest_at_which_the_tip_enters_the_hole(axis, sign):
    scenario = Scenario()
    largest = math.acos(scenario.geometry.peg_radius / scenario.geometry.hole_radius)
    scenario.start.tilt = [0.0, 0.0]
    scenario.start.tilt[axis] = sign * 0.999 * largest
    validate_scenario(scenario)
    scenario.start.tilt[axis] = sign * 1.001 * largest
    with pytest.raises(ValueError, match="start.tilt about " + "xy"[axis]):
        validate_scenario(scenario)


# resolution


@pytest.fixture
def ranges():
    scenario = Scenario()
    scenario.start.offset_range = 0.002
    return scenario


def test_resolving_depends_on_scenario_seed_and_stream_only(ranges):
    before = values(ranges)
    first = resolve_scenario(ranges, seed=5, stream=TRIAL_STREAM)
    again = resolve_scenario(copy.deepcopy(ranges), seed=5, stream=TRIAL_STREAM)
    assert values(first) == values(again)
    assert values(ranges) == before
    other = resolve_scenario(ranges, seed=6, stream=TRIAL_STREAM)
    assert other.start.tilt != first.start.tilt
    assert other.operator.align_gain != first.operator.align_gain


def test_two_streams_share_no_seed_and_no_draw(ranges):
    drawn = {
        stream: [resolve_scenario(ranges, seed=n, stream=stream) for n in range(300)]
        for stream in (DEMONSTRATION_STREAM, TRIAL_STREAM)
    }
    resolved = drawn[DEMONSTRATION_STREAM] + drawn[TRIAL_STREAM]
    assert len({s.seed for s in resolved}) == 600
    assert len({v for s in resolved for v in s.start.tilt}) == 1200


def test_the_angle_about_the_axis_is_drawn_for_a_clocking_stage_only_and_changes_no_other_draw(ranges):
    ranges.geometry.section = "square"
    with_stage = copy.deepcopy(ranges)
    with_stage.rig.clocking_stage = True
    found = {}
    for n in range(50):
        without, with_one = (resolve_scenario(s, seed=n, stream=TRIAL_STREAM) for s in (ranges, with_stage))
        found[n] = with_one.start.clocking
        with_one.start.clocking, with_one.rig.clocking_stage = 0.0, False
        assert values(with_one) == values(without)
    assert len(set(found.values())) == 50
    assert 0.9 * ranges.start.clocking_range < max(map(abs, found.values())) <= ranges.start.clocking_range


@pytest.mark.parametrize("key", ["start: {clocking: NUMBER}", "geometry: {corners: [[NUMBER, 0, 0]]}"])
def test_a_whole_number_beyond_all_numbers_is_named(key):
    with pytest.raises(ValueError, match=r"here: .* is .*00.*, expected a (list of lists of )?number"):
        parse_scenario(key.replace("NUMBER", "1" + 400 * "0"), "here")


@pytest.mark.slow
def test_starts_are_uniform_within_their_ranges_and_personal_factors_lognormal(ranges):
    n = 400
    start = ranges.start
    for name, largest, stream in (
        ("tilt", start.tilt_range, TRIAL_STREAM),
        ("tilt", start.demonstrated_tilt_range, DEMONSTRATION_STREAM),
        ("offset", start.offset_range, TRIAL_STREAM),
    ):
        resolved = [resolve_scenario(ranges, seed=k, stream=stream) for k in range(n)]
        drawn = [v for s in resolved for v in getattr(s.start, name)]
        # The mean of 2n uniform numbers on [-a, a] has the standard deviation a/sqrt(6 n); the bound is 5 of them.
        assert abs(np.mean(drawn)) < 5 * largest / math.sqrt(6 * n)
        assert 0.9 * largest < np.abs(drawn).max() <= largest  # P(all within 0.9 a) = 0.9^(2n)
    logs = np.log([s.operator.align_gain / ranges.operator.align_gain for s in resolved])
    spread = ranges.operator.personal_spread
    assert abs(logs.mean()) < 5 * spread / math.sqrt(n)
    assert logs.std() == pytest.approx(spread, rel=5 / math.sqrt(2 * n))


@pytest.mark.parametrize("habit", sorted(HABITS))
def test_a_habit_multiplies_the_parameters_that_it_names(habit):
    scenario = Scenario()
    scenario.operator.personal_spread = 0.0
    scenario.operator.habit = habit
    resolved = resolve_scenario(scenario, seed=1, stream=DEMONSTRATION_STREAM).operator
    drawn = {"habit", "sight_bias", "clocking_bias", "offset_bias", "tremor_frequency", "tremor_spread"}
    for f in fields(OperatorParameters):
        if f.name not in drawn:
            factor = HABITS[habit].get(f.name, 1.0)
            assert getattr(resolved, f.name) == pytest.approx(getattr(scenario.operator, f.name) * factor), f.name


def test_given_values_are_not_drawn():
    scenario = Scenario()
    scenario.start.tilt, scenario.start.offset = [0.01, -0.02], [1e-4, 2e-4]
    scenario.operator.sight_bias = [0.001, 0.002]
    resolved = resolve_scenario(scenario, seed=9, stream=TRIAL_STREAM)
    assert resolved.start.tilt == [0.01, -0.02]
    assert resolved.start.offset == [1e-4, 2e-4]
    assert resolved.operator.sight_bias == [0.001, 0.002]


def test_the_error_for_a_drawn_tilt_that_is_too_large_names_the_seed():
    scenario = Scenario()
    scenario.start.tilt_range = scenario.start.demonstrated_tilt_range = math.radians(60.0)
    with pytest.raises(ValueError, match=r"seed 4.*start\.tilt"):
        resolve_scenario(scenario, seed=4, stream=TRIAL_STREAM)
