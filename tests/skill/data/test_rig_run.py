import json
import re

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from models.scenario import TRIAL_STREAM, resolve_scenario
from skill.data.demonstration import read_demonstration, write_demonstration
from skill.data.rig_run import RUN_COLUMNS, RUN_VERSION, RigRun, read_rig_run, write_rig_run
from systems.runs.trial import run_trial


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
    ("change", "message"),
    [
        (lambda f: f.drop(columns="guard"), "missing columns ['guard']"),
        (lambda f: f.rename(columns={"depth": "z"}), "unknown columns ['z']"),
        (lambda f: f.assign(fx=np.where(f.index == 3, np.nan, f["fx"])), "'fx' is not finite in row 3"),
        (lambda f: f.iloc[::-1], "'time' does not increase"),
    ],
    ids=["missing", "renamed", "not finite", "backwards"],
)
def test_a_bad_table_is_refused(path, change, message):
    table = pq.read_table(path)
    frame = change(table.to_pandas())
    pq.write_table(
        pa.Table.from_pandas(frame, preserve_index=False).replace_schema_metadata(table.schema.metadata), path
    )
    assert message in error_message(path)


def test_a_run_of_another_version_is_refused(path):
    table = pq.read_table(path)
    header = json.loads(table.schema.metadata[b"rig_run"])
    header["format_version"] = RUN_VERSION + 1
    pq.write_table(table.replace_schema_metadata({b"rig_run": json.dumps(header).encode()}), path)
    assert f"version {RUN_VERSION + 1}, expected {RUN_VERSION}" in error_message(path)


def test_runs_of_version_2_stay_readable(path):
    table = pq.read_table(path)
    header = {**json.loads(table.schema.metadata[b"rig_run"]), "format_version": 2}
    pq.write_table(table.replace_schema_metadata({b"rig_run": json.dumps(header).encode()}), path)
    assert len(read_rig_run(path).samples) == table.num_rows


def test_a_truncated_run_is_refused(path):
    path.write_bytes(path.read_bytes()[:-20])
    assert "not a complete Parquet file" in error_message(path)


def test_metadata_without_a_result_is_refused(path):
    table = pq.read_table(path)
    header = json.dumps({"format_version": RUN_VERSION}).encode()
    pq.write_table(table.replace_schema_metadata({b"rig_run": header}), path)
    assert "result" in error_message(path)


def test_a_run_of_bad_samples_is_refused(run):
    with pytest.raises(ValueError, match="missing columns"):
        RigRun(samples=run.samples.drop(columns="yaw"), result=run.result)


def test_a_run_may_have_a_single_row(run, tmp_path):
    write_rig_run(RigRun(run.samples.head(1), run.result), tmp_path / "one.parquet")
    assert len(read_rig_run(tmp_path / "one.parquet").samples) == 1
