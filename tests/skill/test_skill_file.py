"""The file of a skill: what it holds, that a loaded skill acts identically, and which files are refused."""

import json
import re

import numpy as np
import pytest
from sklearn.linear_model import LinearRegression

from skill.clustering.competitive_agglomeration import CompetitiveAgglomeration
from skill.features.contact_features import ContactFeatures
from skill.features.wrench_features import RawFeatures
from skill.manipulation_skill import ManipulationSkill
from skill.regression.locally_weighted_regression import LWRegressor
from skill.skill_file import PARAMETERS, SKILL_VERSION
from tests.crafted_files import sealed_arrays
from tests.skill.acting import acted
from tests.trajectories import GEOMETRY, make_demonstration


@pytest.fixture(scope="module")
def made_up_skill():
    """A skill from synthetic trajectories, with one state; quick to fit."""
    demonstrations = [make_demonstration(tilt=0.04 + 0.01 * k, direction=k) for k in range(2)]
    parts = {"states": CompetitiveAgglomeration(m_init=1), "regressor": LWRegressor(bandwidth=0.7)}
    parts |= {"features": RawFeatures(force_scale=7.0), "state_features": ContactFeatures(force_share=0.3)}
    return ManipulationSkill(**parts, still=1e-5, random_state=3).fit(demonstrations)


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
    path.write_bytes(sealed_arrays(arrays))
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


def test_everything_that_the_skill_consists_of_is_restored(made_up_skill, tmp_path):
    made_up_skill.name_states(["only"])
    made_up_skill.save(tmp_path / "skill.npz")
    loaded = ManipulationSkill.load(tmp_path / "skill.npz")
    made_up_skill.names_ = None
    assert loaded.state_names() == ["only"]
    assert [getattr(loaded, name) for name in PARAMETERS] == [getattr(made_up_skill, name) for name in PARAMETERS]
    assert loaded.period_ == made_up_skill.period_
    geometry = {**GEOMETRY, "section": "round", "corners": [], "mates": []}
    assert loaded.metadata_ == {"demonstrations": 2, "good": 2, "geometry": geometry, "clocking": False}
    np.testing.assert_array_equal(loaded.sources_, made_up_skill.sources_)
    for part in ("features_", "state_features_"):
        assert type(getattr(loaded, part)) is type(getattr(made_up_skill, part))
        assert getattr(loaded, part).get_params() == getattr(made_up_skill, part).get_params()


# ------------------------------------------------------------------- format


def test_the_names_in_the_file_do_not_change(made_up_skill, tmp_path):
    """Files of today must load in later versions."""
    made_up_skill.save(tmp_path / "skill.npz")
    with np.load(tmp_path / "skill.npz") as stored:
        arrays = dict(stored)
    header = header_of(arrays)
    assert header["skill_version"] == SKILL_VERSION
    assert list(header) == [
        *("skill_version", "parameters", "features", "state_features"),
        *("period", "metadata", "names", "least_log_support"),
    ]
    assert header["parameters"] == {
        **{"still": 1e-5, "rough": 4e-4, "correction_time": 0.4, "feed_time": 0.1},
        **{"force_noise": 0.06, "moment_noise": 5e-3},
        **{"policy": "imitate", "random_state": 3},
    }
    assert header["features"][0] == "RawFeatures"
    assert header["state_features"] == [
        "ContactFeatures",
        {"peg_radius": 0.01, "force_floor": 0.5, "force_share": 0.3, "play": pytest.approx(5e-5)},
    ]
    assert {"sources", "states/means", "states/covariances", "regressor/X", "regressor/y"} <= set(arrays)
    assert any(name.startswith("graph/") for name in arrays)


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
    assert f"version {SKILL_VERSION + 1}, expected {SKILL_VERSION}; train the skill again" in error_message(path)


@pytest.mark.parametrize("kind", ["empty", "text", "archive"])
def test_a_file_of_another_kind_is_refused(skill_file, tmp_path, kind):
    path = tmp_path / "other.npz"
    path.write_bytes({"empty": b"", "text": b"peg in hole", "archive": skill_file.read_bytes()[:-80]}[kind])
    assert "not a skill file of this program (no SHA-256 digest of the content" in error_message(path)


def test_the_message_for_a_missing_file_names_the_remedy(tmp_path):
    assert "train one first" in error_message(tmp_path / "nowhere.npz")


def set_array(name, change):
    """A change of arrays that replaces one of them, or an element of a copy of it."""

    def changed(arrays):
        arrays[name] = arrays[name].copy()
        replaced = change(arrays[name])
        arrays[name] = arrays[name] if replaced is None else replaced

    return changed


def put(name, place, value):
    """A change of arrays that sets one element."""
    return set_array(name, lambda array: array.__setitem__(place, value))


def part_parameters(**changes):
    return with_header(lambda h: h["state_features"][1].update(changes))


NAN, INF = float("nan"), float("inf")
DAMAGES = {
    "NaN in X": (put("regressor/X", (3, 1), NAN), "regressor: array 'X' is not finite"),
    "huge action": (put("regressor/y", (3, 1), 11.0), "regressor: array 'y' goes up to 11 rad or m"),
    "short y": (set_array("regressor/y", lambda y: y[:-1]), "regressor: array 'y' has shape"),
    "short memberships": (set_array("regressor/memberships", lambda P: P[:-1]), "array 'memberships' has shape"),
    "memberships of two": (set_array("regressor/memberships", np.ones_like), "memberships are not probabilities"),
    "bandwidth 0": (set_array("regressor/bandwidth", lambda _: np.array(0.0)), "'bandwidth' lies between 0 and 0"),
    "bandwidth text": (set_array("regressor/bandwidth", lambda _: np.array("1")), "has type <U1, expected numbers"),
    "degree 99": (set_array("regressor/degree", lambda _: np.array(99)), "'degree' lies between 99 and 99, expected 0"),
    "ridge": (set_array("regressor/ridge", lambda _: np.array(-1e-9)), "array 'ridge' lies between"),
    "neighbours 0": (set_array("regressor/n_neighbors", lambda _: np.array(0)), "'n_neighbors' is 0"),
    "kernel": (set_array("regressor/bandwidth_type", lambda _: np.array("")), "'bandwidth_type' is '', expected one"),
    "feature scale": (put("regressor/feature_scale", 0, 0.0), "'feature_scale' lies between 0"),
    "sample weight": (put("regressor/sample_weight", 0, 0.0), "'sample_weight' lies between 0"),
    "rows": (put("regressor/rows", 1, 0), "array 'rows' does not increase"),
    "rows beyond": (put("regressor/rows", -1, 10**6), "array 'rows' goes up to 1000000, expected below"),
    "single output": (set_array("regressor/single_output", lambda _: np.array(True)), "'y' has 3 outputs"),
    "unknown array": (lambda a: a.update({"regressor/zeal": np.ones(1)}), "arrays ['zeal'] are unknown"),
    "features fewer": (
        lambda a: a.update(
            {
                "regressor/X": a["regressor/X"][:, :-1].copy(),
                "regressor/feature_scale": a["regressor/feature_scale"][1:],
            }
        ),
        "regressor: number of features is",
    ),
    "outputs fewer": (set_array("regressor/y", lambda y: y[:, :2].copy()), "number of outputs is 2, expected 3"),
    "zero factors": (
        set_array("states/precision_factors", np.zeros_like),
        "'precision_factors' is not upper",
    ),
    "covariance": (put("states/covariances", (0, 0, 1), 5.0), "array 'covariances' is not symmetric"),
    "weights": (set_array("states/weights", lambda w: 0.5 * w), "array 'weights' sums to 0.5, expected 1"),
    "design effect": (set_array("states/design_effect", lambda _: np.array(0.0)), "'design_effect' lies between"),
    "negative count": (put("graph/counts", (0, 0), -1.0), "graph: array 'counts' lies between -1"),
    "other visits": (put("graph/visits", 0, 1e6), "'visits' is not the number of the transitions"),
    "phase": (put("graph/phase", 0, 2.0), "array 'phase' lies between"),
    "dwell": (put("graph/dwell_mean_s", 0, -2.0), "array 'dwell_mean_s' lies between -2"),
    "unknown dwell": (put("graph/dwell_mean_s", 0, NAN), "'dwell_mean_s' is not NaN exactly where a state has no"),
    "graph period": (set_array("graph/sample_period", lambda _: np.array(0.0)), "'sample_period' lies between"),
    "outcomes": (set_array("graph/outcomes", lambda o: o[::-1].copy()), "array 'outcomes' is"),
    "success": (set_array("graph/success", lambda _: np.array("glory")), "expected names in order with that of"),
    "another graph": (
        lambda a: a.update({n: v[:-1, :-1] for n, v in a.items() if n in ("graph/counts", "graph/sample_counts")}),
        "graph: array 'exits' has shape",
    ),
    "sources": (put("sources", (0, 0), 0.5), "sources: expected the number of a demonstration"),
    "foreign array": (lambda a: a.update({"diary": np.ones(1)}), "arrays ['diary'] are unknown"),
    "no sources": (lambda a: a.pop("sources"), "arrays ['sources'] are missing"),
    "no memberships": (
        lambda a: a.pop("regressor/memberships"),
        "regressor: array 'memberships' is missing, expected one column for each of",
    ),
    **{
        f"{name} of 1e300": (
            set_array(name, lambda v: np.full_like(v, 1e300, dtype=float)),
            f"array '{name.rpartition('/')[2]}' lies between 1e+300 and 1e+300, expected ",
        )
        for name in (
            *("sources", "states/means", "states/design_effect", "regressor/bandwidth", "regressor/ridge"),
            *("regressor/feature_scale", "regressor/X", "regressor/sample_weight", "graph/sample_period"),
        )
    },
    "dwell of 1e300": (put("graph/dwell_mean", 0, 1e300), "array 'dwell_mean' lies between"),
    "support of 1e300": (with_header(lambda h: h.update(least_log_support=1e300)), "'least_log_support' is 1e+300"),
    "peg of 1e300": (part_parameters(peg_radius=1e300), "state_features: 'peg_radius' is 1e+300, expected a positive"),
    "unknown policy": (with_header(lambda h: h["parameters"].update(policy="dream")), "'parameters' is {'still'"),
    "unknown parameter": (
        with_header(lambda h: h["parameters"].update(courage=3)),
        "'parameters' is {'still'",
    ),
    "unknown features": (
        with_header(lambda h: h.update(features=["LWRegressor", {}])),
        "(features: class 'LWRegressor', expected one of ['CanonicalFeatures',",
    ),
    "no header": (lambda a: a.pop("header"), "no header"),
    "header null": (set_array("header", lambda _: np.frombuffer(b"null", np.uint8)), "found null, expected an object"),
    "period 0": (with_header(lambda h: h.update(period=0)), "'period' is 0, expected a positive time"),
    "period text": (with_header(lambda h: h.update(period="0.02")), "'period' is '0.02', expected a positive time"),
    "period in ms": (with_header(lambda h: h.update(period=20)), "'period' is 20, expected a positive time"),
    "no period": (
        with_header(lambda h: h.pop("period") and None),
        "entries of the header ['period'] missing or unknown",
    ),
    "entry": (with_header(lambda h: h.update(mood=3)), "entries of the header ['mood'] missing or unknown"),
    "version": (with_header(lambda h: h.update(skill_version=[5])), "skill file version [5], expected"),
    "metadata": (with_header(lambda h: h.update(metadata=None)), "'metadata' is None, expected an object"),
    "no good one": (with_header(lambda h: h["metadata"].update(good=0)), "'good' is 0, expected a positive integer"),
    "geometry": (with_header(lambda h: h["metadata"].update(geometry=[])), "geometry is []"),
    "radius": (with_header(lambda h: h["metadata"]["geometry"].update(peg_radius=-1)), "peg radius -1 m"),
    "negative peg": (part_parameters(peg_radius=-0.01), "state_features: 'peg_radius' is -0.01, expected a positive"),
    "foreign setting": (part_parameters(colour=1), "state_features: parameters ['colour', 'force_floor'"),
    "features null": (with_header(lambda h: h.update(features=None)), "'features' is None, expected a class name"),
    "features of a number": (
        with_header(lambda h: h.update(features=["RawFeatures", 3])),
        "features: parameters None of RawFeatures, expected ['depth_scale',",
    ),
    "features of a list": (with_header(lambda h: h.update(features=[["a"], {}])), "features: class ['a'], expected"),
    "one name": (with_header(lambda h: h.update(names=["x"])), "header: 1 names, expected one for each of"),
    "names": (with_header(lambda h: h.update(names=[1, 2, 3])), "'names' is [1, 2, 3], expected null or a list"),
    "support": (with_header(lambda h: h.update(least_log_support=NAN)), "'least_log_support' is nan"),
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_damaged_part_is_refused_by_its_name(skill_file, tmp_path, damage):
    change, message = DAMAGES[damage]
    assert message in error_message(copied(skill_file, tmp_path / "damaged.npz", change))
