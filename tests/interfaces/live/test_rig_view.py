"""A rig trial on the page: what is drawn, and that the trial is the one that is performed unseen."""

import time

import numpy as np
import pandas as pd
import pytest

from experiments.trial.run_trial import run_trial
from interfaces.live.display import LiveDisplay
from interfaces.live.rig_view import show_trial
from models.scenario import TRIAL_STREAM, resolve_scenario
from skill.features.measurement import contact_load
from skill.policy.rig_policy import Action
from systems.law.control_law import ControlLaw
from tests.interfaces.live.test_display import Recorder


class Level(ControlLaw):
    """Feeds, and turns the peg upright at a constant rate about x."""

    def act(self, measured, estimate=None):
        return Action(turn=np.array([-4e-4, 0.0]), feed=-2e-4)


class Page(Recorder):
    """Keeps what is drawn, picture by picture."""

    def __init__(self):
        super().__init__()
        self.pictures = []

    def take_picture(self, now, load):
        transforms = {path: X.GetAsMatrix4() for path, X in self.transforms.items()}
        self.pictures.append((now, load, transforms, dict(self.values)))


@pytest.fixture
def trial(quick_scenario):
    quick_scenario.start.tilt = [0.03, 0.01]
    quick_scenario.trial.time_limit = 0.6
    return resolve_scenario(quick_scenario, seed=2, stream=TRIAL_STREAM)


def perform(page, trial):
    return show_trial(page, LiveDisplay(page), trial, Level(), number=2, kept=3, on_picture=page.take_picture)


@pytest.mark.slow
def test_the_trial_on_the_page_is_the_one_that_is_performed_unseen(trial):
    run = perform(Page(), trial)
    result, record = run.ended().result, run.ended().record(Level())
    unseen, other = run_trial(trial, Level(), seed=2)
    assert result == unseen
    pd.testing.assert_frame_equal(record.samples, other.samples)


@pytest.mark.slow
def test_the_page_shows_the_bodies_the_load_and_the_motion_of_the_rig(trial):
    page, began = Page(), time.monotonic()
    samples = perform(page, trial).ended().record(Level()).samples.set_index("time")
    assert time.monotonic() - began > samples.index[-1]  # not faster than the wall clock
    assert len(page.pictures) > 10
    for now, load, transforms, values in page.pictures[1:]:
        seen = samples[samples.index <= now]
        row = seen.iloc[-1]
        loads = [contact_load(row, 0.01) for row in seen[["fx", "fy", "fz", "mx", "my", "mz"]].to_numpy(dtype=float)]
        assert (load, values["contact"]["peak"]) == pytest.approx((loads[-1], max(loads)))
        assert values["contact"]["load"] == load
        assert values["force"] == values["moment"] == 0.0  # nobody's hand feels it
        assert values["depth"]["tip"] == row["depth"]
        assert values["skill"]["feed"] == pytest.approx(row["feed_speed"])
        assert (values["hand"], values["kept"]) == (False, 3)
        assert 0.0 < values["rate"] <= 1.05
        peg, hole = transforms["plant/peg"], transforms["plant/hole"]
        np.testing.assert_array_equal(peg[:3, :3], np.eye(3))  # the rig turns the block, not the peg
        assert peg[2, 3] == pytest.approx(row["tip_z"], abs=5e-4)
        np.testing.assert_array_equal(transforms["live/hand"], peg)
        turned = np.degrees([np.arctan2(hole[2, 1], hole[2, 2]), np.arcsin(-hole[2, 0])])
        np.testing.assert_allclose(turned, np.degrees([row["pitch"], row["yaw"]]), atol=0.2)
    assert np.abs(turned).max() > 0.3
    shown = [picture[3]["skill"] for picture in page.pictures]
    assert max(skill["turn"] for skill in shown) == pytest.approx(4e-4 / 0.02, rel=0.1)  # the rate of the policy
    after, tilt = (np.linalg.norm(list(shown[-1][name].values())) for name in ("turned", "tilt"))
    assert after < tilt  # the policy levels the peg


@pytest.mark.slow
def test_a_trial_that_diverges_ends_without_a_picture_of_it(trial, monkeypatch):
    monkeypatch.setattr("experiments.trial.diagram_trial.DIVERGENCE_FORCE", -1.0)
    page = Page()
    run = perform(page, trial)
    assert run.ended().result.reason.startswith("diverged")
    assert page.pictures == []
