import re
from dataclasses import replace

import numpy as np
import pytest
from pydrake.math import RigidTransform

from interfaces.live.display import (
    CONTACT,
    FEED,
    HIGH,
    LOW,
    NO_HAND,
    SATURATED,
    VIEWS,
    ContactLoad,
    LiveDisplay,
    load_colour,
)
from interfaces.live.page import PANEL
from models.scenario import LIVE_STREAM, load_scenario, resolve_scenario
from skill.features.measurement import MEASURED
from skill.policy.policy_observer import Judgement
from skill.policy.rig_policy import Action
from systems.math.rotation import from_rotation_vector
from systems.operators.person_frame import R_HV, hand_pose

START = np.array([0.01, 0.02, 0.03])


class Recorder:
    """Replaces the page, its scene and its controls, and keeps what is set last."""

    def __init__(self):
        self.objects, self.transforms, self.properties = {}, {}, {}
        self.clicks, self.keys, self.values = set(), {}, {}
        self.scene = self.controls = self

    def SetObject(self, path, *thing):
        self.objects[path] = thing

    def SetTransform(self, path, X):
        self.transforms[path] = X

    def SetProperty(self, path, name, value):
        self.properties[path, name] = value

    def SetCameraPose(self, camera_in_world, target_in_world):
        self.camera, self.target = np.array(camera_in_world), np.array(target_in_world)

    def AddButton(self, label, key):
        self.keys[label] = key

    def clicked(self, label):
        return bool(self.clicks & {label})

    def show(self, **values):
        self.values |= values

    def arrow(self, path):
        """Start and end of an `Arrow`, (3,) each, m, as the viewer places its shaft and the point of its head."""
        X, shaft = self.transforms[path], np.array(self.properties[f"{path}/shaft", "scale"])
        head, scale = (np.array(self.properties[f"{path}/head", name]) for name in ("position", "scale"))
        point = head + scale * self.transforms[f"{path}/head/cone"].translation()  # the origin of Meshcat's cone
        rod = self.transforms[f"{path}/shaft/rod"].translation()
        length = self.objects[f"{path}/shaft/rod"][0].length()
        ends = [shaft * (rod + np.array([0, 0, sign * length / 2])) for sign in (-1, 1)]
        np.testing.assert_allclose(ends, [[0, 0, 0], [0, 0, head[2]]], atol=1e-12)  # the head is on the shaft
        return X.translation(), X @ point


@pytest.fixture
def browser():
    return Recorder()


@pytest.fixture
def display(browser):
    return LiveDisplay(browser)


def test_colour_changes_at_half_the_limit_of_the_device_and_at_the_limit():
    colours = [load_colour(load) for load in (0.0, 0.5, 0.51, 0.99, 1.0, 3.0)]
    assert colours == [LOW, LOW, HIGH, HIGH, SATURATED, SATURATED]


def test_the_colours_are_green_orange_red_and_the_blue_of_the_panel():
    shade = lambda c: [round(255 * v) for v in (c.r(), c.g(), c.b())]  # noqa: E731
    assert [shade(c) for c in (LOW, HIGH, SATURATED)] == [[26, 140, 51], [237, 158, 13], [217, 13, 20]]
    for name, colour in (("contact", CONTACT), ("skill", FEED)):
        stated = re.search(rf"\.{name} \{{ color: (.*?);", (PANEL / "panel.css").read_text())[1]
        assert stated == "#{:02x}{:02x}{:02x}".format(*shade(colour))


def test_the_arrows_have_the_scales_that_the_panel_states(browser, display):
    hand, contact = (float(n) for n in re.findall(r"([\d.]+) N/cm", (PANEL / "panel.html").read_text()))
    point = np.array([0.0, 0.001, 0.0])
    display.draw_forces(START, np.array([0.0, 0.0, 2 * hand]), load=0.6, contact=(point, np.array([contact, 0.0, 0.0])))
    for name, start, arrow in (("rendered_force", START, [0, 0, 0.02]), ("contact_force", point, [0.01, 0, 0])):
        np.testing.assert_allclose(browser.arrow(f"live/{name}"), [start, start + np.array(arrow)], atol=1e-9)
    assert browser.properties["live/rendered_force/shaft/rod", "color"][0] == pytest.approx(HIGH.r() ** 2.2)
    display.draw_forces(START, np.zeros(3), load=0.0, contact=None)
    start, end = browser.arrow("live/contact_force")
    np.testing.assert_allclose([start, end], [START, START], atol=2e-6)


def test_the_ghost_of_the_hand_lies_just_inside_the_peg_at_the_start(browser, display):
    scenario = resolve_scenario(load_scenario("live"), seed=1, stream=LIVE_STREAM)
    display.draw_start(scenario)
    ghost = browser.objects["live/hand/ghost"][0]
    radius, length = scenario.geometry.peg_radius, scenario.geometry.peg_length
    assert (ghost.radius(), ghost.length()) == pytest.approx((0.98 * radius, 0.98 * length))
    assert browser.transforms["live/hand/ghost"].translation()[2] == 0.5 * length  # its centre is the hand's
    assert browser.transforms["live/hand"].IsExactlyEqualTo(browser.transforms["plant/peg"])
    np.testing.assert_allclose(
        browser.arrow("live/contact_force"), [browser.transforms["plant/peg"].translation()] * 2, atol=2e-6
    )


PINS = [[-0.0095, 0.0, 0.004, 0.0, 0.0], [0.0095, 0.0, 0.004, 0.0, 0.0]]


@pytest.mark.parametrize(
    ("shape", "corner"),  # least x, y and z of the peg, mm
    [({"section": "square"}, (-10.0, -10.0, 0.0)), ({"mates": PINS}, (-13.5, -4.0, 0.0))],
)
def test_a_part_is_drawn_with_its_outline_and_the_block_cut_open(browser, display, shape, corner):
    scenario = load_scenario("device")
    scenario.contact.engine = "exact"
    for name, value in shape.items():
        setattr(scenario.geometry, name, value)
    display.draw_start(resolve_scenario(scenario, seed=1, stream=LIVE_STREAM))

    def corners(path):
        text = browser.objects[path][0].source().in_memory().mesh_file.contents().decode()
        return np.array([[float(x) for x in row.split()[1:4]] for row in text.splitlines() if row.startswith("v ")])

    peg = corners("plant/peg/peg/peg::peg_picture")
    np.testing.assert_allclose(corners("live/hand/ghost"), 0.98 * peg, atol=1e-9)
    np.testing.assert_allclose(1e3 * peg.min(axis=0), corner, atol=1e-3)
    block = corners("plant/hole/block/hole::block_picture")
    assert block[:, 2].max() == 0.0 > block[:, 2].min()


def test_the_readings_are_in_si_units_and_the_tilt_in_degrees_as_the_person_sees_it(browser, display):
    X_HP = hand_pose(np.array([0.01, np.radians(2.0), np.radians(-1.0), 0.0, 0.0]))
    wrench = np.array([1.0, 2.0, 2.0, 3.0, 4.0, 12.0])
    probe = replace(NO_HAND, wrench=wrench, load=1.5, energy=0.5, min_energy=-0.1, late=3, ticks=4)
    display.show_readings(X_HP, depth=0.01, full_depth=0.02, rate=0.9, kept=7, probe=probe, late_steps=1, steps=2)
    values = browser.values
    assert (values["moment"], values["force"]) == pytest.approx((3.0, 13.0))
    assert values["tilt"] == {"right": pytest.approx(2.0, abs=1e-3), "away": pytest.approx(-1.0, abs=1e-3)}
    assert values["colour"] == "rgb(217, 13, 20)"  # 255 times (0.85, 0.05, 0.08)
    assert values["depth"] == {"tip": 0.01, "full": 0.02}
    assert values["deadlines"] == {"late_steps": 1, "steps": 2, "late_ticks": 3, "ticks": 4}
    assert [values[k] for k in ("load", "rate", "energy", "min_energy", "kept")] == [1.5, 0.9, 0.5, -0.1, 7]


def view(browser):
    """Distance of the camera from its target, m, and its elevation and direction to the right, degrees."""
    x, y, z = R_HV.inverse() @ (browser.camera - browser.target)
    distance = float(np.linalg.norm([x, y, z]))
    return distance, np.degrees(np.arcsin(z / distance)), np.degrees(np.arctan2(x, -y))


@pytest.mark.parametrize(
    ("name", "elevation", "azimuth"),
    [("of the cut", 26.0, 0.0), ("from above", 89.5, 0.0), ("from the side", 4.0, 45.0)],
)
def test_each_view_has_a_key_and_looks_from_its_side(browser, display, name, elevation, azimuth):
    """Azimuth is zero where the person is, positive to the right."""
    number, label = next((k, label) for k, label in enumerate(VIEWS, 1) if name in label)
    assert f"({number})" in label
    assert browser.keys[label] == f"Digit{number}"
    assert view(browser)[1] == pytest.approx(26.0, abs=0.5)  # the view of the cut comes first
    browser.camera = None
    display.follow_view_buttons()
    assert browser.camera is None
    browser.clicks.add(label)
    display.follow_view_buttons()
    distance, *angles = view(browser)
    assert 0.07 < distance < 0.13
    np.testing.assert_allclose(angles, [elevation, azimuth], atol=0.5)
    np.testing.assert_allclose(browser.target, [0.0, 0.0, 0.004])  # in the middle of the picture: 4 mm above the mouth
    browser.camera = None
    display.reset_camera()
    np.testing.assert_allclose(view(browser)[1:], [elevation, azimuth], atol=0.5)  # the view chosen last


def test_what_the_skill_would_do_is_an_arrow_along_the_axis_and_a_line_in_the_dial(browser, display):
    """In 20 ms it feeds 0.2 mm and turns by 1 mrad: 10 mm/s, and 50 mrad/s."""
    X_HP = RigidTransform(from_rotation_vector(np.array([0.03, 0.0, 0.0])), START)
    axis = np.array([0.0, -np.sin(0.03), np.cos(0.03)])
    judgement = Judgement(1, True, Action(np.array([1e-3, 0.0]), -2e-4))
    display.show_judgement(judgement, names=["free", "chamfer"], X_HP=X_HP, period=0.02)
    _, end = browser.arrow("live/skill_feed")
    np.testing.assert_allclose(end, START + (0.022 - 0.010) * axis, atol=1e-9)
    shown = browser.values["skill"]
    assert (shown["state"], shown["colour"], shown["known"]) == ("chamfer", "#E69F00", True)
    assert shown["feed"] == pytest.approx(-0.01)
    assert shown["turn"] == pytest.approx(0.05)
    for name, angle in (("tilt", 0.03), ("turned", 0.03 + 0.5 * 0.05)):
        seen = np.degrees(R_HV.inverse() @ np.array([0.0, -np.sin(angle), np.cos(angle)]))
        assert [shown[name]["right"], shown[name]["away"]] == pytest.approx(seen[:2])
    display.draw_start(resolve_scenario(load_scenario("live"), seed=0, stream=LIVE_STREAM))
    assert browser.values["skill"] is None
    np.testing.assert_allclose(np.diff(browser.arrow("live/skill_feed"), axis=0), 0.0, atol=2e-6)


def test_on_the_rig_the_arrow_of_the_skill_follows_the_turned_block_and_the_dial_does_not(browser, display):
    X_HP, X_WH = RigidTransform([0.0, 0.0, -0.004]), hand_pose(np.array([0.0, 0.05, 0.0, 0.0, 0.0]))
    judgement = Judgement(0, True, Action(turn=np.zeros(2), feed=-1e-4))
    display.show_judgement(judgement, names=["free"], X_HP=X_HP, X_WH=X_WH, period=0.02)
    start, end = browser.arrow("live/skill_feed")
    np.testing.assert_allclose((end - start) / np.linalg.norm(end - start), -X_WH.rotation().col(2), atol=1e-6)
    assert browser.values["skill"]["tilt"] == {"right": 0.0, "away": 0.0}


SAMPLE = dict.fromkeys(MEASURED[:6], 0.0)


def test_the_load_is_force_and_moment_over_the_radius_of_the_peg():
    """A peg of 10 mm: 3 N across, 4 N along and 0.12 N m are 13 N."""
    dut = ContactLoad(load_scenario("live"))
    assert dut.values() == {"load": 0.0, "limit": 40.0, "peak": 0.0, "held": False}
    dut.take(SAMPLE | {"fx": 3.0, "fz": 4.0, "my": 0.12})
    assert dut.load == pytest.approx(13.0)
    dut.take(SAMPLE | {"fy": -2.0})
    assert (dut.load, dut.peak) == pytest.approx((2.0, 13.0))


def test_the_guard_slows_the_feed_above_its_soft_force_and_a_sample_of_a_run_that_has_diverged_is_ignored():
    dut = ContactLoad(load_scenario("live"))
    for load, held in ((9.9, False), (10.1, True), (np.nan, True)):
        dut.take(SAMPLE | {"fx": load})
        assert dut.values()["held"] is held
    assert (dut.load, dut.peak) == (10.1, 10.1)
