import re

import pandas as pd
import pytest

from experiments.trial.run_trial import run_trial
from models.scenario import TRIAL_STREAM, resolve_scenario
from skill.data.demonstration import read_demonstration, write_demonstration
from skill.data.rig_run import (
    RUN_COLUMNS,
    RigRun,
    read_rig_run,
    write_rig_run,
)
from tests.crafted_files import rewrite


@pytest.fixture(scope="module")
def run(skill):
    """The record of a real run, too short to insert."""
    from tests.quick_scenario import make_quick_scenario

    scenario = make_quick_scenario()
    scenario.trial.time_limit = 0.2
    return run_trial(resolve_scenario(scenario, seed=0, stream=TRIAL_STREAM), skill, seed=0)[1]


@pytest.fixture
def path(run, tmp_path):
    path = tmp_path / "run.parquet"
    write_rig_run(run, path)
    return path


def error_message(path):
    """The message with which a file is refused; one line that names the file."""
    with pytest.raises(ValueError, match=re.escape(str(path))) as caught:
        read_rig_run(path)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_a_run_is_read_back_bit_identically(run, path):
    again = read_rig_run(path)
    pd.testing.assert_frame_equal(again.samples, run.samples, check_exact=True)
    assert again.result == run.result
    assert again.metadata == run.metadata
    assert tuple(again.samples.columns) == RUN_COLUMNS


def test_a_file_of_the_other_kind_is_refused(path, demonstrations, tmp_path):
    other = tmp_path / "demonstration.parquet"
    write_demonstration(demonstrations[0], other)
    assert "expected a rig_run file" in error_message(other)
    with pytest.raises(ValueError, match="expected a demonstration file"):
        read_demonstration(path)


@pytest.mark.parametrize(
    ("header", "message"),
    [
        ({"result": None}, "'result' in the metadata is None, expected an object"),
        ({"result": [1]}, "'result' in the metadata is [1], expected an object"),
        ({"metadata": None}, "'metadata' in the metadata is None, expected an object"),
        ({"metadata": {"state_names": "free"}}, "'state_names' is 'free', expected a list of texts"),
        ({"metadata": {"state_names": [1, 2]}}, "'state_names' is [1, 2], expected a list of texts"),
        ({"result": {"reason": 3}}, "'reason' of the result is 3, expected a text"),
        ({"metadata": {"geometry": {"peg_radius": -1}}}, "geometry lacks"),
    ],
)
def test_an_entry_of_the_wrong_type_is_refused(path, header, message):
    assert message in error_message(rewrite(path, "rig_run", **header))


def test_a_run_may_have_a_single_row(run, tmp_path):
    result = {"inserted": False, "reason": "time over", "time_s": 0.004, "depth_mm": -1.0}
    write_rig_run(RigRun(run.samples.head(1), result), tmp_path / "one.parquet")
    assert len(read_rig_run(tmp_path / "one.parquet").samples) == 1


def test_a_run_with_some_of_the_contacts_is_refused(run):
    with pytest.raises(ValueError, match="missing columns \\['contact_tip_x'\\]"):
        RigRun(run.samples.drop(columns="contact_tip_x"), run.result, run.metadata)
