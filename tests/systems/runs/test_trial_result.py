"""Results of trials as rows of results.json, and back."""

import json
import math
from dataclasses import asdict, replace

import pytest

from skill.data.outcome import Outcome
from systems.control.faults import Fault
from systems.runs.trial_result import TrialResult
from systems.sessions.practice_session import exact_result

RESULT = TrialResult(
    **{"seed": 3, "tilt": (0.0123456, -0.0234567), "outcome": Outcome.INSERTED, "time": 2.51234, "depth": 0.02471234},
    **{"peak_axial_force": 6.06, "peak_lateral_force": 12.34, "peak_moment": 0.1234, "penetration": 20.06e-6},
    **{"steps": 20, "lost_steps": 1, "back_offs": 2, "unknown_time": 0.121, "unsupported_time": 0.1, "states": (0, 1)},
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
    assert (found.outcome, found.fault, found.detail, found.states) == (outcome, fault, detail, (0, 1))
    assert found.tilt == pytest.approx(result.tilt, abs=math.radians(0.005))
    assert found.depth == pytest.approx(result.depth, abs=5e-6)
    assert found.penetration == pytest.approx(result.penetration, abs=5e-8)


def test_every_rounded_row_is_kept_exactly():
    for k in range(2000):
        result = replace(RESULT, tilt=(1e-5 * k, -2e-5 * k), depth=1.234e-5 * k, penetration=1.234e-7 * k)
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
    ],
)
def test_a_row_that_is_not_a_result_is_one_error(row):
    with pytest.raises(ValueError, match="not the result of a trial"):
        TrialResult.from_record(row)
