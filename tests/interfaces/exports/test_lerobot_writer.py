"""The files of a data set of LeRobot."""

import json

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

from interfaces.exports import lerobot_writer
from interfaces.exports.lerobot_reader import dataset_files
from interfaces.exports.lerobot_writer import ABOUT, HEADER, OUTCOME
from skill.data.demonstration import read_demonstrations
from skill.recordings.lerobot_folder import read_lerobot_folder
from tests.interfaces.exports.datasets import exported, write_demonstrations, write_runs


@pytest.fixture(scope="module")
def both(tmp_path_factory):
    return exported(tmp_path_factory.mktemp("export"))


def test_the_files_are_those_of_version_3(both):
    _, dataset = both
    expected = {
        *("data/chunk-000/file-000.parquet", "meta/episodes/chunk-000/file-000.parquet"),
        *("meta/info.json", "meta/stats.json", "meta/tasks.parquet", ABOUT),
    }
    assert {p.relative_to(dataset).as_posix() for p in dataset.rglob("*") if p.is_file()} == expected
    assert dataset_files(dataset) == expected


def test_info_describes_the_columns_of_the_data(both):
    _, dataset = both
    info = json.loads((dataset / "meta/info.json").read_text())
    assert (info["codebase_version"], info["fps"], info["video_path"]) == ("v3.0", 50, None)
    schema = pq.read_schema(dataset / "data/chunk-000/file-000.parquet")
    assert set(schema.names) == set(info["features"])
    for key, feature in info["features"].items():
        kind = schema.field(key).type
        names = feature["names"]
        assert feature["shape"] == [1 if names is None else len(names)]
        assert str(kind if names is None else kind.value_type).replace("float", "float32").replace(
            "double", "float64"
        ) == feature["dtype"].replace("float32", "float32")
        assert "/" not in key
    assert info["features"]["observation.wrench"]["names"] == [
        *(f"f{a} [N]" for a in "xyz"),
        *(f"m{a} [N m]" for a in "xyz"),
    ]


def test_indices_and_times(both):
    _, dataset = both
    frames = pq.read_table(dataset / "data/chunk-000/file-000.parquet").to_pandas()
    episodes = pd.read_parquet(dataset / "meta/episodes/chunk-000/file-000.parquet")
    assert frames["index"].tolist() == list(range(len(frames)))
    for row in episodes.itertuples():
        part = frames[row.dataset_from_index : row.dataset_to_index]
        assert set(part["episode_index"]) == {row.episode_index}
        assert len(part) == row.length
        assert part["frame_index"].tolist() == list(range(row.length))
        np.testing.assert_array_equal(part["timestamp"], (np.arange(row.length) / 50).astype("f4"))
    assert pq.ParquetFile(dataset / "data/chunk-000/file-000.parquet").num_row_groups == len(episodes) == 3
    tasks = pd.read_parquet(dataset / "meta/tasks.parquet")
    assert (tasks.index.name, tasks.columns.tolist(), tasks["task_index"].tolist()) == ("task", ["task_index"], [0])
    assert [list(names) for names in episodes["tasks"]] == [[tasks.index[0]]] * 3
    assert episodes[OUTCOME].tolist() == ["inserted"] * 3
    assert json.loads(episodes[HEADER][1])["metadata"]["number"] == 1


def test_statistics_are_there_for_each_feature(both):
    _, dataset = both
    stats = json.loads((dataset / "meta/stats.json").read_text())
    info = json.loads((dataset / "meta/info.json").read_text())
    frames = pq.read_table(dataset / "data/chunk-000/file-000.parquet")
    assert set(stats) == set(info["features"])
    values = np.stack(frames["observation.wrench"].to_pylist()).astype(float)
    np.testing.assert_allclose(stats["observation.wrench"]["std"], values.std(axis=0), rtol=1e-9)
    episodes = pq.read_schema(dataset / "meta/episodes/chunk-000/file-000.parquet").names
    expected = {f"stats/{key}/{name}" for key in stats for name in stats["action"]}
    assert {name for name in episodes if name.startswith("stats/")} == expected
    assert set(stats["action"]) == {"min", "max", "mean", "std", "count", "q01", "q10", "q50", "q90", "q99"}


def test_the_meanings_of_numbers_are_described(both):
    _, dataset = both
    about = json.loads((dataset / ABOUT).read_text())
    assert about["kind"] == "demonstrations"
    assert about["features"]["contact_label"]["labels"][:2] == ["free", "on the face"]
    assert about["features"]["outcome"]["labels"][0] == "inserted"
    assert about["features"]["action"]["units"] == ["m", "m", "m", "rad", "rad", "rad"]


@pytest.mark.parametrize("feature", [None, "observation.environment_state"])
@pytest.mark.parametrize("write", [write_demonstrations, write_runs])
def test_the_reader_of_this_project_reads_the_wrench(tmp_path, feature, write):
    source, dataset = exported(tmp_path, write)
    found = read_lerobot_folder(dataset, feature=feature)
    assert [recording.channels for recording in found] == [("fx", "fy", "fz", "mx", "my", "mz")] * 3
    for recording, path in zip(found, sorted(source.glob("*.parquet")), strict=True):
        samples = pq.read_table(path).to_pandas()
        np.testing.assert_array_equal(recording.values, samples[list(recording.channels)].astype("f4"))
        np.testing.assert_allclose(recording.time, samples["time"], atol=1e-9)


def test_a_full_file_is_followed_by_another(tmp_path, monkeypatch):
    monkeypatch.setattr(lerobot_writer, "FILE_MEGABYTES", 0.05)
    monkeypatch.setattr(lerobot_writer, "CHUNK_FILES", 2)
    source, dataset = exported(tmp_path)
    assert sorted(p.relative_to(dataset / "data").as_posix() for p in (dataset / "data").rglob("*.parquet")) == [
        "chunk-000/file-000.parquet",
        "chunk-000/file-001.parquet",
        "chunk-001/file-000.parquet",
    ]
    episodes = pd.read_parquet(dataset / "meta/episodes/chunk-000/file-000.parquet")
    assert episodes["data/chunk_index"].tolist() == [0, 0, 1]
    assert episodes["data/file_index"].tolist() == [0, 1, 0]
    assert len(read_lerobot_folder(dataset)) == len(read_demonstrations(source))
