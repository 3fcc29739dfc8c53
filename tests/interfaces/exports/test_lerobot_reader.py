"""From a data set back to the recordings."""

import json
import re
from dataclasses import replace

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from interfaces.exports.lerobot_reader import read_dataset
from interfaces.exports.lerobot_writer import ABOUT, HEADER, NAME
from scripts.export import export_lerobot, import_lerobot
from skill.data.demonstration import read_demonstration, write_demonstration
from skill.data.outcome import Outcome
from tests.interfaces.exports.datasets import exported, write_demonstrations, write_runs
from tests.trajectories import make_demonstration

EPISODES = "meta/episodes/chunk-000/file-000.parquet"
DATA = "data/chunk-000/file-000.parquet"


@pytest.mark.parametrize("write", [write_demonstrations, write_runs])
def test_the_recordings_come_back_byte_for_byte(tmp_path, write):
    source, dataset = exported(tmp_path, write)
    import_lerobot(dataset, tmp_path / "again")
    names = sorted(path.name for path in source.iterdir())
    assert sorted(path.name for path in (tmp_path / "again").iterdir()) == names
    for name in names:
        assert (tmp_path / "again" / name).read_bytes() == (source / name).read_bytes()


def test_failures_and_details_come_back(tmp_path):
    samples = make_demonstration().samples
    shallow = replace(make_demonstration(), samples=samples[:60], good=False, outcome=Outcome.JAMMED, detail="at 8 mm")
    write_demonstration(shallow, tmp_path / "in" / "a.parquet")
    export_lerobot(tmp_path / "in", tmp_path / "dataset")
    import_lerobot(tmp_path / "dataset", tmp_path / "out")
    found = read_demonstration(tmp_path / "out" / "a.parquet")
    assert (found.good, found.outcome, found.detail, found.metadata) == (
        False,
        Outcome.JAMMED,
        "at 8 mm",
        shallow.metadata,
    )
    np.testing.assert_array_equal(found.samples, shallow.samples)


def change_table(path, change):
    pq.write_table(change(pq.read_table(path)), path)


def change_json(path, **changes):
    path.write_text(json.dumps({**json.loads(path.read_text()), **changes}))


def without(*names):
    return lambda folder: change_table(folder / EPISODES, lambda t: t.drop_columns(list(names)))


def drop_recording(folder):
    info = json.loads((folder / "meta/info.json").read_text())
    change_json(folder / "meta/info.json", features={k: f for k, f in info["features"].items() if k != "recording"})


def set_column(name, values):
    def change(table):
        return table.set_column(table.schema.get_field_index(name), name, pa.array(values))

    return lambda folder: change_table(folder / EPISODES, change)


def single_precision(folder):
    def change(table):
        place = table.schema.get_field_index("recording")
        return table.set_column(place, "recording", table["recording"].cast(pa.list_(pa.float32(), 21)))

    change_table(folder / DATA, change)


REFUSED = {
    "no about": (lambda folder: (folder / ABOUT).unlink(), f"lacks the file {ABOUT}; expected a data set that"),
    "no header": (without(HEADER), f"lacks {NAME} and {HEADER} of the episodes"),
    "no recording": (drop_recording, "lacks the feature 'recording'"),
    "version": (lambda f: change_json(f / "meta/info.json", codebase_version="v2.1"), "version 'v2.1' of the format"),
    "about version": (lambda f: change_json(f / ABOUT, format_version=9), "version 9, kind 'demonstrations'; expected"),
    "kind": (lambda f: change_json(f / ABOUT, kind="pictures"), "kind 'pictures'; expected version 1"),
    "info": (lambda f: (f / "meta/info.json").write_text("{"), "info.json: damaged"),
    "no info": (lambda f: (f / "meta/info.json").unlink(), "info.json: no such file; expected a data set of LeRobot"),
    "no data": (lambda f: (f / DATA).unlink(), "no files data/chunk-*/*.parquet"),
    "truncated": (lambda f: (f / DATA).write_bytes((f / DATA).read_bytes()[:-9]), "not a complete Parquet file"),
    "lost frames": (lambda f: change_table(f / DATA, lambda t: t.slice(1)), "episode 0: frames are missing"),
    "lost episode": (lambda f: change_table(f / DATA, lambda t: t.slice(0, 120)), "episodes of meta and data differ"),
    "header": (set_column(HEADER, ["{"] * 3), f"episode 0: damaged {HEADER}"),
    "header of another kind": (set_column(HEADER, ['{"metadata": {}}'] * 3), "lacks ['good', 'outcome']"),
    "path": (set_column(NAME, ["../a.parquet", "b.parquet", "c.parquet"]), "episode 0: haptic_skill/name is '../a"),
    "same name": (set_column(NAME, ["a.parquet"] * 3), "episode 1: haptic_skill/name is 'a.parquet'"),
    "precision": (single_precision, "'recording' has type fixed_size_list<"),
    "implausible": (
        set_column(HEADER, ['{"good": 1.5, "outcome": "inserted", "metadata": {}}'] * 3),
        "episode 0: demonstration: 'good' is 1.5, expected true or false",
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


def test_a_foreign_data_set_names_all_that_it_lacks(tmp_path):
    _, dataset = exported(tmp_path)
    (dataset / ABOUT).unlink()
    without(HEADER, NAME)(dataset)
    drop_recording(dataset)
    with pytest.raises(
        ValueError, match=r"lacks the file .*, the feature 'recording', haptic_skill/name and .*states FOLDER"
    ):
        read_dataset(dataset)
