import numpy as np
import pytest

import systems.visualization.meshcat_scene
from experiments.trial.run_trial import run_trial
from experiments.trial.trial_set import trial_scenario
from skill.states.state_style import state_colours
from systems.visualization.meshcat_scene import aim_camera, legend, recorded
from tests.browser import blankness, open_page
from tests.systems.visualization.canvas import Canvas


class Recorder(Canvas):
    """A Canvas that is recorded."""

    def __init__(self):
        super().__init__()
        self.calls = []

    def SetCameraPose(self, camera_in_world, target_in_world):
        self.camera, self.target = np.array(camera_in_world), np.array(target_in_world)

    def StartRecording(self, frames_per_second, set_visualizations_while_recording):
        self.calls.append(("start", frames_per_second, set_visualizations_while_recording))

    def StopRecording(self):
        self.calls.append("stop")

    def PublishRecording(self):
        self.calls.append("publish")

    def StaticHtml(self):
        return "<body>'</body>' in a script</body></html>"


def test_a_view_can_be_chosen_and_has_neither_a_grid_nor_axes():
    meshcat = Recorder()
    aim_camera(meshcat, camera=np.array([1.0, 2.0, 3.0]), target=np.array([4.0, 5.0, 6.0]))
    np.testing.assert_array_equal([meshcat.camera, meshcat.target], [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])
    assert meshcat.properties[("/Grid", "visible")] is False
    assert meshcat.properties[("/Axes", "visible")] is False


def test_a_recording_has_32_frames_a_second_and_is_written_with_its_legend_at_the_end(monkeypatch, tmp_path):
    meshcat = Recorder()
    opened = []
    monkeypatch.setattr(systems.visualization.meshcat_scene, "Meshcat", lambda params: opened.append(params) or meshcat)
    with recorded(tmp_path / "a.html", states=["free"]) as given:
        assert given is meshcat
        assert meshcat.calls == [("start", 32.0, False)]
        assert not (tmp_path / "a.html").exists()
    assert meshcat.calls[1:] == ["stop", "publish"]
    assert (tmp_path / "a.html").read_text() == f"<body>'</body>' in a script{legend(['free'])}</body></html>"
    assert [params.host for params in opened] == ["127.0.0.1"]  # no other machine reaches its port


def test_the_legend_names_the_arrow_and_the_states():
    text = legend(["free", "<two> points"])
    assert "contact force on the peg,<br>10 mm = 10 N" in text
    assert "&lt;two&gt; points" in text
    assert all(colour in text for colour in state_colours(2))
    assert "colour of the peg" not in legend([])


@pytest.mark.browser
@pytest.mark.slow
def test_recording_is_one_page_that_shows_the_scene_and_marks_the_present_state(quick_scenario, skill, tmp_path):
    page, states = tmp_path / "recording.html", skill.state_names()
    quick_scenario.trial.time_limit = 0.3
    with recorded(page, states=states) as meshcat:
        run_trial(trial_scenario(quick_scenario, number=1), skill, seed=1, meshcat=meshcat)
    with open_page(page, size=(800, 600)) as browser:
        browser.wait("document.querySelector('canvas') !== null && viewer.animator.duration > 0.2")
        assert "contact force on the peg" in browser.run("return document.getElementById('legend').innerText")
        browser.wait("document.querySelectorAll('#legend .now').length === 1")
        shown = (
            "return [...Array(arguments[0]).keys()].map(k => viewer.scene_tree.find("
            "['drake', 'contact_state', String(k)]).object.visible)"
        )
        [present] = np.flatnonzero(browser.run(shown, len(states)))
        assert browser.run("return document.querySelector('#legend .now').innerText") == states[present]
        feed = "return viewer.scene_tree.find(['drake', 'plant', 'feed']).object.visible"
        assert browser.run(feed) is False
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
