from dataclasses import replace

import pytest

from skill.data.outcome import Outcome
from systems.control.faults import Fault
from tests.trial_results import PLAIN


def test_the_record_is_in_the_units_of_its_keys_and_rounded():
    result = replace(
        PLAIN,
        seed=17,
        tilt=(0.0123456, -0.0345678),
        time=2.54321,
        depth=0.0246789,
        peak_axial_force=6.1234,
        peak_lateral_force=12.3456,
        peak_moment=0.123456,
        penetration=20.1234e-6,
        unknown_time=0.126,
        unsupported_time=0.333,
        lost_steps=3,
        back_offs=2,
    )
    assert result.record() == {
        "seed": 17,
        "tilt_deg": [0.71, -1.98],
        "inserted": True,
        "reason": "inserted",
        "time_s": 2.543,
        "depth_mm": 24.68,
        "peak_axial_n": 6.1,
        "peak_lateral_n": 12.3,
        "peak_moment_nm": 0.123,
        "penetration_um": 20.1,
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
