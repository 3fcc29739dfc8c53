import json
import math
from dataclasses import replace

import pytest

from skill.policy.query_state import QueryState, read_query_states
from tests.query_states import QUERY_STATE


def test_query_states_are_read_as_they_were_written(tmp_path):
    path = tmp_path / "asked.json"
    path.write_text(json.dumps([QUERY_STATE.record(), replace(QUERY_STATE, trial=4).record()]))
    assert read_query_states(path) == [QUERY_STATE, replace(QUERY_STATE, trial=4)]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("[]", "expected a list with at least one query state"),
        ("{}", "expected a list with at least one query state"),
        ("[3]", "a query state is int, expected an object with"),
        ('[{"trial": 1}]', r"a query state is \['trial'\], expected an object with"),
        ("[", "Expecting value"),
        ("[" * 100_000, "no query states of this program"),
    ],
)
def test_a_file_without_query_states_is_one_error(tmp_path, content, message):
    path = tmp_path / "asked.json"
    path.write_text(content)
    with pytest.raises(ValueError, match=message) as error:
        read_query_states(path)
    assert str(error.value).startswith(str(path))


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("depth", "deep", "depth is 'deep', expected a finite number"),
        ("depth", math.nan, "depth is nan, expected a finite number"),
        ("friction", True, "friction is True"),
        ("tilt", [0.1], "expected two numbers in rad"),
        ("tilt", [0.1, None], "tilt is None, expected a finite number"),
        ("state", 3, "state is 3, expected a text"),
    ],
)
def test_a_query_state_with_a_wrong_field_is_named(field, value, message):
    with pytest.raises(ValueError, match=message):
        QueryState.from_record(QUERY_STATE.record() | {field: value})


def test_a_missing_file_of_query_states_says_how_to_make_one(tmp_path):
    with pytest.raises(ValueError, match=r"no such file; `haptic-skill correct --ask --json"):
        read_query_states(tmp_path / "asked.json")
