"""Results of trials as rows of results.json, and back."""

import json
import math
from dataclasses import asdict, replace

import pytest

from experiments.trial.trial_result import TrialResult
from scripts.practise import exact_result
from skill.data.outcome import Outcome
from systems.law.faults import Fault
from tests.trial_results import PLAIN

RESULT = replace(
    PLAIN,
    seed=17,
    tilt=(0.0123456, -0.0345678),
    time=2.54321,
    depth=0.0246789,
    peak_axial_force=6.1234,
    peak_lateral_force=12.3456,
    peak_moment=0.123456,
    penetration=20.1234e-6,
    peak_contact_force=15.1234,
    mean_load=8.1234,
    force_above_20n=0.1236,
    wedged_time=0.1604,
    path_length=0.02775678,
    mean_jerk=4.5678,
    field_score=99.2549,
    unknown_time=0.126,
    unsupported_time=0.333,
    lost_steps=3,
    back_offs=2,
)
ENDINGS = [
    (Outcome.INSERTED, Fault.NONE, ""),
    (Outcome.TIME_OVER, Fault.NONE, ""),
    (Outcome.DIVERGED, Fault.NONE, "a contact force of 1e+09 N"),
    (Outcome.FAILED, Fault.NONE, "RuntimeError: [/x]: broke"),
    *((Outcome.FAULT, fault, detail) for fault in Fault if fault is not Fault.NONE for detail in ("", "at 3: N")),
]


@pytest.mark.parametrize(("outcome", "fault", "detail"), ENDINGS)
def test_a_row_gives_back_the_rounded_result(outcome, fault, detail):
    result = replace(RESULT, outcome=outcome, fault=fault, detail=detail)
    found = TrialResult.from_record(result.record())
    assert found.record() == result.record()
    assert (found.outcome, found.fault, found.detail, found.states) == (outcome, fault, detail, RESULT.states)
    assert found.tilt == pytest.approx(result.tilt, abs=math.radians(0.005))
    assert found.depth == pytest.approx(result.depth, abs=5e-6)
    assert found.penetration == pytest.approx(result.penetration, abs=5e-8)


def test_every_rounded_row_is_kept_exactly():
    for k in range(2000):
        lengths = {"depth": 1.234e-5 * k, "penetration": 1.234e-7 * k, "path_length": 1.7e-5 * k}
        result = replace(RESULT, tilt=(1e-5 * k, -2e-5 * k), **lengths)
        assert TrialResult.from_record(result.record()).record() == result.record()


def test_an_exact_result_is_kept_in_full_precision():
    result = replace(RESULT, outcome=Outcome.FAULT, fault=Fault.SENSOR_STUCK)
    assert exact_result(json.loads(json.dumps(asdict(result)))) == result


@pytest.mark.parametrize(
    "row",
    [
        {},
        {k: v for k, v in RESULT.record().items() if k != "depth_mm"},
        RESULT.record() | {"tilt_deg": 3.0},
        RESULT.record() | {"tilt_deg": [1.0]},
        RESULT.record() | {"states": None},
        RESULT.record() | {"reason": None},
        RESULT.record() | {"depth_mm": "deep"},
        RESULT.record() | {"physics": "yes"},
        RESULT.record() | {"peak_load_n": "high"},
        RESULT.record() | {"peak_contact_n": None},
    ],
)
def test_a_row_that_is_not_a_result_is_one_error(row):
    with pytest.raises(ValueError, match="not the result of a trial"):
        TrialResult.from_record(row)


def test_the_record_is_in_the_units_of_its_keys_and_rounded():
    assert RESULT.record() == {
        "seed": 17,
        "tilt_deg": [0.7074, -1.9806],
        "inserted": True,
        "reason": "inserted",
        "time_s": 2.543,
        "depth_mm": 24.68,
        "peak_axial_n": 6.1,
        "peak_lateral_n": 12.3,
        "peak_moment_nm": 0.123,
        "penetration_um": 20.1,
        "peak_contact_n": 15.1,
        "peak_load_n": 16.0,
        "mean_load_n": 8.12,
        "seconds_above_20n": 0.25,
        "first_touch_ns": 0.125,
        "peak_measured_load_n": 15.5,
        "force_above_20n_s": 0.124,
        "wedged_s": 0.16,
        "path_mm": 27.76,
        "jerk_ms3": 4.57,
        "field_score": 99.25,
        "physics": "trusted",
        "steps": 20,
        "lost_steps": 3,
        "back_offs": 2,
        "unknown_s": 0.13,
        "unsupported_s": 0.33,
        "states": [0, 1, 2, 3],
    }


@pytest.mark.parametrize(
    ("change", "inserted", "reason"),
    [
        ({}, True, "inserted"),
        ({"outcome": Outcome.DIVERGED, "detail": "RuntimeError: x"}, False, "diverged: RuntimeError: x"),
        ({"outcome": Outcome.FAULT, "fault": Fault.MOTOR_STALLED}, False, "motor stalled"),
        (
            {"outcome": Outcome.FAULT, "fault": Fault.CONTROLLER_FAILED, "detail": "KeyError: 'a'"},
            False,
            "controller failed: KeyError: 'a'",
        ),
    ],
)
def test_the_reason_names_outcome_fault_and_detail(change, inserted, reason):
    result = replace(PLAIN, **change)
    assert result.inserted is inserted
    assert result.reason == reason


def test_a_row_tells_physics_that_is_not_trusted():
    row = replace(RESULT, trusted=False).record()
    assert row["physics"] == "not trusted"
    assert TrialResult.from_record(row).trusted is False
