"""The file of a skill: what it holds, that a loaded skill acts identically, and which files are refused."""

import io
import json
import re
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
from sklearn.linear_model import LinearRegression

from skill.clustering.competitive_agglomeration import CompetitiveAgglomeration
from skill.features.contact_features import ContactFeatures
from skill.features.wrench_features import MEASURED, CanonicalFeatures, RawFeatures
from skill.manipulation_skill import ManipulationSkill
from skill.regression.locally_weighted_regression import LWRegressor
from skill.skill_file import SKILL_VERSION
from tests.trajectories import GEOMETRY, make_demonstration

ROOT = Path(__file__).resolve().parents[2]

ACT = """
import json, sys
import numpy as np
from pathlib import Path
from skill.manipulation_skill import ManipulationSkill
assert "pydrake" not in sys.modules
skill = ManipulationSkill.load(Path(sys.argv[1]))
belief = np.full(skill.n_states, 1 / skill.n_states)
out = []
for row in np.load(sys.argv[2]):
    for action in (skill.act(row), skill.act(row, belief)):
        out.append([v.hex() for v in (*map(float, action.turn), action.feed, *map(float, action.probabilities))])
print(json.dumps(out))
"""


@pytest.fixture(scope="module")
def rows(demonstrations):
    """(n, 7), measurements from free air to the bottom."""
    return np.vstack([d.samples[list(MEASURED)].to_numpy()[::6] for d in demonstrations])


@pytest.fixture(scope="module")
def made_up_skill():
    """A skill from synthetic trajectories, with one state; quick to fit."""
    demonstrations = [make_demonstration(tilt=0.04 + 0.01 * k, direction=k) for k in range(2)]
    parts = {"states": CompetitiveAgglomeration(m_init=1), "regressor": LWRegressor(bandwidth=0.7)}
    return ManipulationSkill(**parts, still=1e-5, random_state=3).fit(demonstrations)


def acted(skill, rows):
    """Actions and probabilities with and without given states, as exact texts."""
    belief = np.full(skill.n_states, 1 / skill.n_states)
    return [
        [v.hex() for v in (*map(float, a.turn), a.feed, *map(float, a.probabilities))]
        for row in rows
        for a in (skill.act(row), skill.act(row, belief))
    ]


def error_message(path):
    """The message with which a file is refused; one line that names the file."""
    with pytest.raises(ValueError, match=re.escape(str(path))) as caught:
        ManipulationSkill.load(path)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def copied(skill_file, path, change):
    """A copy of a skill file whose arrays went through ``change``."""
    with np.load(skill_file) as stored:
        arrays = dict(stored)
    change(arrays)
    np.savez(path, **arrays)
    return path


def header_of(arrays):
    return json.loads(arrays["header"].tobytes())


def with_header(change):
    """A change of arrays that applies ``change`` to the header."""

    def changed(arrays):
        header = header_of(arrays)
        header = change(header) or header
        arrays["header"] = np.frombuffer(json.dumps(header).encode(), dtype=np.uint8)

    return changed


# --------------------------------------------------------------- round trip


def test_a_loaded_skill_acts_bit_identically(skill, skill_file, rows, tmp_path):
    path = tmp_path / "again.npz"
    skill.save(path)
    loaded = ManipulationSkill.load(path)
    assert acted(loaded, rows) == acted(skill, rows)
    assert loaded.metadata_ == skill.metadata_
    assert loaded.graph_.to_frame().equals(skill.graph_.to_frame())
    assert loaded.min_log_support_ == skill.min_log_support_


@pytest.mark.slow
def test_a_fresh_process_without_drake_acts_bit_identically(skill, skill_file, rows, tmp_path):
    np.save(tmp_path / "rows.npy", rows)
    done = subprocess.run(
        [sys.executable, "-c", ACT, str(skill_file), str(tmp_path / "rows.npy")],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == acted(skill, rows)


def test_everything_that_the_skill_consists_of_is_restored(made_up_skill, tmp_path):
    made_up_skill.name_states(["only"])
    made_up_skill.save(tmp_path / "skill.npz")
    loaded = ManipulationSkill.load(tmp_path / "skill.npz")
    made_up_skill.names_ = None
    assert loaded.state_names() == ["only"]
    assert (loaded.still, loaded.rough, loaded.force_noise, loaded.moment_noise, loaded.random_state) == (
        *(1e-5, 4e-4, 0.06, 5e-3),
        3,
    )
    assert loaded.period_ == made_up_skill.period_
    assert loaded.metadata_ == made_up_skill.metadata_ == {"demonstrations": 2, "good": 2, "geometry": GEOMETRY}
    np.testing.assert_array_equal(loaded.sources_, made_up_skill.sources_)
    assert isinstance(loaded.features_, CanonicalFeatures)
    assert loaded.state_features_.get_params() == made_up_skill.state_features_.get_params()
    np.testing.assert_array_equal(loaded.regressor_.y_, made_up_skill.regressor_.y_)
    np.testing.assert_array_equal(loaded.states_.means_, made_up_skill.states_.means_)


def test_other_features_of_this_package_are_restored_with_their_parameters(tmp_path):
    parts = {"features": RawFeatures(force_scale=7.0), "state_features": ContactFeatures(force_share=0.3)}
    states, regressor = CompetitiveAgglomeration(m_init=1), LWRegressor()
    skill = ManipulationSkill(**parts, states=states, regressor=regressor).fit([make_demonstration()])
    skill.save(tmp_path / "skill.npz")
    loaded = ManipulationSkill.load(tmp_path / "skill.npz")
    assert isinstance(loaded.features_, RawFeatures)
    assert loaded.features_.get_params() == skill.features_.get_params()
    assert isinstance(loaded.state_features_, ContactFeatures)
    assert loaded.state_features_.force_share == 0.3


# ------------------------------------------------------------------- format


def test_a_skill_file_contains_plain_arrays_and_no_pickle(skill_file):
    with zipfile.ZipFile(skill_file) as archive:
        for name in archive.namelist():
            array = np.lib.format.read_array(io.BytesIO(archive.read(name)), allow_pickle=False)
            assert array.dtype != object


def test_the_names_in_the_file_do_not_change(made_up_skill, tmp_path):
    """Files of today must load in later versions, and files of version 4 load today."""
    made_up_skill.save(tmp_path / "skill.npz")
    with np.load(tmp_path / "skill.npz") as stored:
        arrays = dict(stored)
    header = header_of(arrays)
    assert header["skill_version"] == 4
    assert list(header) == [
        *("skill_version", "parameters", "features", "state_features"),
        *("period", "metadata", "names", "least_log_support"),
    ]
    assert header["parameters"] == {
        **{"still": 1e-5, "rough": 4e-4, "force_noise": 0.06, "moment_noise": 5e-3},
        "random_state": 3,
    }
    assert header["features"][0] == "CanonicalFeatures"
    assert header["state_features"] == [
        "ContactFeatures",
        {"peg_radius": 0.01, "force_floor": 0.5, "force_share": 0.1, "play": pytest.approx(5e-5)},
    ]
    assert {"sources", "states/means", "states/covariances", "regressor/X", "regressor/y"} <= set(arrays)
    assert any(name.startswith("graph/") for name in arrays)


def test_files_without_the_parameters_of_the_clusterer_still_load(skill_file, skill, rows, tmp_path):
    def remove(arrays):
        for name in [n for n in arrays if n.startswith("states/parameters")]:
            del arrays[name]

    loaded = ManipulationSkill.load(copied(skill_file, tmp_path / "old.npz", remove))
    assert acted(loaded, rows[::5]) == acted(skill, rows[::5])


@pytest.mark.parametrize(
    ("part", "foreign", "message"),
    [
        ("regressor_", LinearRegression(), "regressor: a LinearRegression cannot be stored.*'LWRegressor'"),
        ("features_", LWRegressor(), "features: a LWRegressor cannot be stored.*'RawFeatures'"),
        ("state_features_", type("ContactFeatures", (), {})(), "state_features: a ContactFeatures cannot be stored"),
        ("states_", LWRegressor(), "states: a LWRegressor cannot be stored; expected one of .'CompetitiveAggl"),
    ],
)
def test_a_skill_with_a_foreign_part_is_not_saved(made_up_skill, tmp_path, monkeypatch, part, foreign, message):
    monkeypatch.setattr(made_up_skill, part, foreign)
    with pytest.raises(TypeError, match=message):
        made_up_skill.save(tmp_path / "skill.npz")
    assert list(tmp_path.iterdir()) == []


# ------------------------------------------------------------------ refusal


def test_a_skill_of_another_version_is_refused(skill_file, tmp_path):
    path = copied(skill_file, tmp_path / "old.npz", with_header(lambda h: h.update(skill_version=SKILL_VERSION + 1)))
    assert f"version {SKILL_VERSION + 1}, expected {SKILL_VERSION}" in error_message(path)


@pytest.mark.parametrize("share", [0.0, 0.1, 0.6, 0.999])
def test_a_truncated_skill_is_refused(skill_file, tmp_path, share):
    path = tmp_path / "cut.npz"
    data = skill_file.read_bytes()
    path.write_bytes(data[: int(share * len(data))])
    assert "not a skill file" in error_message(path)


def test_a_file_of_another_kind_is_refused(tmp_path, demonstration_folder):
    text = tmp_path / "notes.npz"
    text.write_text("peg in hole")
    assert "not a skill file" in error_message(text)
    other = tmp_path / "other.npz"
    np.savez(other, a=np.zeros(3))
    assert "not a skill file" in error_message(other)
    single = tmp_path / "single.npz"
    with single.open("wb") as stream:
        np.save(stream, np.zeros(3))
    assert "not a skill file" in error_message(single)
    assert "not a skill file" in error_message(next(demonstration_folder.glob("*.parquet")))


def test_a_header_that_is_not_a_mapping_is_refused(skill_file, tmp_path):
    path = copied(skill_file, tmp_path / "list.npz", with_header(lambda header: [4]))
    assert "not a skill file" in error_message(path)


def test_a_pickle_is_never_loaded(tmp_path):
    path = tmp_path / "evil.npz"
    np.savez(path, header=np.array([{"skill_version": 1}], dtype=object))
    assert "not a skill file" in error_message(path)


def test_the_message_for_a_missing_file_names_the_remedy(tmp_path):
    assert "train one first" in error_message(tmp_path / "nowhere.npz")


@pytest.mark.parametrize("lost", ["sources", "states/", "regressor/", "graph/"])
def test_a_skill_without_one_of_its_parts_is_refused(skill_file, tmp_path, lost):
    def lose(arrays):
        for name in [n for n in arrays if n.startswith(lost)]:
            del arrays[name]

    assert "not a complete skill file" in error_message(copied(skill_file, tmp_path / "part.npz", lose))


def test_a_skill_with_an_unknown_parameter_is_refused(skill_file, tmp_path):
    path = copied(skill_file, tmp_path / "strange.npz", with_header(lambda h: h["parameters"].update(courage=3)))
    assert "unknown parameters ['courage']" in error_message(path)


def test_a_skill_with_unknown_features_is_refused(skill_file, tmp_path):
    path = copied(skill_file, tmp_path / "strange.npz", with_header(lambda h: h.update(features=["LWRegressor", {}])))
    assert "not a complete skill file ('LWRegressor')" in error_message(path)


def test_a_failed_save_leaves_the_old_file(skill, skill_file, tmp_path, monkeypatch):
    path = tmp_path / "skill.npz"
    path.write_bytes(skill_file.read_bytes())

    def full(handle):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("skill.data.tables.os.fsync", full)
    with pytest.raises(OSError, match="No space"):
        skill.save(path)
    assert path.read_bytes() == skill_file.read_bytes()
    assert [p.name for p in tmp_path.iterdir()] == ["skill.npz"]
