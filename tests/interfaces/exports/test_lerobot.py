"""The files of a data set of LeRobot, and the way back to the recordings."""

import json
import re
import shutil

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from interfaces.exports import lerobot
from interfaces.exports.lerobot import (
    ABOUT,
    HEADER,
    NAME,
    OUTCOME,
    QUANTILES,
    dataset_files,
    feature_statistics,
    joined_statistics,
)
from scripts.export import import_lerobot
from skill.recordings.lerobot_folder import read_lerobot_folder
from tests.interfaces.exports.datasets import exported, write_demonstrations, write_runs

EPISODES = "meta/episodes/chunk-000/file-000.parquet"
DATA = "data/chunk-000/file-000.parquet"


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    return exported(tmp_path_factory.mktemp("export"))[1]


def test_the_files_are_those_of_version_3(dataset):
    frames = {f"data/chunk-000/file-00{k}.parquet" for k in range(3)}
    expected = {*frames, EPISODES, "meta/info.json", "meta/stats.json", "meta/tasks.parquet", ABOUT}
    assert {p.relative_to(dataset).as_posix() for p in dataset.rglob("*") if p.is_file()} == expected
    assert dataset_files(dataset) == expected


def test_info_and_about_describe_the_columns_of_the_data(dataset):
    info, about = (json.loads((dataset / name).read_text()) for name in ("meta/info.json", ABOUT))
    assert (info["codebase_version"], info["fps"], info["video_path"]) == ("v3.0", 50, None)
    schema = pq.read_schema(dataset / DATA)
    assert set(schema.names) == set(info["features"])
    for key, feature in info["features"].items():
        kind, names = schema.field(key).type, feature["names"]
        assert feature["shape"] == [1 if names is None else len(names)]
        numbers = {"float": "float32", "double": "float64"}
        stored = str(kind if names is None else kind.value_type)
        assert numbers.get(stored, stored) == feature["dtype"]
        assert "/" not in key
    wrench = ["fx [N]", "fy [N]", "fz [N]", "mx [N m]", "my [N m]", "mz [N m]"]
    assert info["features"]["observation.wrench"]["names"] == wrench
    assert about["kind"] == "demonstrations"
    assert about["features"]["contact_label"]["labels"][:2] == ["free", "on the face"]
    assert about["features"]["outcome"]["labels"][0] == "inserted"
    assert about["features"]["action"]["units"] == ["m", "m", "m", "rad", "rad", "rad"]


def test_indices_and_times(dataset):
    frames, episodes = (pd.read_parquet(dataset / name) for name in ("data", EPISODES))
    assert frames["index"].tolist() == list(range(len(frames)))
    for row in episodes.itertuples():
        part = frames[row.dataset_from_index : row.dataset_to_index]
        assert set(part["episode_index"]) == {row.episode_index}
        assert part["frame_index"].tolist() == list(range(row.length))
        np.testing.assert_array_equal(part["timestamp"], (np.arange(row.length) / 50).astype("f4"))
    assert len(episodes) == 3
    tasks = pd.read_parquet(dataset / "meta/tasks.parquet")
    assert (tasks.index.name, tasks.columns.tolist(), tasks["task_index"].tolist()) == ("task", ["task_index"], [0])
    assert [list(names) for names in episodes["tasks"]] == [[tasks.index[0]]] * 3
    assert episodes[OUTCOME].tolist() == ["inserted"] * 3
    assert json.loads(episodes[HEADER][1])["metadata"]["number"] == 1


def test_statistics_are_there_for_each_feature(dataset):
    stats, info = (json.loads((dataset / name).read_text()) for name in ("meta/stats.json", "meta/info.json"))
    assert set(stats) == set(info["features"])
    values = np.stack(pd.read_parquet(dataset / "data")["observation.wrench"].to_list()).astype(float)
    np.testing.assert_allclose(stats["observation.wrench"]["std"], values.std(axis=0), rtol=1e-9)
    expected = {f"stats/{key}/{name}" for key in stats for name in stats["action"]}
    assert {name for name in pq.read_schema(dataset / EPISODES).names if name.startswith("stats/")} == expected
    assert set(stats["action"]) == {"min", "max", "mean", "std", "count", *QUANTILES}


def test_joined_statistics_are_those_of_all_frames_and_joined_quantiles_are_weighted_means():
    rng = np.random.default_rng(0)
    parts = [rng.normal(k, 1.0 + k, size=(n, 3)) for k, n in enumerate((5, 40, 17))]
    joined = joined_statistics([feature_statistics(part) for part in parts])
    for name in ("min", "max", "mean", "std"):
        np.testing.assert_allclose(joined[name], getattr(np.vstack(parts), name)(axis=0))
    assert joined["count"].tolist() == [62]
    for name, share in QUANTILES.items():
        each = [np.quantile(part, share, axis=0) for part in parts]
        np.testing.assert_allclose(joined[name], np.average(each, axis=0, weights=[5, 40, 17]))
    flags = feature_statistics(np.array([False, False, False, True]))
    assert [flags[name].tolist() for name in ("min", "max", "mean", "count")] == [[0.0], [1.0], [0.25], [4]]


def test_the_reader_of_other_data_sets_reads_the_wrench(tmp_path):
    source, dataset = exported(tmp_path, write_runs)
    found = read_lerobot_folder(dataset)
    assert [recording.channels for recording in found] == [("fx", "fy", "fz", "mx", "my", "mz")] * 3
    for recording, path in zip(found, sorted(source.glob("*.parquet")), strict=True):
        samples = pq.read_table(path).to_pandas()
        np.testing.assert_array_equal(recording.values, samples[list(recording.channels)].astype("f4"))
        np.testing.assert_allclose(recording.time, samples["time"], atol=1e-9)


def test_a_full_chunk_is_followed_by_another(tmp_path, monkeypatch):
    monkeypatch.setattr(lerobot, "CHUNK_FILES", 2)
    _, dataset = exported(tmp_path)
    episodes = pd.read_parquet(dataset / EPISODES)
    assert episodes["data/chunk_index"].tolist() == [0, 0, 1]
    assert episodes["data/file_index"].tolist() == [0, 1, 0]
    for chunk, file in ((0, 0), (0, 1), (1, 0)):
        assert (dataset / f"data/chunk-{chunk:03d}/file-{file:03d}.parquet").is_file()


# ---------------------------------------------------------------------- way back


@pytest.mark.parametrize("write", [write_demonstrations, write_runs])
def test_the_recordings_come_back_byte_for_byte(tmp_path, write):
    source, dataset = exported(tmp_path, write)
    import_lerobot(dataset, tmp_path / "again")
    names = sorted(path.name for path in source.iterdir())
    assert sorted(path.name for path in (tmp_path / "again").iterdir()) == names
    for name in names:
        assert (tmp_path / "again" / name).read_bytes() == (source / name).read_bytes()


def change_json(path, **changes):
    path.write_text(json.dumps({**json.loads(path.read_text()), **changes}))


def change_table(file, change):
    def apply(folder):
        pq.write_table(change(pq.read_table(folder / file)), folder / file)

    return apply


def change_column(file, name, change):
    return change_table(file, lambda t: t.set_column(t.schema.get_field_index(name), name, change(t[name])))


def texts(name, values):
    return change_column(EPISODES, name, lambda _: pa.array(values))


def feature_of(value):
    return lambda folder: change_json(folder / "meta/info.json", features={"recording": value})


def first_is_empty(file, name):
    return change_column(file, name, lambda c: pa.array([None, *c.to_pylist()[1:]], type=c.type))


REFUSED = {
    "no about": (lambda folder: (folder / ABOUT).unlink(), f"{ABOUT}: no such file; expected a data set that"),
    "version": (lambda f: change_json(f / "meta/info.json", codebase_version="v2.1"), "version 'v2.1' of the format"),
    "about version": (lambda f: change_json(f / ABOUT, format_version=9), "version 9, kind 'demonstrations'; expected"),
    "kind": (lambda f: change_json(f / ABOUT, kind="pictures"), "kind 'pictures'; expected version 1"),
    "info": (lambda f: (f / "meta/info.json").write_text("{"), "info.json: damaged"),
    "no info": (lambda f: (f / "meta/info.json").unlink(), "info.json: no such file; expected a data set of LeRobot"),
    "no data": (lambda f: shutil.rmtree(f / "data"), "no files data/chunk-*/*.parquet"),
    "no headers": (change_table(EPISODES, lambda t: t.drop_columns([HEADER])), f"no column ['{HEADER}']"),
    "no episodes": (lambda f: (f / EPISODES).unlink(), "no files meta/episodes/chunk-*/*.parquet"),
    "truncated": (lambda f: (f / DATA).write_bytes((f / DATA).read_bytes()[:-9]), "not a complete Parquet file"),
    "lost frames": (change_table(DATA, lambda t: t.slice(1)), "episode 0: frames are missing"),
    "lost episode": (lambda f: (f / "data/chunk-000/file-002.parquet").unlink(), "episodes of meta and data differ"),
    "header": (texts(HEADER, ["{"] * 3), f"episode 0: damaged {HEADER}"),
    "header of another kind": (texts(HEADER, ['{"good": true}'] * 3), f"damaged {HEADER} ('metadata')"),
    "header of a number": (texts(HEADER, ['{"metadata": 3}'] * 3), f"damaged {HEADER} ("),
    "path": (texts(NAME, ["../a.parquet", "b.parquet", "c.parquet"]), "episode 0: haptic_skill/name is '../a"),
    "name of a number": (texts(NAME, [1, 2, 3]), "episode 0: haptic_skill/name is 1"),
    "same name": (texts(NAME, ["a.parquet"] * 3), "episode 1: haptic_skill/name is 'a.parquet'"),
    "hidden name": (texts(NAME, [".parquet", "b.parquet", "c.parquet"]), "haptic_skill/name is '.parquet'"),
    "bell in a name": (texts(NAME, ["a.parquet", "b\a.parquet", "c.parquet"]), "episode 1: haptic_skill/name is"),
    "shuffled frames": (
        change_table(DATA, lambda t: t.take(np.r_[1, 0, 2 : len(t)])),
        "episode 0: frames are missing, occur twice or are out of order",
    ),
    "no names": (feature_of({"names": None}), "the feature 'recording' has the columns None, expected ['time',"),
    "recording of a list": (feature_of([1, 2]), "the feature 'recording' has the columns None"),
    "empty row": (first_is_empty(DATA, "recording"), "is empty in 1 rows, expected fixed_size_list<"),
    "no name": (first_is_empty(EPISODES, NAME), "is empty in 1 rows, expected a text in each row"),
    "episode of a text": (texts("episode_index", ["0", "1", "2"]), "'episode_index' has type"),
    "precision": (
        change_column(DATA, "recording", lambda c: c.cast(pa.list_(pa.float32(), 21))),
        "'recording' has type fixed_size_list<",
    ),
    "implausible": (
        texts(HEADER, ['{"good": 1.5, "outcome": "inserted", "metadata": {}}'] * 3),
        "episode 0: 'good' in the metadata is 1.5, expected true or false",
    ),
    "outcome of a number": (
        texts(HEADER, ['{"good": true, "outcome": 3, "metadata": {}}'] * 3),
        "episode 0: 'outcome' in the metadata is 3, expected a text",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_come_back_is_named_in_one_line(tmp_path, name):
    change, message = REFUSED[name]
    _, dataset = exported(tmp_path)
    change(dataset)
    before = sorted(path.name for path in tmp_path.iterdir())
    with pytest.raises(ValueError, match=f"^{re.escape(str(dataset))}.*{re.escape(message)}"):
        import_lerobot(dataset, tmp_path / "again")
    assert sorted(path.name for path in tmp_path.iterdir()) == before
