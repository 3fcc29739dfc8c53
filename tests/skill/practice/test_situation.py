import json
import math
from dataclasses import replace

import pytest

from skill.practice.situation import Situation, read_situations
from tests.situations import SITUATION


def test_situations_are_read_as_they_were_written(tmp_path):
    path = tmp_path / "asked.json"
    path.write_text(json.dumps([SITUATION.record(), replace(SITUATION, trial=4).record()]))
    assert read_situations(path) == [SITUATION, replace(SITUATION, trial=4)]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("[]", "expected a list with at least one situation"),
        ("{}", "expected a list with at least one situation"),
        ("[3]", "a situation is int, expected an object with"),
        ('[{"trial": 1}]', r"a situation is \['trial'\], expected an object with"),
        ("[", "Expecting value"),
        ("[" * 100_000, "no situations of this program"),
    ],
)
def test_a_file_without_situations_is_one_error(tmp_path, content, message):
    path = tmp_path / "asked.json"
    path.write_text(content)
    with pytest.raises(ValueError, match=message) as error:
        read_situations(path)
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
def test_a_situation_with_a_wrong_field_is_named(field, value, message):
    with pytest.raises(ValueError, match=message):
        Situation.from_record(SITUATION.record() | {field: value})


def test_a_missing_file_of_situations_says_how_to_make_one(tmp_path):
    with pytest.raises(ValueError, match=r"no such file; `haptic-skill recover --ask --json"):
        read_situations(tmp_path / "asked.json")
