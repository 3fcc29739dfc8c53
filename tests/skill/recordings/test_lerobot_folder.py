"""Data sets of LeRobot, versions 2.1 and 3.0, written with PyArrow after the description of the format."""

import json
import re

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from skill.recordings.lerobot_folder import read_lerobot_folder

WRENCH = ["fx", "fy", "fz", "mx", "my", "mz"]
FPS = 50
LENGTHS = (20, 30, 25)


def wrench_of(episode):
    return np.random.default_rng(episode).normal(size=(LENGTHS[episode], 6)).astype("f4")


def write(folder, *, key="observation.wrench", names=WRENCH, version="v3.0", kind=None, change=lambda t: t, **info):
    """A data set of three episodes, in two files (3.0) or three (2.1)."""
    features = {
        key: {"dtype": "float32", "shape": [6], "names": names},
        "observation.state": {"dtype": "float32", "shape": [2], "names": ["joint_1", "joint_2"]},
        "observation.images.top": {"dtype": "video", "shape": [480, 640, 3], "names": ["height", "width", "channels"]},
        "phase": {"dtype": "int64", "shape": [1], "names": None},
        **{name: {"dtype": "int64", "shape": [1], "names": None} for name in ("frame_index", "episode_index")},
    }
    (folder / "meta").mkdir(parents=True, exist_ok=True)
    info = {"codebase_version": version, "fps": FPS, "features": features, "total_episodes": 3, **info}
    (folder / "meta" / "info.json").write_text(json.dumps(info))
    parts = []
    for episode, length in enumerate(LENGTHS):
        frames = np.arange(length)
        columns = {
            key: pa.array(wrench_of(episode).tolist(), kind or pa.list_(pa.float32(), 6)),
            "observation.state": pa.array([[0.0, 1.0]] * length, pa.list_(pa.float32())),
            "phase": frames // 10,
            "timestamp": pa.array((frames / FPS).astype("f4")),
            "frame_index": frames,
            "episode_index": np.full(length, episode),
        }
        parts.append(change(pa.table(columns)))
    if version == "v3.0":
        files = {"chunk-000/file-000": pa.concat_tables(parts[:2]), "chunk-000/file-001": parts[2]}
    else:
        files = {f"chunk-000/episode_{k:06d}": part for k, part in enumerate(parts)}
    for name, table in files.items():
        path = folder / "data" / f"{name}.parquet"
        path.parent.mkdir(parents=True, exist_ok=True)
        pq.write_table(table, path, row_group_size=13)
    return folder


@pytest.mark.parametrize("version", ["v2.1", "v3.0"])
@pytest.mark.parametrize("kind", [pa.list_(pa.float32(), 6), pa.list_(pa.float32()), pa.large_list(pa.float64())])
@pytest.mark.parametrize("names", [WRENCH, {"axes": WRENCH}, None, ["force_x", "Force Y", "fz [N]", "tx", "ty", "tz"]])
def test_episodes_are_recordings(tmp_path, version, kind, names):
    found = read_lerobot_folder(write(tmp_path / "insert", version=version, kind=kind, names=names))
    assert [r.name for r in found] == [f"insert, episode {k}" for k in range(3)]
    assert [r.trial for r in found] == ["0", "1", "2"]
    for episode, recording in enumerate(found):
        assert recording.channels == tuple(WRENCH)
        np.testing.assert_array_equal(recording.values, wrench_of(episode))
        np.testing.assert_array_equal(recording.time, np.arange(LENGTHS[episode]) / FPS)
        np.testing.assert_array_equal(recording.phases, np.arange(LENGTHS[episode]) // 10)


@pytest.mark.parametrize("key", ["observation.environment_state", "observation.wrench"])
def test_the_usual_features_are_found(tmp_path, key):
    assert read_lerobot_folder(write(tmp_path, key=key))[0].channels == tuple(WRENCH)


def test_the_user_names_feature_channels_and_phase(tmp_path):
    names = ["a", "b", "c", "d", "e", "f [mm]"]
    write(tmp_path, key="observation.ft", names=names)
    found = read_lerobot_folder(
        tmp_path, feature="observation.ft", columns=["fz=c:mN", "depth=f [mm]"], phase_column="episode_index"
    )
    assert found[1].channels == ("fz", "depth")
    np.testing.assert_allclose(found[1].values, wrench_of(1)[:, [2, 5]].astype(float) * 1e-3)
    assert set(found[2].phases) == {2}


def with_wrenches(kind, *last):
    """A data set in which the last wrenches of an episode are others."""
    return {
        "change": lambda t: t.set_column(0, "observation.wrench", pa.array([[1.0] * 6] * (len(t) - 1) + [*last], kind))
    }


REFUSED = {
    "version": ({"version": "v1.6"}, {}, "info.json: version 'v1.6' of the format, expected v2.1 or v3.0"),
    "fps": ({"fps": 0}, {}, "info.json: fps is 0, expected a positive number"),
    "features": ({"features": [1]}, {}, "info.json: 'features' is no object of objects"),
    "no feature": ({}, {"feature": "a"}, ": no feature 'a'; features are ['observation.wrench', 'observation.state'"),
    "no forces": (
        {"key": "observation.ft"},
        {},
        ": no feature with forces; features are ['observation.ft', 'observation.state'",
    ),
    "image": (
        {},
        {"feature": "observation.images.top"},
        "'observation.images.top' has shape [480, 640, 3], expected one",
    ),
    "names": ({"names": ["fx"]}, {}, "'observation.wrench' has names ['fx'], expected 6 texts"),
    "time": ({"names": ["time", *WRENCH[1:]]}, {}, "has a number called 'time', which is taken"),
    "missing": (
        with_wrenches(pa.list_(pa.float32()), None),
        {},
        "column 'observation.wrench' has lists of ['6', 'None'] numbers, expected 6",
    ),
    "short": (
        with_wrenches(pa.list_(pa.float32()), [1.0] * 5),
        {},
        "column 'observation.wrench' has lists of ['5', '6'] numbers, expected 6",
    ),
    "no list": (
        {"change": lambda t: t.set_column(0, "observation.wrench", pa.array([0.0] * len(t), pa.float32()))},
        {},
        "column 'observation.wrench' has type float, expected lists of 6 numbers",
    ),
    "texts": (
        {"change": lambda t: t.set_column(0, "observation.wrench", pa.array([["a"] * 6] * len(t)))},
        {},
        "column 'observation.wrench' has type list<element: string>, expected lists of 6 numbers",
    ),
    "no column": ({"change": lambda t: t.drop_columns("frame_index")}, {}, "no column ['frame_index']; columns are"),
    "two columns": (
        {"change": lambda t: t.append_column("phase", t["phase"])},
        {},
        "columns ['phase'] occur more than",
    ),
    "nested phase": ({}, {"phase_column": "observation.ft"}, "no column 'observation.ft'; columns are"),
    "phase": ({}, {"phase_column": "observation.images.top"}, "no column ['observation.images.top']"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_wrong_data_set_is_refused(tmp_path, name):
    written, options, message = REFUSED[name]
    write(tmp_path, **written)
    with pytest.raises(ValueError, match=f"^{re.escape(str(tmp_path))}.*{re.escape(message)}"):
        read_lerobot_folder(tmp_path, **options)


@pytest.mark.parametrize("version", ["v2.1", "v3.0"])
def test_missing_episodes_are_named(tmp_path, version):
    write(tmp_path, version=version, total_frames=75, total_episodes=3)
    assert len(read_lerobot_folder(tmp_path)) == 3
    min((tmp_path / "data").glob("*/*.parquet")).unlink()
    found, lost = (1, "'0', '1'") if version == "v3.0" else (2, "'0'")
    message = f": {found} episodes in the data, but meta/info.json declares 3; missing: [{lost}]"
    with pytest.raises(ValueError, match=f"^{re.escape(str(tmp_path) + message)}$"):
        read_lerobot_folder(tmp_path)


DECLARED = {  # in info.json, and what the message says
    "too few episodes": ({"total_episodes": 2}, "3 episodes in the data, but meta/info.json declares 2$"),
    "too many": ({"total_episodes": 5}, "3 episodes in the data, .* declares 5; missing: \\['3', '4'\\]"),
    "an enormous number": ({"total_episodes": 10**15}, ".* declares 1000000000000000; missing: "),
    "frames": ({"total_frames": 80}, "75 frames in the data, but meta/info.json declares 80$"),
    "no number": ({"total_frames": "75"}, "75 frames in the data, but meta/info.json declares '75'$"),
    "truth": ({"total_episodes": True}, "3 episodes in the data, but meta/info.json declares True$"),
}


@pytest.mark.parametrize("name", DECLARED)
def test_a_data_set_that_declares_something_else_is_refused(tmp_path, name):
    info, message = DECLARED[name]
    write(tmp_path, **info)
    with pytest.raises(ValueError, match=f"^{re.escape(str(tmp_path))}: {message}"):
        read_lerobot_folder(tmp_path)


@pytest.mark.parametrize(
    ("column", "values", "expected"),
    [
        ("phase", pa.array([{"id": 1}] * 30), "type struct<id: int64>, expected single values"),
        ("phase", pa.array([[1]] * 30), "type list<element: int64>, expected single values"),
        ("frame_index", pa.array(["1"] * 30), "type string, expected numbers"),
        ("episode_index", pa.array([[0]] * 30), "type list<element: int64>, expected numbers"),
    ],
)
def test_columns_of_other_types_are_refused(tmp_path, column, values, expected):
    def changed(table):
        return table.set_column(table.schema.get_field_index(column), column, values[: len(table)])

    write(tmp_path, change=changed)
    with pytest.raises(ValueError, match=rf"file-000\.parquet: column '{column}' has {re.escape(expected)}"):
        read_lerobot_folder(tmp_path)


def test_missing_and_damaged_files_are_refused(tmp_path):
    with pytest.raises(ValueError, match=r"info\.json: no such file; expected a data set of LeRobot"):
        read_lerobot_folder(tmp_path)
    write(tmp_path)
    for path in (tmp_path / "data" / "chunk-000").iterdir():
        path.unlink()
    with pytest.raises(ValueError, match=r"0 files data/chunk-\*/\*\.parquet, expected 1 to"):
        read_lerobot_folder(tmp_path)
    (tmp_path / "meta" / "info.json").write_text("{")
    with pytest.raises(ValueError, match=r"info\.json: damaged"):
        read_lerobot_folder(tmp_path)
