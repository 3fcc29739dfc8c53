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
from tests.stepping import fixed_context

NAMES = ["free", "two-point contact"]
HOME = 0.08


class Recorder:
    """Replaces Meshcat, and keeps what is set last."""

    def __init__(self):
        self.objects, self.transforms, self.properties = {}, {}, {}

    def SetObject(self, path, *thing):
        self.objects[path] = thing

    def SetTransform(self, path, X, time=None):
        self.transforms[path] = (X, time)

    def SetProperty(self, path, name, value, time):
        assert name == "visible"
        self.properties[path] = (value, time)


def display(meshcat, names=("a", "b", "c")):
    X_WL = plate_pose(CAMERA, TARGET)
    geometry = Geometry(peg_radius=0.01, peg_length=0.02)
    return StateDisplay(meshcat=meshcat, names=names, geometry=geometry, home=HOME, period=1 / 32, X_WL=X_WL)


def test_each_state_has_a_peg_of_its_colour_that_just_hides_the_drawn_peg():
    meshcat = Recorder()
    display(meshcat)
    for k, colour in enumerate(state_colours(3)):
        peg, rgba = meshcat.objects[f"contact_state/peg/{k}"]
        assert 0.01 < peg.radius() < 0.0101
        assert 0.02 < peg.length() < 0.0202
        found = [round(255 * value) for value in (rgba.r(), rgba.g(), rgba.b())]
        assert "#{:02x}{:02x}{:02x}".format(*found) == colour.lower()
        assert rgba.a() == 1.0
        X, _ = meshcat.transforms[f"contact_state/peg/{k}"]
        np.testing.assert_allclose(X.GetAsMatrix34(), [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0.01]])  # the tip at zero
        assert f"contact_state/name/{k}" in meshcat.objects
    X, _ = meshcat.transforms["contact_state/name"]
    assert X.IsExactlyEqualTo(plate_pose(CAMERA, TARGET))


@pytest.mark.parametrize(("state", "shown"), [(0.0, 0), (1.0, 1), (1.9999999, 2)])
def test_only_the_present_state_is_visible_at_the_height_of_the_carriage(state, shown):
    meshcat = Recorder()
    dut = display(meshcat)
    context = fixed_context(dut, state=[state], carriage_state=[HOME - 0.007, 5.0])
    context.SetTime(1.5)
    dut._publish(context)
    X, time = meshcat.transforms["contact_state/peg"]
    np.testing.assert_allclose(X.GetAsMatrix34(), [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, -0.007]], atol=1e-12)
    assert time == 1.5
    assert len(meshcat.properties) == 6
    for kind in ("peg", "name"):
        assert [meshcat.properties[f"contact_state/{kind}/{k}"] for k in range(3)] == [
            (k == shown, 1.5) for k in range(3)
        ]


def test_the_state_is_published_from_the_start_in_every_period():
    meshcat = Recorder()
    dut = display(meshcat)
    context = fixed_context(dut, state=[0.0], carriage_state=[HOME, 0.0])
    times = []
    meshcat.SetTransform = lambda path, X, time: times.append(time)
    simulator = Simulator(dut, context)
    simulator.AdvanceTo(0.1)
    assert times == pytest.approx([0.0, 1 / 32, 2 / 32, 3 / 32])


def arrays(mesh):
    """Corners, texture points and triangles of a glTF mesh, read by its indices, and its picture."""
    gltf = json.loads(mesh.source().in_memory().mesh_file.contents())
    decode = lambda uri: base64.b64decode(uri.split(",")[1])  # noqa: E731
    kinds = {5126: np.dtype("<f4"), 5123: np.dtype("<u2")}  # float and unsigned short in the specification of glTF
    widths = {"SCALAR": 1, "VEC2": 2, "VEC3": 3}

    def read(number):
        accessor = gltf["accessors"][number]
        view = gltf["bufferViews"][accessor["bufferView"]]
        buffer = gltf["buffers"][view["buffer"]]
        data = decode(buffer["uri"])
        assert len(data) == buffer["byteLength"]
        part = data[view["byteOffset"] : view["byteOffset"] + view["byteLength"]]
        found = np.frombuffer(part, kinds[accessor["componentType"]]).reshape(-1, widths[accessor["type"]])
        assert len(found) == accessor["count"]
        if "min" in accessor:
            np.testing.assert_array_equal([accessor["min"], accessor["max"]], np.float32([found.min(0), found.max(0)]))
        return found

    (node,) = (gltf["nodes"][k] for k in gltf["scenes"][gltf["scene"]]["nodes"])
    (primitive,) = gltf["meshes"][node["mesh"]]["primitives"]
    material = gltf["materials"][primitive["material"]]
    texture = gltf["textures"][material["pbrMetallicRoughness"]["baseColorTexture"]["index"]]
    picture = Image.open(io.BytesIO(decode(gltf["images"][texture["source"]]["uri"]))).convert("RGB")
    attributes = primitive["attributes"]
    return read(attributes["POSITION"]), read(attributes["TEXCOORD_0"]), read(primitive["indices"])[:, 0], picture


def test_the_plate_is_a_rectangle_below_its_corner_that_carries_the_whole_picture():
    """In glTF y points upwards; a picture has its origin at its upper left, and (1, 1) at its lower right."""
    corners, points, triangles, picture = arrays(name_plate("a name", "#D55E00", 0.005))
    width = 0.005 * picture.width / picture.height
    expected = {(0, 1): [0, -0.005, 0], (1, 1): [width, -0.005, 0], (1, 0): [width, 0, 0], (0, 0): [0, 0, 0]}
    assert {tuple(point) for point in points} == set(expected)
    for corner, point in zip(corners, points, strict=True):
        np.testing.assert_allclose(corner, expected[tuple(point)], rtol=0.01, atol=1e-9)
    areas = [np.cross(*(corners[t[1:]] - corners[t[0]]))[2] / 2 for t in triangles.reshape(2, 3)]
    np.testing.assert_allclose(areas, width * 0.005 / 2, rtol=0.01)  # both face the viewer and together are the plate
    centres = corners[triangles].reshape(2, 3, 3).mean(axis=1)
    assert np.linalg.norm(centres[0] - centres[1]) > 0.3 * width  # they do not overlap


def test_the_picture_has_a_square_then_the_name_with_letters_of_the_given_height():
    """Letters of 44 pixels: the capital letters of the typeface are 0.73 as high; the picture is 1.7 times as high."""
    *_, picture = arrays(name_plate("HHHH", "#D55E00", 0.005))
    pixels = np.asarray(picture).astype(int)
    orange = np.abs(pixels - [0xD5, 0x5E, 0x00]).max(axis=2) < 60
    ink = pixels.max(axis=2) < 90
    assert picture.height in (74, 75)
    rows, columns = (np.flatnonzero(ink.any(axis=axis)) for axis in (1, 0))
    assert rows[-1] - rows[0] + 1 == pytest.approx(0.73 * 44, abs=2)
    assert (rows[0] + rows[-1]) / 2 == pytest.approx(picture.height / 2, abs=3)
    assert columns[0] == pytest.approx(1.6 * 44, abs=6)
    assert picture.width - columns[-1] == pytest.approx(0.6 * 44, abs=8)
    rows, columns = (np.flatnonzero(orange.any(axis=axis)) for axis in (1, 0))
    assert columns[0] == pytest.approx(0.5 * 44, abs=6)
    assert columns[-1] < 1.6 * 44
    assert (rows[0] + rows[-1]) / 2 == pytest.approx(picture.height / 2, abs=6)
    assert (pixels[0] == 255).all()  # white


def test_the_plates_of_the_display_are_5_5_mm_high_and_lower_left_of_the_target():
    """A quarter of the way from the target to the camera, 50 mm to the left and 28 mm down."""
    meshcat = Recorder()
    display(meshcat, names=("a",))
    corners, *_ = arrays(meshcat.objects["contact_state/name/0"][0])
    assert -corners[:, 1].min() == pytest.approx(0.0055)
    X_WL = plate_pose(np.array([1.0, -4.0, 2.0]), np.array([1.0, 0.0, 2.0]))  # looks along +y
    np.testing.assert_allclose(X_WL.translation(), [1.0 - 0.05, -1.0, 2.0 - 0.028], atol=1e-12)
    np.testing.assert_allclose(X_WL.rotation().matrix(), np.eye(3), atol=1e-12)


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


@pytest.mark.browser
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
