"""What makes numba compile again."""

from __future__ import annotations

import os
import subprocess
import sys
from functools import cache
from pathlib import Path

import numba
import pytest

from compiled import KEPT, code_digest, compiled, compiled_within
from skill.features.measurement import load_of_components
from tests.checkout import ROOT

SOURCE = '''
"""About it."""
FACTOR = factor()
def factor():
    return 2.0
def plain():
    return 3.0
@compiled
def doubled(x):
    """Doubles."""
    return FACTOR * x
class Numbers(NamedTuple):
    one: float
    def shown(self):
        return "1"
'''


@cache
def before() -> str:
    return code_digest([SOURCE])


@pytest.mark.parametrize(
    ("old", "new"),
    [
        *(("FACTOR * x", "x * FACTOR"), ("2.0", "2.5"), ("one: float", "one: int")),
        *(("FACTOR = factor()", "FACTOR = 2.0"), ("@compiled", "@compiled_within")),
    ],
)
def test_what_compiled_code_sees_makes_a_new_digest(old: str, new: str) -> None:
    assert code_digest([SOURCE.replace(old, new)]) != before()


@pytest.mark.parametrize(
    ("old", "new"),
    [("3.0", "4.0"), ("Doubles", "Twice"), ('"1"', '"one"'), ("About", "On"), ("@compiled", "# no\n@compiled")],
)
def test_what_it_does_not_see_makes_none(old: str, new: str) -> None:
    assert code_digest([SOURCE.replace(old, new)]) == before()


@compiled
def doubled(x: int) -> int:
    return 2 * x


@compiled_within
def tripled(x: int) -> int:
    return 3 * x


def test_a_literal_and_a_number_have_one_version_and_a_part_of_a_caller_has_none() -> None:
    @numba.njit
    def found(x: int) -> int:
        return doubled(3) + doubled(4) + doubled(x) + tripled(x)

    assert found(5) == 2 * (3 + 4 + 5) + 3 * 5
    assert doubled.signatures == [(numba.int64,)]  # type: ignore[attr-defined]
    assert not tripled.signatures  # type: ignore[attr-defined]


def test_code_is_kept_by_module_and_name_for_all_checkouts() -> None:
    load_of_components(1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 0.01)
    assert list(KEPT.glob("*/measurement.load_of_components-skill.features.measurement.*.nbi"))


USE = (
    "from skill.features.measurement import load_of_components as load; print(load(3.0, 4.0, 0.0, 0.0, 0.0, 0.0, 1.0))"
)


def used_in(home: Path) -> str:
    """What a process with this home prints that uses a compiled function: 5.0, and warnings."""
    environment = {**os.environ, "HOME": str(home)}
    process = subprocess.run([sys.executable, "-c", USE], cwd=ROOT, env=environment, capture_output=True, check=True)
    assert process.stdout == b"5.0\n"
    return process.stderr.decode()


@pytest.mark.parametrize("kind", ["nbi", "nbc"])
def test_damaged_code_is_compiled_again_with_a_warning(tmp_path: Path, kind: str) -> None:
    assert used_in(tmp_path) == ""
    (kept,) = tmp_path.glob(f".cache/haptic_skill/*/measurement.load_of_components*.{kind}")
    kept.write_bytes(b"damaged")
    assert "UnpicklingError" in used_in(tmp_path)
    assert used_in(tmp_path) == ""


def test_without_a_place_for_it_code_is_compiled_again_with_one_warning(tmp_path: Path) -> None:
    (tmp_path / ".cache").write_bytes(b"")
    assert used_in(tmp_path).count("RuntimeWarning") == 1
