import copy
import math
from dataclasses import fields, is_dataclass
from pathlib import Path

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from models.bore import minimum_facets
from models.hardware import DEVICE_PRESETS
from models.scenario import (
    DEMONSTRATION_STREAM,
    FIXTURES,
    HABITS,
    SCENARIO_FOLDER,
    TRIAL_STREAM,
    OperatorParameters,
    Scenario,
    dump_scenario,
    load_scenario,
    parse_scenario,
    resolve_scenario,
    validate_scenario,
)

FILES = sorted(SCENARIO_FOLDER.glob("*.yaml"))


def leaves(node, path=""):
    """(dotted name, value) of every value of the tree that is not itself a dataclass."""
    for f in fields(node):
        value = getattr(node, f.name)
        if is_dataclass(value):
            yield from leaves(value, f"{path}{f.name}.")
        else:
            yield f"{path}{f.name}", value


def flat(mapping, path=""):
    for key, value in mapping.items():
        if isinstance(value, dict):
            yield from flat(value, f"{path}{key}.")
        else:
            yield f"{path}{key}", value


def written(tmp_path, text):
    path = tmp_path / "mine.yaml"
    path.write_text(text)
    return path


# ------------------------------------------------------------------- files


def test_the_named_scenarios_are_there():
    assert {"nominal", "tight", "one_of_everything"} <= {p.stem for p in FILES}


@pytest.mark.parametrize("path", FILES, ids=lambda p: p.stem)
def test_every_scenario_loads_by_name_and_by_path(path):
    assert dict(leaves(load_scenario(path.stem))) == dict(leaves(load_scenario(path)))


@pytest.mark.parametrize("path", FILES, ids=lambda p: p.stem)
def test_what_a_file_says_is_what_is_loaded(path):
    said = dict(flat(yaml.safe_load(path.read_text())))
    loaded = dict(leaves(load_scenario(path)))
    assert said == {name: loaded[name] for name in said}


@pytest.mark.parametrize("path", FILES, ids=lambda p: p.stem)
@pytest.mark.parametrize("stream", [DEMONSTRATION_STREAM, TRIAL_STREAM])
def test_every_scenario_resolves_to_one_that_its_own_record_gives_back(path, stream):
    resolved = resolve_scenario(load_scenario(path), seed=3, stream=stream)
    assert dict(leaves(parse_scenario(dump_scenario(resolved), "record"))) == dict(leaves(resolved))


def test_one_of_everything_names_every_key_with_another_value_than_the_default():
    said = dict(flat(yaml.safe_load((SCENARIO_FOLDER / "one_of_everything.yaml").read_text())))
    defaults = dict(leaves(Scenario()))
    assert sorted(said) == sorted(defaults)
    assert [name for name in said if said[name] == defaults[name]] == []


def test_the_defaults_are_a_valid_scenario():
    validate_scenario(Scenario())


def test_the_stepper_is_a_magnetic_spring_of_four_steps_a_turn():
    # T = T_h sin(2 pi theta/(4 step)) has the slope (pi/2) T_h/step at 0.
    p = Scenario().stepper
    torque = [p.holding_torque * math.sin(math.pi / 2 * angle / p.step_angle) for angle in (-1e-7, 1e-7)]
    assert p.stiffness == pytest.approx((torque[1] - torque[0]) / 2e-7, rel=1e-6)


@given(
    text=st.fixed_dictionaries(
        {
            "seed": st.integers(0, 2**31 - 1),
            "friction": st.floats(0.0, 1.0),
            "tilt": st.none() | st.lists(st.floats(-0.05, 0.05), min_size=2, max_size=2),
            "habit": st.sampled_from(sorted(HABITS)),
            "fixture": st.sampled_from(FIXTURES),
            "device": st.sampled_from(sorted(DEVICE_PRESETS)),
        }
    )
)
@settings(max_examples=30, deadline=None)
def test_dump_and_parse_give_the_same_numbers_to_the_last_bit(text):
    scenario = Scenario(seed=text["seed"], fixture=text["fixture"], device=text["device"])
    scenario.contact.friction = text["friction"]
    scenario.start.tilt = text["tilt"]
    scenario.operator.habit = text["habit"]
    assert dict(leaves(parse_scenario(dump_scenario(scenario), "text"))) == dict(leaves(scenario))


# --------------------------------------------------------------- bad input

BAD_TEXT = {
    "an unknown key": ("contact: {fricton: 0.2}", "fricton"),
    "an unknown part": ("geometri: {peg_radius: 0.01}", "geometri"),
    "a word for a number": ("contact: {friction: much}", "friction"),
    "a number for a part": ("contact: 3", "contact"),
    "a list for a number": ("contact: {friction: [0.1, 0.2]}", "friction"),
    "no YAML at all": ("contact: {friction: 0.2", "mine.yaml"),
    "not a number": ("contact: {friction: .nan}", "contact.friction is nan"),
    "infinity": ("geometry: {peg_length: .inf}", "geometry.peg_length is inf"),
    "not a number in a list": ("start: {tilt: [0.01, .nan]}", "start.tilt is nan"),
    "a hole narrower than the peg": ("geometry: {hole_radius: 0.0099}", "clearance .* is -0.1 mm"),
    "no clearance": ("geometry: {hole_radius: 0.010}", "clearance .* is 0 mm"),
    "a negative radius": ("geometry: {peg_radius: -0.01}", "geometry.peg_radius is -0.01"),
    "too few facets": ("geometry: {facets: 32}", "geometry.facets is 32 .* at least 63"),
    "negative facets": ("geometry: {facets: -64}", "geometry.facets is -64"),
    "a chamfer through the block": ("geometry: {chamfer: 0.03}", "geometry.chamfer is 0.03"),
    "a peg shorter than the hole": ("geometry: {peg_length: 0.02}", "geometry.peg_length is 0.02"),
    "a thin block": ("geometry: {block_radius: 0.0102}", "geometry.block_radius is 0.0102"),
    "no floor": ("geometry: {floor: 0.0}", "geometry.floor is 0.0"),
    "a time that stands still": ("contact: {time_step: 0.0}", "contact.time_step is 0.0"),
    "negative friction": ("contact: {friction: -0.1}", "contact.friction is -0.1"),
    "no stiffness": ("contact: {modulus: 0.0}", "contact.modulus is 0.0"),
    "an unknown device": ("device: joystick", "device is 'joystick'"),
    "an unknown fixture": ("fixture: loose", "fixture is 'loose'"),
    "an unknown habit": ("operator: {habit: lazy}", "operator.habit is 'lazy'"),
    "a tilt that cannot enter": ("start: {tilt: [0.0, 0.11]}", "start.tilt about y is 6.3 deg.*below 5.72 deg"),
    "a period between steps": ("recorder: {period: 0.0205}", "recorder.period is 0.0205 s.*multiple"),
    "a control period between steps": ("controller: {period: 0.0105}", "controller.period is 0.0105 s.*multiple"),
    "no period": ("recorder: {period: 0.0}", "recorder.period is 0.0"),
}


@pytest.mark.parametrize(("text", "said"), BAD_TEXT.values(), ids=BAD_TEXT)
def test_a_bad_file_is_one_error_that_names_the_file_and_the_fault(tmp_path, text, said):
    path = written(tmp_path, text)
    with pytest.raises(ValueError, match=said) as caught:
        load_scenario(path)
    assert str(path) in str(caught.value)


BAD_SIZES = {
    "a tilt about one axis only": ("start: {tilt: [0.01]}", "start.tilt"),
    "an offset along three axes": ("start: {offset: [0.0, 0.0, 0.0]}", "start.offset"),
    "a bias about one axis only": ("operator: {sight_bias: [0.01]}", "operator.sight_bias"),
    "a force range of two": ("sensor: {force_range: [100.0, 100.0]}", "sensor.force_range"),
    "noise of four": ("sensor: {torque_noise: [0.0, 0.0, 0.0, 0.0]}", "sensor.torque_noise"),
}


@pytest.mark.parametrize(("text", "said"), BAD_SIZES.values(), ids=BAD_SIZES)
def test_a_list_of_the_wrong_length_is_refused(tmp_path, text, said):
    with pytest.raises(ValueError, match=said):
        load_scenario(written(tmp_path, text))


BAD_RANGES = {
    "an unknown contact model": ("contact: {approximation: rigid}", "contact.approximation"),
    "a negative seed": ("seed: -1", "seed"),
    "a negative tilt range": ("start: {tilt_range: -0.01}", "start.tilt_range"),
    "a negative offset range": ("start: {offset_range: -0.01}", "start.offset_range"),
    "a peg that starts inside": ("start: {height: -0.001}", "start.height"),
    "no virtual mass": ("coupling: {peg_mass: 0.0}", "coupling.peg_mass"),
    "no virtual inertia": ("coupling: {peg_inertia: 0.0}", "coupling.peg_inertia"),
    "a hand that never decides": ("operator: {decision_period: 0.0}", "operator.decision_period"),
    "a hand without strength": ("operator: {comfortable_force: 0.0}", "operator.comfortable_force"),
    "no time to demonstrate": ("recorder: {time_limit: 0.0}", "recorder.time_limit"),
    "no time to insert": ("trial: {time_limit: -1.0}", "trial.time_limit"),
    "a margin deeper than the hole": ("trial: {full_depth_margin: 0.03}", "trial.full_depth_margin"),
    "no step": ("stepper: {step_angle: 0.0}", "stepper.step_angle"),
    "no resistance": ("feed: {resistance: 0.0}", "feed.resistance"),
    "no inductance": ("feed: {inductance: 0.0}", "feed.inductance"),
    "no lead": ("feed: {screw_lead: 0.0}", "feed.screw_lead"),
    "a sensor without quantum": ("sensor: {force_quantum: 0.0}", "sensor.force_quantum"),
    "a delay between samples": ("sensor: {delay: 0.0015}", "sensor.delay is 0.0015 s.*multiple of sensor.period"),
    "a sensor without period": ("sensor: {period: 0.0}", "sensor.period"),
    "negative noise": ("sensor: {force_noise: [-0.1, 0.1, 0.1]}", "sensor.force_noise"),
    "an encoder without resolution": ("rig: {encoder_resolution: 0.0}", "rig.encoder_resolution"),
    "a negative force limit": ("controller: {force_limit: -1.0}", "controller.force_limit"),
}


@pytest.mark.parametrize(("text", "said"), BAD_RANGES.values(), ids=BAD_RANGES)
def test_a_number_that_no_part_can_have_is_refused(tmp_path, text, said):
    path = written(tmp_path, text)
    with pytest.raises(ValueError, match=said) as caught:
        load_scenario(path)
    assert str(path) in str(caught.value)


def test_a_scenario_that_does_not_exist_names_those_that_do():
    with pytest.raises(ValueError, match=r"nothing_like_it.*nominal"):
        load_scenario("nothing_like_it")
    with pytest.raises(ValueError, match=r"nowhere.yaml: no such file"):
        load_scenario(Path("nowhere.yaml"))


def test_text_that_is_read_back_is_validated_too():
    text = dump_scenario(Scenario()).replace("hole_radius: 0.01005", "hole_radius: 0.0099")
    with pytest.raises(ValueError, match="the record: geometry clearance"):
        parse_scenario(text, "the record")


def test_the_bound_on_facets_is_the_formula():
    scenario = Scenario()
    needed = minimum_facets(scenario.geometry.hole_radius, scenario.geometry.clearance)
    scenario.geometry.facets = needed
    validate_scenario(scenario)
    scenario.geometry.facets = needed - 1
    with pytest.raises(ValueError, match=r"geometry\.facets"):
        validate_scenario(scenario)


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_the_bound_on_the_tilt_is_where_the_ellipse_of_the_peg_fills_the_hole(axis, sign):
    scenario = Scenario()
    largest = math.acos(scenario.geometry.peg_radius / scenario.geometry.hole_radius)
    scenario.start.tilt = [0.0, 0.0]
    scenario.start.tilt[axis] = sign * 0.999 * largest
    validate_scenario(scenario)
    scenario.start.tilt[axis] = sign * 1.001 * largest
    with pytest.raises(ValueError, match="start.tilt about " + "xy"[axis]):
        validate_scenario(scenario)


# -------------------------------------------------------------- resolution


@pytest.fixture
def ranges():
    scenario = Scenario()
    scenario.start.offset_range = 0.002
    return scenario


def test_resolving_is_a_function_of_scenario_seed_and_stream(ranges):
    before = dict(leaves(ranges))
    first = resolve_scenario(ranges, seed=5, stream=TRIAL_STREAM)
    again = resolve_scenario(copy.deepcopy(ranges), seed=5, stream=TRIAL_STREAM)
    assert dict(leaves(first)) == dict(leaves(again))
    assert dict(leaves(ranges)) == before
    other = resolve_scenario(ranges, seed=6, stream=TRIAL_STREAM)
    assert other.start.tilt != first.start.tilt
    assert other.operator.align_gain != first.operator.align_gain


def test_the_two_streams_share_no_seed_and_no_draw(ranges):
    drawn = {
        stream: [resolve_scenario(ranges, seed=n, stream=stream) for n in range(300)]
        for stream in (DEMONSTRATION_STREAM, TRIAL_STREAM)
    }
    shown, tried = drawn[DEMONSTRATION_STREAM], drawn[TRIAL_STREAM]
    assert len({s.seed for s in shown + tried}) == 600
    assert len({v for s in shown + tried for v in s.start.tilt}) == 1200


def test_starts_are_uniform_within_their_ranges(ranges):
    n = 400
    start = ranges.start
    for name, largest, stream in (
        ("tilt", start.tilt_range, TRIAL_STREAM),
        ("tilt", start.demonstrated_tilt_range, DEMONSTRATION_STREAM),
        ("offset", start.offset_range, TRIAL_STREAM),
    ):
        resolved = [resolve_scenario(ranges, seed=k, stream=stream) for k in range(n)]
        values = [v for s in resolved for v in getattr(s.start, name)]
        assert all(abs(v) <= largest for v in values)
        # The mean of 2n uniform numbers on [-a, a] has sigma a/sqrt(6 n); 5 sigma.
        assert abs(sum(values)) / len(values) < 5 * largest / math.sqrt(6 * n)
        # P(all within 0.9 a) = 0.9^(2n)
        assert max(map(abs, values)) > 0.9 * largest


def test_personal_factors_are_lognormal_about_the_scenarios_person(ranges):
    n = 400
    gains = [resolve_scenario(ranges, seed=k, stream=DEMONSTRATION_STREAM).operator.align_gain for k in range(n)]
    logs = [math.log(g / ranges.operator.align_gain) for g in gains]
    spread = ranges.operator.personal_spread
    mean = sum(logs) / n
    assert abs(mean) < 5 * spread / math.sqrt(n)
    sigma = math.sqrt(sum((v - mean) ** 2 for v in logs) / (n - 1))
    assert abs(sigma / spread - 1) < 5 / math.sqrt(2 * n)


@pytest.mark.parametrize("habit", sorted(HABITS))
def test_a_habit_multiplies_what_it_names(habit):
    scenario = Scenario()
    scenario.operator.personal_spread = 0.0
    scenario.operator.habit = habit
    resolved = resolve_scenario(scenario, seed=1, stream=DEMONSTRATION_STREAM).operator
    drawn = {"habit", "sight_bias", "offset_bias", "tremor_frequency", "tremor_spread"}
    for f in fields(OperatorParameters):
        if f.name not in drawn:
            factor = HABITS[habit].get(f.name, 1.0)
            assert getattr(resolved, f.name) == pytest.approx(getattr(scenario.operator, f.name) * factor), f.name


def test_what_is_given_is_not_drawn():
    scenario = Scenario()
    scenario.start.tilt, scenario.start.offset = [0.01, -0.02], [1e-4, 2e-4]
    scenario.operator.sight_bias = [0.001, 0.002]
    resolved = resolve_scenario(scenario, seed=9, stream=TRIAL_STREAM)
    assert resolved.start.tilt == [0.01, -0.02]
    assert resolved.start.offset == [1e-4, 2e-4]
    assert resolved.operator.sight_bias == [0.001, 0.002]


def test_a_range_beyond_what_can_enter_says_which_seed_drew_it():
    scenario = Scenario()
    scenario.start.tilt_range = scenario.start.demonstrated_tilt_range = math.radians(60.0)
    with pytest.raises(ValueError, match=r"seed 4.*start\.tilt"):
        resolve_scenario(scenario, seed=4, stream=TRIAL_STREAM)
