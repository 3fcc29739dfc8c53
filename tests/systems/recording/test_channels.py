"""Properties of the recorded channels, in every scenario."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from experiments.demonstration_run import run_demonstration
from models.scenario import DEMONSTRATION_STREAM, SCENARIO_FOLDER, load_scenario, resolve_scenario
from skill.data.demonstration import COLUMNS, validate_samples
from systems.virtual_environment import start_pose

NAMES = sorted(path.stem for path in SCENARIO_FOLDER.glob("*.yaml"))
CONSTANT = {"free": set(), "rig": set(), "axial": {"ax", "ay", "az"}}


def short_scenario(name, seed):
    """Returns a resolved scenario of 1 s that starts at the mouth, so that there is contact."""
    scenario = load_scenario(name)
    scenario.start.height = 1e-4
    scenario.recorder.time_limit = 1.0
    if scenario.start.tilt is None:
        scenario.start.demonstrated_tilt_range = 0.05
    return resolve_scenario(scenario, seed=seed, stream=DEMONSTRATION_STREAM)


@pytest.fixture(scope="module", params=NAMES)
def runs(request):
    """Runs of the same seed twice, and of another seed."""
    scenarios = [short_scenario(request.param, seed) for seed in (3, 3, 4)]
    return scenarios, [run_demonstration(s) for s in scenarios]


def test_every_channel_is_finite_named_and_not_constant(runs):
    scenarios, demonstrations = runs
    samples = demonstrations[0].samples
    assert tuple(samples.columns) == COLUMNS
    validate_samples(samples, "demonstration")
    assert np.isfinite(samples.to_numpy()).all()
    assert np.linalg.norm(samples[["fx", "fy", "fz"]], axis=1).max() > 0.1  # there is contact
    constant = {c for c in COLUMNS if samples[c].nunique() < 3}
    assert constant <= CONSTANT[scenarios[0].fixture]


def test_equal_seeds_give_bit_identical_runs_and_other_seeds_do_not(runs):
    first, again, other = (run.samples.to_numpy() for run in runs[1])
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)


def test_the_first_sample_is_the_start_of_the_scenario(runs):
    scenarios, demonstrations = runs
    for scenario, demonstration in zip(scenarios, demonstrations, strict=True):
        row = demonstration.samples.iloc[0]
        X = start_pose(scenario)
        np.testing.assert_allclose(row[["x", "y", "z"]].to_numpy(float), X.translation(), atol=1e-9)
        turn = Rotation.from_matrix(X.rotation().matrix()).as_rotvec()
        np.testing.assert_allclose(row["angle"] * row[["ax", "ay", "az"]].to_numpy(float), turn, atol=1e-9)
    given = load_scenario("one_of_everything").start.tilt
    starts = [s.start.tilt for s in scenarios]
    assert starts[0] == starts[1]
    assert starts[0] != starts[2] or starts[0] == given
