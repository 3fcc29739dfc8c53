import base64
import io
import json

import numpy as np
import pytest
from PIL import Image
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from models.scenario import Geometry
from skill.states.state_style import state_colours
from systems.visualization.scene import CAMERA, TARGET, recorded
from systems.visualization.state_display import StateDisplay, name_plate, plate_pose
from tests.browser import open_page

NAMES = ["free", "two-point contact"]
HOME = 0.08


def record(path):
    """Records state 0 for half a second, then state 1 as long, while the carriage descends by 10 mm."""
    builder = DiagramBuilder()
    state = builder.AddSystem(
        TrajectorySource(PiecewisePolynomial.ZeroOrderHold(np.array([0.0, 0.5, 1.0]), np.array([[0.0, 1.0, 1.0]])))
    )
    carriage = PiecewisePolynomial.FirstOrderHold(np.array([0.0, 1.0]), HOME + np.array([[0.0, -0.01], [0.0, 0.0]]))
    source = builder.AddSystem(TrajectorySource(carriage))
    with recorded(path) as meshcat:
        dut = builder.AddSystem(
            StateDisplay(
                meshcat=meshcat,
                names=NAMES,
                geometry=Geometry(),
                home=HOME,
                period=1 / 32,
                X_WL=plate_pose(CAMERA, TARGET),
            )
        )
        builder.Connect(state.get_output_port(), dut.GetInputPort("state"))
        builder.Connect(source.get_output_port(), dut.GetInputPort("carriage_state"))
        Simulator(builder.Build()).AdvanceTo(1.0)


@pytest.mark.slow
def test_recording_shows_the_colour_and_the_name_of_the_present_state(tmp_path):
    record(tmp_path / "page.html")
    with open_page(tmp_path / "page.html", size=(900, 700)) as page:
        page.wait("document.querySelector('canvas') !== null && viewer.animator.duration > 0.9")
        for time, state in ((0.25, 0), (0.75, 1)):
            page.run(f"viewer.animator.pause(); viewer.animator.seek({time}); viewer.animator.display_progress({time})")
            visible = page.run(
                "return ['peg', 'name'].map(kind => [0, 1].map(k => viewer.scene_tree.find("
                "['drake', 'contact_state', kind, String(k)]).object.visible))"
            )
            assert visible == [[state == 0, state == 1]] * 2
            height = page.run("return viewer.scene_tree.find(['drake', 'contact_state', 'peg']).object.position.z")
            assert height == pytest.approx(-0.01 * time, abs=0.01 / 32 + 1e-6)
            colour = np.array([int(state_colours(2)[state][i : i + 2], 16) for i in (1, 3, 5)], dtype=float)
            picture = page.screenshot().astype(float)
            # Shading changes the brightness, but not the direction of the colour vector.
            brightness = np.linalg.norm(picture, axis=2) + 1e-9
            matches = (picture @ colour) / brightness / np.linalg.norm(colour) > 0.985
            other = np.array([int(state_colours(2)[1 - state][i : i + 2], 16) for i in (1, 3, 5)], dtype=float)
            matches_other = (picture @ other) / brightness / np.linalg.norm(other) > 0.985
            assert matches.mean() > 0.03
            assert matches_other.mean() < 0.003
        assert page.errors() == []
        assert page.requests() == []


def test_plates_face_the_camera():
    X_WL = plate_pose(np.array([3.0, 4.0, 0.0]), np.zeros(3))
    R = X_WL.rotation().matrix()
    np.testing.assert_allclose(R[:, 1], [-0.6, -0.8, 0.0])  # +y points away from the camera
    np.testing.assert_allclose(R[:, 2], [0.0, 0.0, 1.0], atol=1e-12)
    np.testing.assert_allclose(R[:, 0], [-0.8, 0.6, 0.0])


@pytest.mark.parametrize("name", ["a", "two-point contact / one point at the mouth"])
def test_plate_has_the_length_of_its_text_and_is_not_distorted(name):
    gltf = json.loads(name_plate(name, "#D55E00", 0.005).source().in_memory().mesh_file.contents())
    width, height = gltf["accessors"][0]["max"][0], -gltf["accessors"][0]["min"][1]
    picture = Image.open(io.BytesIO(base64.b64decode(gltf["images"][0]["uri"].split(",")[1])))
    assert height == pytest.approx(0.005)
    assert width / height == pytest.approx(picture.width / picture.height, rel=0.02)
    pixels = np.asarray(picture.convert("RGB")).reshape(-1, 3)
    assert ((np.abs(pixels - np.array([0xD5, 0x5E, 0x00])).max(axis=1) < 8).mean()) > 0.004  # the coloured square
    ink = (pixels.max(axis=1) < 90).reshape(picture.height, picture.width).any(axis=0)
    assert not ink[-1]
    assert not ink[0]
