import io
import json
import math
import re
import subprocess
import sys
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from sklearn.linear_model import LinearRegression

from skill.clustering.competitive_agglomeration import CompetitiveAgglomeration
from skill.features.wrench_features import MEASURED
from skill.manipulation_skill import SKILL_VERSION, ManipulationSkill

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


def acted(skill, rows):
    belief = np.full(skill.n_states, 1 / skill.n_states)
    return [
        [v.hex() for v in (*map(float, a.turn), a.feed, *map(float, a.probabilities))]
        for row in rows
        for a in (skill.act(row), skill.act(row, belief))
    ]


# --------------------------------------------------------------------- acts


def test_an_action_is_a_turn_across_the_axis_and_a_feed(skill, rows):
    for row in rows:
        action = skill.act(row)
        assert action.turn.shape == (2,)
        assert np.isfinite([*action.turn, action.feed]).all()
        assert action.probabilities.shape == (skill.n_states,)
        assert action.probabilities.sum() == pytest.approx(1.0)
        assert (action.probabilities >= 0).all()


def test_actions_stay_within_what_was_demonstrated(skill, rows, demonstrations):
    good = [d.samples for d in demonstrations if d.good]
    fastest = max(np.abs(s[["rx", "ry"]].to_numpy()).max() for s in good)
    deepest = max(np.abs(s["uz"]).max() for s in good)
    actions = [skill.act(row) for row in rows]
    assert max(np.linalg.norm(a.turn) for a in actions) < 3 * fastest
    assert max(abs(a.feed) for a in actions) < 3 * deepest
    assert np.mean([a.feed < 0 for a in actions]) > 0.6  # into the hole


def test_turned_about_the_axis_the_contact_is_answered_by_the_action_turned(skill, rows):
    angle = 1.1
    c, s = np.cos(angle), np.sin(angle)
    R = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    for row in rows[np.linalg.norm(rows[:, :2], axis=1) > 1.0][:10]:
        turned = np.concatenate([R @ row[:3], R @ row[3:6], row[6:]])
        one, other = skill.act(row), skill.act(turned)
        np.testing.assert_allclose(other.turn, R[:2, :2] @ one.turn, atol=1e-9)
        assert other.feed == pytest.approx(one.feed, abs=1e-12)
        np.testing.assert_allclose(other.probabilities, one.probabilities, atol=1e-9)


def test_the_learnt_turn_agrees_with_the_demonstrated_one_where_there_was_contact(skill, demonstrations):
    agree = []
    for d in demonstrations[:5]:
        samples = d.samples
        rows, done = samples[list(MEASURED)].to_numpy(), samples[["rx", "ry"]].shift(-1, fill_value=0.0).to_numpy()
        for row, turn in zip(rows, done, strict=True):
            if np.linalg.norm(row[:2]) > 2.0 and np.linalg.norm(turn) > 3e-4:
                agree.append(skill.act(row).turn @ turn > 0)
    assert len(agree) > 20
    assert np.mean(agree) > 0.85


def test_the_states_probabilities_are_those_of_single_measurements(skill, rows):
    np.testing.assert_allclose(
        skill.state_probabilities(rows), [skill.act(row).probabilities for row in rows], atol=1e-12
    )
    assert len(skill.state_names()) == len(set(skill.state_names())) == skill.n_states >= 2


def test_a_measurement_that_is_none_is_refused(skill, rows):
    row = rows[0].copy()
    row[2] = np.nan
    with pytest.raises(ValueError, match="fz"):
        skill.act(row)
    with pytest.raises(ValueError, match="7"):
        skill.act(row[:6])


# --------------------------------------------------------------------- fit


def test_fitting_again_gives_the_same_skill(demonstrations, skill, rows):
    again = ManipulationSkill().fit(demonstrations)
    assert acted(again, rows[::4]) == acted(skill, rows[::4])


def test_the_actions_are_those_of_the_good_demonstrations_only(skill, demonstrations):
    used = {int(n) for n in skill.sources_[:, 0]}
    assert used == {n for n, d in enumerate(demonstrations) if d.good}
    assert skill.metadata_["demonstrations"] == len(demonstrations)
    assert skill.metadata_["good"] == sum(d.good for d in demonstrations)
    assert skill.period_ == pytest.approx(0.02)


def test_where_none_is_good_there_is_nothing_to_learn(demonstrations):
    bad = [replace(d, good=False, outcome="jammed") for d in demonstrations[:2]] + [demonstrations[5]]
    with pytest.raises(ValueError, match=r"none of the 3 demonstrations.*jammed"):
        ManipulationSkill().fit(bad)


def test_no_demonstrations_are_nothing_to_learn_from_either():
    with pytest.raises(ValueError, match="none of the 0 demonstrations"):
        ManipulationSkill().fit([])


# -------------------------------------------------------------------- files


def test_a_loaded_skill_acts_as_the_saved_one_to_the_last_bit(demonstrations, skill, skill_file, rows, tmp_path):
    path = tmp_path / "again.npz"
    skill.save(path)
    assert acted(ManipulationSkill.load(path), rows) == acted(skill, rows)
    assert ManipulationSkill.load(path).metadata_ == skill.metadata_
    assert ManipulationSkill.load(path).graph_.to_frame().equals(skill.graph_.to_frame())


def test_a_fresh_process_without_drake_acts_the_same_to_the_last_bit(skill, skill_file, rows, tmp_path):
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


def test_a_skill_file_holds_plain_arrays_and_no_pickle(skill_file):
    with zipfile.ZipFile(skill_file) as archive:
        for name in archive.namelist():
            array = np.lib.format.read_array(io.BytesIO(archive.read(name)), allow_pickle=False)
            assert array.dtype != object


def refusal(path):
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


def test_a_skill_of_another_version_is_refused(skill_file, tmp_path):
    def age(arrays):
        header = header_of(arrays)
        header["skill_version"] = SKILL_VERSION + 1
        arrays["header"] = np.frombuffer(json.dumps(header).encode(), dtype=np.uint8)

    said = refusal(copied(skill_file, tmp_path / "old.npz", age))
    assert f"version {SKILL_VERSION + 1}, expected {SKILL_VERSION}" in said


@pytest.mark.parametrize("share", [0.0, 0.1, 0.6, 0.999])
def test_a_truncated_skill_is_refused(skill_file, tmp_path, share):
    path = tmp_path / "cut.npz"
    data = skill_file.read_bytes()
    path.write_bytes(data[: int(share * len(data))])
    assert "not a skill file" in refusal(path)


def test_what_is_not_a_skill_is_refused(tmp_path, demonstration_folder):
    text = tmp_path / "notes.npz"
    text.write_text("peg in hole")
    assert "not a skill file" in refusal(text)
    other = tmp_path / "other.npz"
    np.savez(other, a=np.zeros(3))
    assert "not a skill file" in refusal(other)
    single = tmp_path / "single.npz"
    with single.open("wb") as stream:
        np.save(stream, np.zeros(3))
    assert "not a skill file" in refusal(single)
    assert "not a skill file" in refusal(next(demonstration_folder.glob("*.parquet")))


def test_a_pickle_is_never_opened(tmp_path):
    path = tmp_path / "evil.npz"
    np.savez(path, header=np.array([{"skill_version": 1}], dtype=object))
    assert "not a skill file" in refusal(path)


def test_a_skill_file_that_is_not_there_says_what_to_do(tmp_path):
    assert "train one first" in refusal(tmp_path / "nowhere.npz")


@pytest.mark.parametrize("lost", ["sources", "states/", "regressor/", "graph/"])
def test_a_skill_that_lacks_a_part_is_refused(skill_file, tmp_path, lost):
    def lose(arrays):
        for name in [n for n in arrays if n.startswith(lost)]:
            del arrays[name]

    assert "skill file" in refusal(copied(skill_file, tmp_path / "part.npz", lose))


def test_a_skill_with_strange_parameters_is_refused(skill_file, tmp_path):
    def invent(arrays):
        header = header_of(arrays)
        header["parameters"]["courage"] = 3
        arrays["header"] = np.frombuffer(json.dumps(header).encode(), dtype=np.uint8)

    assert "courage" in refusal(copied(skill_file, tmp_path / "strange.npz", invent))


def test_a_save_that_fails_leaves_the_old_skill(skill, skill_file, tmp_path, monkeypatch):
    path = tmp_path / "skill.npz"
    path.write_bytes(skill_file.read_bytes())

    def full(handle):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("skill.data.tables.os.fsync", full)
    with pytest.raises(OSError, match="No space"):
        skill.save(path)
    assert path.read_bytes() == skill_file.read_bytes()
    assert [p.name for p in tmp_path.iterdir()] == ["skill.npz"]


def test_one_demonstrated_sample_in_a_hundred_has_less_than_full_support(skill):
    regressor = skill.regressor_
    found = regressor.support_between(skill.sources_[regressor.rows_, 0])
    assert np.mean(found < skill.min_log_support_) == pytest.approx(0.01, abs=1.0 / len(found))


def test_support_falls_with_the_distance_from_all_that_is_remembered(skill, demonstrations):
    """A peg far below the bottom, where none has been shown."""
    rows = demonstrations[0].samples[list(MEASURED)].to_numpy()
    assert np.mean([skill.act(row).support == 1.0 for row in rows[::10]]) > 0.8
    found = [skill.act([*rows[0, :6], z]).support for z in (0.001, -0.1, -10.0, -1e3)]
    assert found[0] == 1.0
    assert all(np.diff(found) <= 0.0)
    assert found[-1] < 1e-6


def test_support_is_stored_with_the_skill(skill, tmp_path):
    skill.save(tmp_path / "skill.npz")
    again = ManipulationSkill.load(tmp_path / "skill.npz")
    assert again.min_log_support_ == skill.min_log_support_


def test_a_regressor_that_does_not_know_its_support_claims_full_support(demonstrations):
    skill = ManipulationSkill(regressor=LinearRegression(), states=CompetitiveAgglomeration(m_init=1)).fit(
        demonstrations
    )
    assert skill.min_log_support_ == -math.inf
    assert skill.act(np.full(7, 1e3)).support == 1.0
