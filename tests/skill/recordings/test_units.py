"""Units are read as people write them; a unit of another quantity is refused."""

import math

import pytest

from skill.recordings.units import UNITS, is_unit, unit_size

KNOWN = {  # (quantity, unit): its size, from the definitions of the units
    ("force", "N"): 1,
    ("force", "mN"): 1e-3,
    ("force", " kN "): 1e3,
    ("force", "Newtons"): 1,
    ("force", "lbf"): 0.45359237 * 9.80665,
    ("force", "klbf"): 453.59237 * 9.80665,
    ("force", "gf"): 9.80665e-3,
    ("force", "kgf"): 9.80665,
    ("torque", "Nm"): 1,
    ("torque", "N m"): 1,
    ("torque", "N·m"): 1,
    ("torque", "N*m"): 1,
    ("torque", "N.m"): 1,
    ("torque", "N-m"): 1,
    ("torque", "n_m"): 1,
    ("torque", "Newton-meters"): 1,
    ("torque", "kNm"): 1e3,
    ("torque", "kgf-cm"): 9.80665e-2,
    ("torque", "Nmm"): 1e-3,
    ("torque", "N mm"): 1e-3,
    ("torque", "mNm"): 1e-3,
    ("torque", "Ncm"): 1e-2,
    ("torque", "lbf-in"): 0.45359237 * 9.80665 * 0.0254,
    ("torque", "in-lb"): 0.45359237 * 9.80665 * 0.0254,
    ("torque", "lbf-ft"): 0.45359237 * 9.80665 * 0.3048,
    ("torque", "ozf-in"): 0.45359237 * 9.80665 * 0.0254 / 16,
    ("length", "m"): 1,
    ("length", "cm"): 1e-2,
    ("length", "MM"): 1e-3,
    ("length", "µm"): 1e-6,
    ("length", "in"): 0.0254,
    ("angle", "rad"): 1,
    ("angle", "mrad"): 1e-3,
    ("angle", "deg"): math.pi / 180,
    ("angle", "°"): math.pi / 180,
    ("time", "s"): 1,
    ("time", "Seconds"): 1,
    ("time", "ms"): 1e-3,
    ("time", "msec"): 1e-3,
    ("time", "us"): 1e-6,
    ("time", "μs"): 1e-6,
    ("time", "ns"): 1e-9,
}


@pytest.mark.parametrize(("quantity", "unit"), KNOWN)
def test_units_have_their_size(quantity, unit):
    assert unit_size(unit, quantity) == pytest.approx(KNOWN[quantity, unit], rel=1e-12)
    assert unit_size(unit) == unit_size(unit, quantity)
    assert is_unit(unit)
    assert [q for q in UNITS if is_unit(unit, q)] == [quantity]


@pytest.mark.parametrize("unit", ["", "N/m", "V", "MN", "MNm", "x", "N²", "1"])
def test_what_is_no_unit_is_refused(unit):
    assert not is_unit(unit)
    with pytest.raises(ValueError, match="is no unit of a quantity that is known; expected one of"):
        unit_size(unit)


def test_a_unit_of_another_quantity_is_refused():
    with pytest.raises(
        ValueError, match=r"'mm' is no unit of force; expected one of \['gf', 'kgf', 'klbf', 'kn', 'lbf'"
    ):
        unit_size("mm", "force")
