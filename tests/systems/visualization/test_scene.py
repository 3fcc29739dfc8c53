from types import SimpleNamespace

import numpy as np
import pytest

import systems.visualization.scene
from experiments.demonstration_run import run_demonstration
from experiments.trial import run_trial, trial_scenario
from models.scenario import DEMONSTRATION_STREAM, resolve_scenario
from systems.visualization.scene import AddVisualization, aim_camera, recorded
from tests.browser import blankness, open_page
from tests.scripts.commands import run_python


class Recorder:
    """Replaces Meshcat."""

    def __init__(self):
        self.properties, self.calls = {}, []

    def SetCameraPose(self, camera_in_world, target_in_world):
        self.camera, self.target = np.array(camera_in_world), np.array(target_in_world)

    def SetProperty(self, path, name, value):
        self.properties[path, name] = value

    def StartRecording(self, frames_per_second, set_visualizations_while_recording):
        self.calls.append(("start", frames_per_second, set_visualizations_while_recording))

    def StopRecording(self):
        self.calls.append("stop")

    def PublishRecording(self):
        self.calls.append("publish")

    def StaticHtml(self):
        return "the page"


def test_the_camera_looks_from_the_cut_corner_slightly_from_above_at_the_upper_hole():
    meshcat = Recorder()
    aim_camera(meshcat)
    x, y, z = meshcat.camera - meshcat.target
    assert np.linalg.norm([x, y, z]) == pytest.approx(0.09, abs=0.005)  # 9 cm away
    assert np.degrees(np.arctan2(y, x)) == pytest.approx(41.6, abs=0.5)
    assert np.degrees(np.arcsin(z / np.linalg.norm([x, y, z]))) == pytest.approx(22.3, abs=0.5)
    np.testing.assert_array_equal(meshcat.target, [0.0, 0.0, -0.004])  # on the axis of the hole, 4 mm deep


def test_a_view_can_be_chosen_and_has_neither_a_grid_nor_axes():
    meshcat = Recorder()
    aim_camera(meshcat, camera=np.array([1.0, 2.0, 3.0]), target=np.array([4.0, 5.0, 6.0]))
    np.testing.assert_array_equal([meshcat.camera, meshcat.target], [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])
    assert meshcat.properties[("/Grid", "visible")] is False
    assert meshcat.properties[("/Axes", "visible")] is False
    assert (
        0.5 < meshcat.properties[("/Lights/AmbientLight/<object>", "intensity")] <= 1.0
    )  # 1 is as bright as the lamps


def test_a_recording_has_32_frames_a_second_and_is_written_at_the_end(monkeypatch, tmp_path):
    meshcat = Recorder()
    opened = []
    monkeypatch.setattr(systems.visualization.scene, "Meshcat", lambda params: opened.append(params) or meshcat)
    with recorded(tmp_path / "a.html") as given:
        assert given is meshcat
        assert meshcat.calls == [("start", 32.0, False)]
        assert not (tmp_path / "a.html").exists()
    assert meshcat.calls[1:] == ["stop", "publish"]
    assert (tmp_path / "a.html").read_text() == "the page"
    assert meshcat.target[2] == -0.004  # the camera is aimed
    assert [params.host for params in opened] == ["127.0.0.1"]  # no other machine reaches its port


def test_a_contact_force_of_6_newtons_is_drawn_1_cm_long(monkeypatch):
    added = {}
    for name in ("MeshcatVisualizer", "ContactVisualizer"):
        add = lambda *args, name=name: added.update({name: args})  # noqa: E731
        monkeypatch.setattr(systems.visualization.scene, name, SimpleNamespace(AddToBuilder=add))
    contact = SimpleNamespace(scene_graph="scene graph", plant="plant")
    AddVisualization(builder="builder", contact=contact, meshcat="meshcat")
    *where, shapes = added.pop("MeshcatVisualizer")
    assert where == ["builder", "scene graph", "meshcat"]
    assert 1 / shapes.publish_period == 32.0
    *where, arrows = added["ContactVisualizer"]
    assert where == ["builder", "plant", "meshcat"]
    assert 1 / arrows.publish_period == 32.0
    assert 6.0 / arrows.newtons_per_meter == pytest.approx(0.01)
    assert 0.5 / arrows.newton_meters_per_meter == pytest.approx(0.01)  # 0.5 N m
    assert 0.05 < arrows.radius / 0.01 < 0.1  # slim
    assert 0.1 < arrows.force_threshold < 0.3  # N; shorter than half a millimetre is not drawn


@pytest.mark.browser
@pytest.mark.slow
@pytest.mark.parametrize("kind", ["demonstration", "insertion"])
def test_recording_is_one_page_that_shows_the_scene(quick_scenario, skill, tmp_path, kind):
    page = tmp_path / "recording.html"
    quick_scenario.recorder.time_limit = quick_scenario.trial.time_limit = 0.3
    with recorded(page) as meshcat:
        if kind == "demonstration":
            run_demonstration(resolve_scenario(quick_scenario, seed=1, stream=DEMONSTRATION_STREAM), meshcat=meshcat)
        else:
            run_trial(trial_scenario(quick_scenario, number=1), skill, seed=1, meshcat=meshcat)
    with open_page(page, size=(800, 600)) as browser:
        browser.wait("document.querySelector('canvas') !== null")
        picture = browser.screenshot()
        assert browser.errors() == []
        assert browser.requests() == []
    content = blankness(picture)
    assert content.colours > 20
    assert content.drawn > 0.02


def test_failed_recording_writes_no_page(tmp_path):
    page = tmp_path / "recording.html"
    with pytest.raises(RuntimeError, match="failed"), recorded(page):
        raise RuntimeError("failed")
    assert not page.exists()


@pytest.mark.slow
def test_a_recording_prints_nothing(tmp_path):
    """In a process of its own: importing Drake sets the level of its log."""
    imports = "import sys, interfaces.terminal as t\nfrom pathlib import Path\nimport systems.visualization.scene as s"
    code = f"{imports}\nwith s.recorded(Path(sys.argv[1])): pass"
    done = run_python("-c", code, tmp_path / "recording.html")
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
