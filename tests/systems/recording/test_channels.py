"""Properties of the recorded channels, in every scenario."""

import numpy as np
import pytest

from experiments.demonstration_run import run_demonstration
from models.scenario import DEMONSTRATION_STREAM, SCENARIO_FOLDER, load_scenario, resolve_scenario
from skill.data.demonstration import COLUMNS, validate_samples

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


@pytest.mark.parametrize("name", NAMES)
def test_every_channel_is_finite_named_and_not_constant_and_depends_on_the_seed_only(name):
    scenarios = [short_scenario(name, seed) for seed in (3, 3, 4)]
    samples, again, other = (run_demonstration(scenario).samples for scenario in scenarios)
    assert tuple(samples.columns) == COLUMNS
    validate_samples(samples, "demonstration")
    assert np.isfinite(samples.to_numpy()).all()
    assert np.linalg.norm(samples[["fx", "fy", "fz"]], axis=1).max() > 0.1  # there is contact
    constant = {c for c in COLUMNS if samples[c].nunique() < 3}
    assert constant <= CONSTANT[scenarios[0].fixture]
    np.testing.assert_array_equal(samples, again)
    assert not np.array_equal(samples, other)
