"""What makes numba compile again."""

from __future__ import annotations

from functools import cache

import pytest

from compiled import KEPT, code_digest
from skill.features.measurement import load_of_components

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
    [("FACTOR * x", "x * FACTOR"), ("2.0", "2.5"), ("one: float", "one: int"), ("FACTOR = factor()", "FACTOR = 2.0")],
)
def test_what_compiled_code_sees_makes_a_new_digest(old: str, new: str) -> None:
    assert code_digest([SOURCE.replace(old, new)]) != before()


@pytest.mark.parametrize(
    ("old", "new"),
    [("3.0", "4.0"), ("Doubles", "Twice"), ('"1"', '"one"'), ("About", "On"), ("@compiled", "# no\n@compiled")],
)
def test_what_it_does_not_see_makes_none(old: str, new: str) -> None:
    assert code_digest([SOURCE.replace(old, new)]) == before()


def test_code_is_kept_by_module_and_name_for_all_checkouts() -> None:
    load_of_components(1.0, 2.0, 3.0, 0.0, 0.0, 0.0, 0.01)
    assert list(KEPT.glob("*/measurement.load_of_components-skill.features.measurement.*.nbi"))
