import pytest

from models.scenario import DEMONSTRATION_STREAM, resolve_scenario
from systems.runs.demonstration_run import run_demonstration
from systems.runs.trial import run_trial, trial_scenario
from systems.visualization.scene import recorded
from tests.browser import blankness, open_page


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
