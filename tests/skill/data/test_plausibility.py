"""Wrong units and nonsense are refused with the likely unit; unusual devices and sizes are not."""

import numpy as np
import pytest

from models.scenario import Scenario
from models.validation import leaves
from skill.data.demonstration import ACTIONS, Demonstration
from tests.trajectories import GEOMETRY, make_demonstration

POSITIONS, FORCES, MOMENTS = ["x", "y", "z"], ["fx", "fy", "fz"], ["mx", "my", "mz"]


def scaled(samples, columns, factor):
    changed = samples.copy()
    changed[list(columns)] *= factor
    return changed


def at(samples, row, **values):
    changed = samples.copy()
    for name, value in values.items():
        changed.loc[row, name] = value
    return changed


DEGREES = 180.0 / np.pi
FAULTS = {
    "mm": (lambda s: scaled(s, POSITIONS, 1e3), ["'z'", "24.7 m", "not millimetres"]),
    "x in mm": (lambda s: scaled(s, ["x"], 1e3), ["'x'", "not millimetres"]),
    "N mm": (lambda s: scaled(s, MOMENTS, 1e3), ["moments in N m", "lever"]),
    "kN": (lambda s: scaled(s, FORCES, 1e-3), ["mx, my, mz", "lever"]),
    "mN": (lambda s: scaled(s, FORCES, 1e3 * 200), ["'fx'", "not millinewtons"]),
    "degrees": (lambda s: scaled(s, ["angle", "dangle"], DEGREES), ["angle", "not degrees"]),
    "dangle in degrees": (lambda s: scaled(s, ["dangle"], DEGREES), ["'dangle' sums up to", "not degrees"]),
    "hand in degrees": (lambda s: scaled(s, ["rx", "ry", "rz"], DEGREES), ["rx, ry", "not degrees"]),
    "hand in mm": (lambda s: scaled(s, ["ux", "uy", "uz"], 1e3), ["'uz'", "not millimetres per second"]),
    "ms": (lambda s: scaled(s, ["time"], 1e3), ["'time'", "20 s", "not milliseconds"]),
    "a step of 0.6 s": (lambda s: scaled(s, ["time"], 30.0), ["0.6 s, expected 0 to 0.5 s"]),
    "a long gap": (lambda s: s.assign(time=s["time"] + 1.1 * (s.index > 40)), ["gap of 1.12 s after", "at most 1 s"]),
    "z down": (
        lambda s: scaled(s, ["z"], -1.0),
        ["'z' ends at 24.7 mm, expected below -1", "z points out of the hole"],
    ),
    "outside at the end": (lambda s: s.iloc[:20].copy(), ["the outcome is 'inserted', but column 'z' ends at -"]),
    "a metre too deep": (lambda s: s.assign(z=s["z"] - 1.0), ["the depth in column 'z' lies between 0.997 and"]),
    "epoch": (
        lambda s: s.assign(time=s["time"] + 1.7e9),
        ["'time' since the start"],
    ),
    "a metre deep": (lambda s: at(s, 70, z=-1.0), ["'z' lies between", "1 m, expected -1 to 0.0285"]),
    "a metre beside": (lambda s: at(s, 0, x=1.5), ["'x' lies between", "1.5 m, expected -1 to 1 m"]),
    "negative angle": (lambda s: at(s, 5, angle=-1.0), ["'angle' lies between -1 and", "expected 0 to 3.142 rad"]),
    "huge angle": (lambda s: at(s, 5, angle=1e6), ["'angle' lies between", "1e+06 rad, expected 0 to 3.142 rad"]),
    "upside down": (lambda s: at(s, 5, angle=3.0), ["by 3 rad, expected at most 1.05 rad"]),
    "negative step": (lambda s: at(s, 5, dangle=-1.0), ["'dangle' over time lies between -50"]),
    "no steps": (lambda s: s.assign(dangle=0.0), ["'dangle' sums up to 0 rad"]),
    "hand too fast": (lambda s: at(s, 5, ux=1.0), ["'ux' over time lies between 0 and 50 m/s, expected -5 to 5 m/s"]),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_an_implausible_demonstration_is_refused_with_the_likely_unit(fault):
    change, parts = FAULTS[fault]
    with pytest.raises(ValueError, match=r"^demonstration: .+$") as caught:
        Demonstration(change(make_demonstration().samples), True, "inserted", {"geometry": GEOMETRY})
    assert [part for part in parts if part not in str(caught.value)] == []


def test_a_gap_may_last_25_periods_of_a_slow_recording():
    slow = scaled(make_demonstration().samples, ["time"], 10.0)  # 5 Hz
    Demonstration(slow.assign(time=slow["time"] + 4.7 * (slow.index > 40)), True, "inserted")
    with pytest.raises(ValueError, match=r"gap of 5\.1 s after row 40, expected .* at most 5 s"):
        Demonstration(slow.assign(time=slow["time"] + 4.9 * (slow.index > 40)), True, "inserted")


def test_a_peg_that_slams_may_be_inserted_after_the_last_sample():
    upright = make_demonstration().samples.assign(angle=0.0, dangle=0.0)
    samples = upright.iloc[::20].head(5).reset_index(drop=True)  # steps reach 3.5 mm
    assert samples["z"].iloc[-1] == pytest.approx(-0.009)
    Demonstration(samples, False, "inserted roughly", {"geometry": GEOMETRY})


@pytest.mark.parametrize("fault", ["mm", "N mm", "kN", "mN", "degrees", "ms", "a metre deep", "epoch"])
def test_wrong_units_are_found_without_the_sizes_too(demonstrations, fault):
    change, _ = FAULTS[fault]
    Demonstration(demonstrations[0].samples, True, "inserted")
    with pytest.raises(ValueError, match="expected"):
        Demonstration(change(demonstrations[0].samples), True, "inserted")


@pytest.mark.parametrize("outcome", ["diverged: a contact force of 1e+09 N", "failed: RuntimeError"])
def test_a_simulation_that_broke_down_may_hold_anything(outcome):
    samples = scaled(make_demonstration().samples, [*POSITIONS, *FORCES], 1e7)
    assert Demonstration(samples, False, outcome).reason == outcome


def test_a_peg_ten_times_larger_with_other_rates_and_forces_is_plausible():
    small = make_demonstration()
    lengths = [n for n in GEOMETRY if n != "facets"]
    geometry = {**GEOMETRY, **{n: 10.0 * GEOMETRY[n] for n in lengths}}
    samples = scaled(small.samples, [*POSITIONS, "ux", "uy", "uz"], 10.0)
    samples = scaled(scaled(samples, FORCES, 50.0), MOMENTS, 500.0)
    for rate in (0.2, 1.0, 5.0):  # 10 to 250 Hz
        Demonstration(scaled(samples, ["time"], 1.0 / rate), True, "inserted", {"geometry": geometry})


def test_a_small_gentle_peg_and_a_motionless_one_are_plausible():
    lengths = [n for n in GEOMETRY if n != "facets"]
    geometry = {**GEOMETRY, **{n: 0.1 * GEOMETRY[n] for n in lengths}}
    samples = scaled(make_demonstration().samples, [*POSITIONS, "ux", "uy", "uz", *FORCES], 0.1)
    Demonstration(scaled(samples, MOMENTS, 0.01), True, "inserted", {"geometry": geometry})
    still = make_demonstration().samples.assign(**dict.fromkeys([*FORCES, *MOMENTS, *ACTIONS, "dangle", "angle"], 0.0))
    Demonstration(still, False, "given up", {"geometry": GEOMETRY})


HIGHEST = {path: limits.high for path, _, limits in leaves(Scenario())}


def test_demonstrations_at_the_limits_of_a_scenario_are_plausible():
    """A scenario allows no period and no start with which its own demonstration would be refused."""
    period = HIGHEST["recorder.period"]
    made = make_demonstration()
    slow = made.samples.assign(time=period * np.arange(len(made.samples)))
    Demonstration(slow, True, "inserted", made.metadata)
    given_up = slow.assign(z=2.2 * HIGHEST["start.height"], x=HIGHEST["start.offset"], uz=0.0)
    Demonstration(given_up, False, "given up", made.metadata)
