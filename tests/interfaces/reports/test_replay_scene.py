"""What the drawing commands of a scene hold, decoded without a browser, for a motion of four samples."""

import base64
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import umsgpack
from scipy.spatial.transform import Rotation

from interfaces.reports.motion import Motion
from interfaces.reports.replay_scene import PageWindow, arrow_scale, draw_scene
from skill.data.geometry import PegHoleGeometry

MM = 1e-3
GEOMETRY = PegHoleGeometry(
    peg_radius=10 * MM,
    peg_length=12 * MM,
    hole_radius=11 * MM,
    hole_depth=25 * MM,
    chamfer=1 * MM,
    facets=8,
    block_radius=30 * MM,
    floor=10 * MM,
)
TIME = [0.0, 0.5, 1.25, 2.0]
# Half a turn about z, another half, then a third, stored with changing signs.
TURNS = Rotation.from_rotvec(np.array([[0, 0, 0], [0, 0, np.pi], [0, 0, 2 * np.pi], [0, 0, 8 * np.pi / 3]]))


def make_motion(**changes: Any) -> Motion:
    """The peg rises 1 mm per sample and turns about z; the block slides along y and turns about x."""
    steps = np.arange(4.0)
    motion = Motion(
        kind="demonstration",
        outcome="inserted",
        time=np.array(TIME),
        R_WP=TURNS,
        p_WP=np.outer(steps, [0, 0, 1 * MM]),
        R_WH=Rotation.from_rotvec(np.outer(steps, [0.1, 0, 0])),
        p_WH=np.outer(steps, [0, 2 * MM, 0]),
        force=np.array([[0, 0, 0], [3, 0, 4], [0, 0, -1], [0.6, 0.8, 6]], dtype=float),
        moment=np.array([[0, 0, 0], [0, 0.06, 0], [0.03, 0.04, 0], [0, 0, -0.005]], dtype=float),
        depth=-MM * steps,
        phase=np.array([1, 0, 0, 2]),
        phases=["a", "b", "c"],
        colours=["#102030", "#C0FF80", "#08519C"],
        colouring="contact state",
        guard=None,
        force_limit=None,
        steps=None,
        geometry=GEOMETRY,
    )
    return replace(motion, **changes)


class Decoded:
    """The commands of a window by kind."""

    def __init__(self, window: PageWindow) -> None:
        commands = [umsgpack.unpackb(base64.b64decode(text)) for text in window.commands]
        self.last = commands[-1]
        kinds = {kind: [c for c in commands if c["type"] == kind] for kind in {c["type"] for c in commands}}
        self.objects = {short(c["path"]): c["object"] for c in kinds["set_object"]}
        # Matrices arrive column by column.
        self.transforms = {short(c["path"]): np.reshape(c["matrix"], (4, 4)).T for c in kinds["set_transform"]}
        self.properties = {(short(c["path"]), c["property"]): c["value"] for c in kinds["set_property"]}
        [animation] = kinds["set_animation"]
        self.options, self.clips = animation["options"], {short(a["path"]): a["clip"] for a in animation["animations"]}

    def geometry(self, path: str) -> dict[str, Any]:
        return self.objects[path]["geometries"][0]

    def material(self, path: str) -> dict[str, Any]:
        return self.objects[path]["materials"][0]

    def points(self, path: str) -> np.ndarray:
        """Points (n, 3), m, of a line or a mesh."""
        stored = self.geometry(path)["data"]["attributes"]["position"]
        return np.frombuffer(stored["array"].data, dtype=np.float32).reshape(-1, stored["itemSize"])

    def track(self, path: str, name: str) -> tuple[list[float], np.ndarray]:
        """Times (s) and values of an animated property."""
        [track] = [t for t in self.clips[path]["tracks"] if t["name"] == f".{name}"]
        return [key["time"] for key in track["keys"]], np.array([key["value"] for key in track["keys"]])

    def values(self, path: str, name: str) -> np.ndarray:
        return self.track(path, name)[1]

    def interval(self, path: str) -> tuple[float, float]:
        """Lowest and highest z, m, of an upright cylinder; its axis is y in its own frame."""
        half = self.geometry(path)["height"] / 2
        ends = [(self.transforms[path] @ [0, y, 0, 1])[:3] for y in (-half, half)]
        np.testing.assert_allclose([end[:2] for end in ends], 0, atol=1e-12)
        return ends[0][2], ends[1][2]


def short(path: str) -> str:
    return path.removeprefix("/meshcat/")


def decoded(motion: Motion | None = None) -> Decoded:
    return Decoded(draw_scene(motion or make_motion()))


def in_mm(points: Iterable[Iterable[float]]) -> np.ndarray:
    return MM * np.array(list(points), dtype=float)


# ----------------------------------------------------------------------- camera


def test_camera_is_above_the_open_side_of_the_block_and_looks_at_the_mouth():
    """The viewer's camera stands in a frame with y upwards, so its (x, y, z) is (x, -z, y) of W."""
    scene = decoded()
    camera = "/Cameras/default/rotated/<object>"
    np.testing.assert_allclose(scene.transforms["/Cameras/default"][:3, 3], [0, 0, 0.004])
    np.testing.assert_allclose(scene.properties[camera, "position"], [0.124, 0.066, -0.110])
    assert scene.properties[camera, "fov"] == 42  # degrees: a 60 mm block 180 mm away spans 19 degrees
    assert (scene.properties[camera, "near"], scene.properties[camera, "far"]) == (0.001, 10)


# ------------------------------------------------------------------------ shapes


def test_block_is_cut_open_towards_the_camera():
    points = decoded().points("hole/body")
    assert np.linalg.norm(points[:, :2], axis=1).max() == pytest.approx(0.030)
    assert points[:, 2].min() == pytest.approx(-0.035)
    # Nothing of the block is on the camera's side of the cut, on which x + y > 0.
    assert (points[:, 0] + points[:, 1]).max() == pytest.approx(0, abs=1e-8)


def test_peg_is_a_prism_that_stands_on_its_tip_with_a_ring_every_5_mm():
    scene = decoded()
    body = scene.points("peg/body")
    assert np.linalg.norm(body[:, :2], axis=1).max() == pytest.approx(0.010)
    assert (body[:, 2].min(), body[:, 2].max()) == pytest.approx((0, 0.012))
    for k, z in enumerate([0, 0.005, 0.010]):
        points = scene.points(f"peg/mark0_{k}")
        np.testing.assert_allclose(points[:, 2], z, atol=1e-9)
        radius = np.linalg.norm(points[:, :2], axis=1)
        assert np.all((radius > 0.010 + 1e-6) & (radius < 0.010 + 1e-5))  # just outside, so that the peg hides none
        assert len(points) == 97  # closed
    assert "peg/mark0_3" not in scene.objects


def test_arrows_before_the_animation_are_a_shaft_of_1_m_and_heads_of_4_mm():
    """The moment has two heads, which share the length of one."""
    scene = decoded()
    for name, cones in (("force", [(0, 0.004)]), ("moment", [(0.002, 0.004), (0, 0.002)])):
        rod = scene.geometry(f"{name}/shaft/rod")
        assert rod["radiusTop"] == rod["radiusBottom"] == 0.0007
        assert scene.interval(f"{name}/shaft/rod") == pytest.approx((0, 1))
        for k, interval in enumerate(cones):
            cone = scene.geometry(f"{name}/head/cone{k}")
            assert scene.interval(f"{name}/head/cone{k}") == pytest.approx(interval, abs=1e-12)
            assert cone["radiusTop"] == 0
            assert cone["radiusBottom"] == pytest.approx(0.00182)
        assert f"{name}/head/cone{len(cones)}" not in scene.objects


# ------------------------------------------------------------------------ arrows


@pytest.mark.parametrize(
    ("force", "moment", "scale"),
    [
        (6.0, 0.06, (200, 2)),  # 30 mm each; at 1 N per cm the arrow would be 60 mm long
        (7.0, 0.07, (200, 2)),  # exactly 35 mm
        (7.1, 0.071, (500, 5)),
        (0.0, 0.0, (50, 0.5)),  # as for 1 N and 10 N mm, which would be 20 mm long
        (300.0, 0.02, (10000, 1)),
    ],
)
def test_scale_of_the_arrows_is_the_smallest_round_one_at_which_the_largest_is_35_mm(force, moment, scale):
    vectors = np.array([[0, 0, 0], [-0.6, 0, 0.8], [0, 0.1, 0], [0, 0, 0.2]])
    found = arrow_scale(make_motion(force=force * vectors, moment=moment * vectors))
    assert (found.force, found.moment) == pytest.approx(scale)


def drawn_arrows(scene: Decoded, name: str) -> np.ndarray:
    """Vectors (n, 3), m, from the start of an arrow to its tip, as the viewer would place it."""
    scale, shaft = scene.values(name, "scale"), scene.values(f"{name}/shaft", "scale")
    head = scene.values(f"{name}/head", "position")
    np.testing.assert_array_equal(scale, np.repeat(scale[:, :1], 3, axis=1))
    np.testing.assert_array_equal(shaft[:, :2], 1)  # the shaft keeps its thickness
    np.testing.assert_allclose(head[:, 2], shaft[:, 2])  # the head begins where the shaft ends
    tip = head + np.array([0, 0, 0.004])
    return Rotation.from_quat(scene.values(name, "quaternion")).apply(scale * tip)


def test_arrows_start_at_the_tip_and_show_force_and_moment_in_the_world():
    """The largest force, 6.1 N, is 30 mm long, the largest moment, 0.06 N m, 30 mm. Half turns about z negate x, y."""
    scene = decoded()
    third = Rotation.from_rotvec([0, 0, 2 * np.pi / 3]).apply
    expected = {
        "force": in_mm([[0, 0, 0], [-15, 0, 20], [0, 0, -5], third([3, 4, 30])]),
        "moment": in_mm([[0, 0, 0], [0, -30, 0], [15, 20, 0], [0, 0, -2.5]]),
    }
    for name, arrows in expected.items():
        # An arrow of length 0 is drawn with a size above 0, because the viewer cannot invert a scale of 0.
        np.testing.assert_allclose(drawn_arrows(scene, name)[1:], arrows[1:], atol=1e-9)
        assert 0 < np.linalg.norm(drawn_arrows(scene, name)[0]) < 1e-6
        np.testing.assert_allclose(scene.values(name, "position"), in_mm([[0, 0, k] for k in range(4)]))
        np.testing.assert_allclose(scene.values(name, "quaternion")[0], [0, 0, 0, 1])


def test_arrows_below_6_mm_shrink_as_a_whole_and_longer_ones_keep_their_head():
    lengths = np.array([3, 5.9, 6.1, 30]) * MM
    scene = decoded(make_motion(force=np.outer(200 * lengths, [0, 0, 1]), R_WP=Rotation.identity(4)))
    np.testing.assert_allclose(scene.values("force", "scale")[:, 0], [0.5, 5.9 / 6, 1, 1])
    np.testing.assert_allclose(scene.values("force/shaft", "scale")[:, 2], in_mm([[2, 2, 2.1, 26]])[0])
    np.testing.assert_array_equal(scene.values("force/head", "position")[:, :2], 0)


@pytest.mark.parametrize(
    "direction",
    [[1, 0, 0], [0, 1, 0], [0, -1, 0], [0.6, 0, -0.8], [0, 0, 1], [0, 0, -1], [1e-4, 0, -1], [0, 1e-3, -1], [2, 3, -6]],
)
@pytest.mark.parametrize("size", [6.0, 1e-9])
def test_arrows_turn_the_short_way_from_z_into_any_direction(direction, size):
    """The axis of the shortest rotation is at right angles to z, even for tiny and for opposite directions."""
    force = np.array([[0, 0, 6], size * np.array(direction), [0, 0, 0], [0, 0, 0]])
    scene = decoded(make_motion(force=force, R_WP=Rotation.identity(4)))
    quaternion = scene.values("force", "quaternion")[1]
    found = Rotation.from_quat(quaternion).apply([0, 0, 1])
    np.testing.assert_allclose(found, np.array(direction) / np.linalg.norm(direction), atol=1e-6)
    assert quaternion[2] == 0


# --------------------------------------------------------------------- animation


def test_animation_plays_once_at_one_frame_per_second():
    scene = decoded()
    assert scene.last["type"] == "set_animation"
    assert scene.options == {"play": True, "repetitions": 1}
    assert {clip["fps"] for clip in scene.clips.values()} == {1}
    for path, name in (("hole", "position"), ("peg", "quaternion"), ("force", "scale"), ("moment/head", "position")):
        assert scene.track(path, name)[0] == TIME


def test_peg_and_block_follow_their_poses():
    motion = make_motion()
    scene = decoded(motion)
    for name, positions, rotations in (("peg", motion.p_WP, motion.R_WP), ("hole", motion.p_WH, motion.R_WH)):
        np.testing.assert_allclose(scene.values(name, "position"), positions)
        found = Rotation.from_quat(scene.values(name, "quaternion"))
        np.testing.assert_allclose((found * rotations.inv()).magnitude(), 0, atol=1e-7)


@pytest.mark.parametrize("signs", [[1, 1, 1, 1], [1, -1, 1, 1], [-1, 1, -1, 1], [1, 1, -1, -1]])
def test_poses_are_joined_the_short_way_round(signs):
    """Consecutive quaternions enclose at most a right angle, whatever the signs with which they are stored."""
    turns = Rotation.from_rotvec(np.outer([0, 1.0, 2.0, 3.0], [0, 0, 1])).as_quat()
    rotations = Rotation.from_quat(np.array(signs)[:, None] * turns)
    found = decoded(make_motion(R_WP=rotations)).values("peg", "quaternion")
    np.testing.assert_allclose(found, signs[0] * turns, atol=1e-12)


def test_each_place_of_contact_has_an_arrow_along_its_force_at_a_scale_that_holds_the_largest():
    """At the mouth 2 N towards -x, then 60 N; at the tip 3 N along z; nothing on a face."""
    points, forces = np.zeros((4, 3, 3)), np.zeros((4, 3, 3))
    points[:, :2] = [[10 * MM, 0, 0], [0, 5 * MM, -8 * MM]]
    forces[1:3, 0] = [[-2, 0, 0], [-60, 0, 0]]
    forces[2:, 1] = [0, 0, 3]
    scene = decoded(make_motion(contact_points=points, contact_forces=forces))
    for k, place in enumerate(("mouth", "tip", "face")):
        np.testing.assert_allclose(scene.values(f"contact_{place}", "position"), points[:, k], atol=1e-12)
        np.testing.assert_allclose(drawn_arrows(scene, f"contact_{place}"), forces[:, k] / 2000, atol=1e-6)
