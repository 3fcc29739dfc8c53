"""The driver of the Inverse3, against a stand-in for the maker's service."""

import math
import threading

import numpy as np
import pytest

from experiments.demonstration_run import DemonstrationRun
from models.hardware import DEVICE_PRESETS
from models.scenario import LIVE_STREAM, load_scenario, resolve_scenario
from systems.math.rotation import rotation_vector
from systems.operators.device_operator import DeviceOperator, check_preset, default_scenario, find_device
from systems.operators.inverse3 import Inverse3
from systems.operators.person_frame import R_HV
from systems.servo.served_environment import MakeServedEnvironment
from systems.servo.servo_diagram import MakeServo
from systems.virtual_environment import start_pose
from tests.lockstep import lockstep
from tests.systems.operators.inverse_service import Service, served
from tests.waiting import until

RIGHT, AWAY, UP = np.eye(3)
PEAK = DEVICE_PRESETS["inverse3"].peak_force


@pytest.fixture
def service(monkeypatch):
    with served(Service(), monkeypatch) as service:
        yield service


@pytest.fixture
def device(service):
    device = find_device("inverse3")()
    yield device
    device.close()


def wrench(force, torque=(0.0, 0.0, 0.0)):
    """A wrench of a force and a torque as the person sees them."""
    return np.concatenate([R_HV @ np.asarray(torque), R_HV @ np.asarray(force)])


@pytest.mark.parametrize("direction", [RIGHT, AWAY, UP], ids=["right", "away", "up"])
def test_the_handle_moves_as_the_person_sees_it(service, direction):
    place = np.array([*(0.003 * direction), 0.0, 0.0, 0.0])
    service.path, service.step = lambda t: place * (t > 0.0), 0.02
    device = Inverse3()
    for _ in range(60):
        X = device.read_pose()
    found = R_HV.inverse() @ X.translation()
    assert 0.002 < np.linalg.norm(found) < 0.004
    np.testing.assert_allclose(found / np.linalg.norm(found), direction, atol=1e-9)
    assert X.rotation().IsNearlyIdentity(1e-12)
    device.close()
    assert service.sessions == [{"configure": {"profile": {"name": "haptic-skill"}, "basis": {"permutation": "XYZ"}}}]


@pytest.mark.parametrize("size", [2.0, PEAK, 1.5 * PEAK, 1e9])
@pytest.mark.parametrize("direction", [RIGHT, AWAY, UP, np.array([0.6, 0.0, -0.8])])
def test_the_force_has_the_directions_of_the_motion_up_to_its_peak_and_the_torque_is_lost(
    service, device, size, direction
):
    device.write_wrench(wrench(size * direction, torque=(0.1, 0.2, 0.3)))
    device.read_pose()
    np.testing.assert_allclose(service.forces[-1], min(size, PEAK) * direction, rtol=1e-9, atol=1e-12)


def test_a_force_that_is_no_number_is_not_sent(service, device):
    with pytest.raises(OSError, match="the rendered force is"):
        device.write_wrench(wrench([1.0, 0.0, math.nan]))
    device.close()
    assert np.isfinite(service.forces).all()


@pytest.mark.parametrize("kind", ["verse_grip", "wireless_verse_grip"])
@pytest.mark.parametrize("sign", [1.0, -1.0])  # both quaternions are the same turn
def test_a_grip_turns_the_peg(service, kind, sign):
    service.grips = {"61548": kind}
    start, half = np.array([0.8, 0.0, 0.6, 0.0]), 0.05
    service.turn = lambda t: start
    device = Inverse3()
    assert rotation_vector(device.read_pose().rotation()) == pytest.approx([0.0, 0.0, 0.0], abs=1e-9)
    c, s = math.cos(half), math.sin(half)  # 0.1 rad about the axis to the right, times the start
    w, x, y, z = start
    service.turn = lambda t: 1.001 * sign * np.array([c * w - s * x, c * x + s * w, c * y - s * z, c * z + s * y])
    found = R_HV.inverse() @ rotation_vector(device.read_pose().rotation())
    np.testing.assert_allclose(found, [0.1, 0.0, 0.0], atol=1e-9)
    device.close()


def test_a_grip_that_is_asleep_is_none(service):
    service.grips, service.awake, service.turn = {"7": "wireless_verse_grip"}, False, lambda t: (1.0, t, 0.0, 0.0)
    device = Inverse3()
    assert device.read_pose().rotation().IsNearlyIdentity(1e-12)
    device.close()


def test_the_force_is_zero_after_closing_and_closing_twice_does_no_harm(service, device):
    device.write_wrench(wrench(3.0 * UP))
    device.close()
    device.close()
    assert until(lambda: not service.clients)
    assert service.forces[-2:] == [pytest.approx(3.0 * UP), pytest.approx(np.zeros(3))]
    with pytest.raises(OSError, match="Haply Inverse Service at 127"):
        device.read_pose()


def test_each_tick_reads_the_newest_state_and_sends_the_force_that_belongs_to_it(service, device):
    """Two messages: an answer that waited for the next tick would be old."""
    service.path = lambda t: np.array([0.0, 0.0, t, 0.0, 0.0, 0.0])
    for k in range(5):
        X = device.read_pose()
        assert X.translation()[2] == pytest.approx(service.position()[2], abs=1e-15)
        device.write_wrench(wrench(0.1 * k * UP))
        assert until(lambda: service.forces[-1][2] == pytest.approx(0.1 * k))  # noqa: B023
    assert len(service.forces) == 11  # with the first reading


@pytest.mark.parametrize("version", ["3.5.0.0", "3.12.1.0"])
@pytest.mark.parametrize("wrapped", [False, True])
def test_a_version_of_the_protocol_is_understood(service, version, wrapped):
    answer = {"project_version": version}
    service.version = {"ok": True, "data": answer} if wrapped else answer
    Inverse3().close()


@pytest.mark.parametrize(
    ("answer", "message"),
    [
        ({"project_version": "3.4.8.0"}, "it has the version '3.4.8.0', expected 3.5 or later, below 4.0"),
        ({"project_version": "4.0.0.0"}, "it has the version '4.0.0.0', expected 3.5 or later, below 4.0"),
        ({"project_version": "new"}, "it does not tell its version"),
        ({}, "it does not tell its version"),
        ([], "it does not tell its version"),
    ],
)
def test_another_version_is_refused_before_a_force_is_sent(service, answer, message):
    service.version = answer
    with pytest.raises(OSError, match=message):
        Inverse3()
    assert service.forces == []


def test_no_service_is_an_error_with_its_address_and_a_remedy(monkeypatch):
    monkeypatch.setenv("INVERSE_SERVICE", "127.0.0.1:9")
    with pytest.raises(
        OSError, match=r"^Haply Inverse Service at 127.0.0.1:9: .*refused; is it running.*INVERSE_SERVICE="
    ):
        Inverse3()
    for wrong in ("", "localhost", "localhost:port", ":10001", "localhost:99999"):
        monkeypatch.setenv("INVERSE_SERVICE", wrong)
        with pytest.raises(OSError, match=f"INVERSE_SERVICE is '{wrong}', expected host:port, such as localhost:10001"):
            Inverse3()


def without(name):
    return lambda service: setattr(service, "status", {**service.status, name: False})


UNFIT = {
    "two devices": (lambda s: setattr(s, "devices", ["049D", "04BA"]), "it has 049D, 04BA, expected one Inverse3"),
    "no device": (lambda s: setattr(s, "devices", []), "it has none, expected one Inverse3"),
    "a smaller device": (lambda s: setattr(s, "type", "minverse"), "049D is 'minverse', expected one of"),
    "two grips": (
        lambda s: setattr(s, "grips", {"1": "verse_grip", "2": "wireless_verse_grip"}),
        "it has 1, 2, expected one VerseGrip",
    ),
    "no power": (without("power_supply"), "049D has not: power_supply; see"),
    "not ready": (without("ready"), "049D has not: ready; see"),
    "not calibrated": (without("calibrated"), "049D has not: calibrated; see"),
}


@pytest.mark.parametrize("case", UNFIT)
def test_a_device_that_is_not_fit_is_refused_and_gets_no_force(service, case):
    make, message = UNFIT[case]
    make(service)
    with pytest.raises(OSError, match=message):
        Inverse3()
    assert not np.any(service.forces)


def changed(part, value):
    """Changes a part of the state of the device."""

    def mangle(answer):
        answer["inverse3"][0]["state"][part] = value
        return answer

    return lambda service: setattr(service, "mangle", mangle)


LOST = {
    "the service hangs up": (lambda s: s.hang_up(), "it closed the connection|Broken pipe|reset"),
    "the service is silent": (lambda s: setattr(s, "mangle", lambda answer: None), "it did not answer in time"),
    "the device is gone": (lambda s: setattr(s, "mangle", lambda answer: {"inverse3": []}), "049D is disconnected"),
    "the grip falls asleep": (lambda s: setattr(s, "awake", False), "verse_grip 61548 is disconnected"),
    "the power fails": (without("power_supply"), "049D has not: power_supply"),
    "no JSON": (lambda s: setattr(s, "mangle", lambda answer: "{"), "it sent '{', expected the JSON protocol of"),
    "a list": (lambda s: setattr(s, "mangle", lambda answer: "[]"), "it sent \\[\\], expected the JSON protocol"),
    "the protocol 3.0": (
        lambda s: setattr(s, "mangle", lambda answer: {"inverse3": {"049D": answer}}),
        "expected the JSON protocol",
    ),
    "no position": (changed("cursor_position", None), "expected the JSON protocol"),
    "a text for a number": (changed("cursor_position", {"x": "0", "y": 0.0, "z": 0.0}), "expected the JSON protocol"),
    "NaN": (changed("cursor_position", {"x": math.nan, "y": 0.0, "z": 0.0}), "expected the JSON protocol"),
    "no orientation": (lambda s: setattr(s, "turn", lambda t: (0.0, 0.0, 0.0, 0.0)), "expected the JSON protocol"),
}


def tick_on(device):
    for _ in range(2000):
        device.read_pose()
        device.write_wrench(wrench(2.0 * UP))


@pytest.mark.parametrize("case", LOST)
def test_what_is_lost_is_one_line_and_ends_the_force(service, case):
    make, message = LOST[case]
    service.grips = {"61548": "wireless_verse_grip"}
    device = Inverse3()
    device.write_wrench(wrench(2.0 * UP))
    device.read_pose()
    make(service)
    with pytest.raises(OSError, match=f"^Haply Inverse Service at 127.*({message})") as raised:
        tick_on(device)
    assert "\n" not in str(raised.value)
    device.close()
    assert until(lambda: not service.clients)
    if case != "the service hangs up":
        assert not service.forces[-1].any()


def test_the_scenario_of_the_driver_has_its_preset_and_renders_no_torque():
    scenario = load_scenario(default_scenario("inverse3"))
    check_preset("inverse3", scenario)
    check_preset("loopback", scenario)
    with pytest.raises(
        ValueError, match=r"device is 'paper', expected 'inverse3' with --driver inverse3: use --scenario"
    ):
        check_preset("inverse3", load_scenario(default_scenario("mine")))


def test_a_device_that_is_closed_while_it_waits_says_so(service, device):
    """As the servo's watchdog does when the service is late."""
    service.mangle = lambda answer: None
    threading.Timer(0.1, device.close).start()
    with pytest.raises(OSError, match=r"127.*: it did not answer in time"):
        device.read_pose()
    assert until(lambda: not service.clients)
    assert not service.forces[-1].any()


# through the servo


def through_the_servo(service, seconds=0.6):
    """Lets the servo render to the service for some time."""
    scenario = resolve_scenario(load_scenario("inverse3"), seed=774, stream=LIVE_STREAM)
    X, device = start_pose(scenario), Inverse3()
    environment = MakeServedEnvironment(scenario)
    servo = MakeServo(scenario, operator=DeviceOperator(device=device, period=1e-3, X_HD_start=X), X_HP_start=X)
    servo.start(X)
    run = DemonstrationRun(scenario, environment)
    for probe in lockstep(servo, run, environment, time_step=scenario.contact.time_step):
        if probe.time > seconds:
            break
    device.close()


@pytest.mark.slow
@pytest.mark.parametrize(("frequency", "turns"), [(15.0, False), (5.0, True)])
def test_the_display_gives_the_hand_no_more_than_it_absorbs(service, frequency, turns):
    """The hand shakes the peg against the mouth; the service counts the energy, with its own delay of 1 ms."""
    shake = np.array([0.002, 0.002, 0.004, 0.0, 0.0, 0.0])
    service.path = lambda t: (
        np.array([0.0, 0.0, -0.012 * min(t / 0.3, 1.0), 0.0, 0.0, 0.0]) + shake * math.sin(2 * math.pi * frequency * t)
    )
    if turns:
        service.grips = {"1": "verse_grip"}
        service.turn = lambda t: (1.0, 0.01 * math.sin(2 * math.pi * frequency * t), 0.0, 0.0)
    through_the_servo(service)
    sizes = np.linalg.norm(service.forces, axis=1)
    assert 0.3 < sizes.max() <= PEAK
    assert service.generated < 1e-4
