"""Texts that mean a number, a missing value or neither, with each decimal sign."""

import math

import numpy as np
import pytest

from skill.recordings.text_numbers import is_missing, is_number, number, numbers

READ = {  # (text, decimal sign): its number
    ("1.5", "."): 1.5,
    ("1,5", ","): 1.5,
    ("-.5", "."): -0.5,
    ("3.", "."): 3,
    ("+2,5E-3", ","): 2.5e-3,
    ("1.5D+02", "."): 150,
    ("\u22121.5", "."): -1.5,
    (" 7 ", ","): 7,
    ("007", "."): 7,
    ("1,234", "."): 1234,
    ("1.234", ","): 1234,
    ("1,234", ","): 1.234,
    ("-12,345,678.5", "."): -12345678.5,
    ("1.234.567", ","): 1234567,
    ("1 234,5", ","): 1234.5,
    ("1\u00a0234\u00a0567", "."): 1234567,
    ("1\u202f234,5", ","): 1234.5,
    ("1'234.5", "."): 1234.5,
    ("1’234’567", ","): 1234567,
    ("1e999", "."): math.inf,
    ("-inf", "."): -math.inf,
    ("1.#INF", "."): math.inf,
    ("-1,#INF00", ","): -math.inf,
    ("Infinity", ","): math.inf,
}
NEITHER = [
    *(
        "x",
        "1.5.",
        "1..5",
        "--5",
        "5 N",
        "1_000",
        "0x1A",
        "True",
        "1.#J",
        "12:00",
        "2026-01-31",
        "1 2",
        "e5",
        "+",
        "٣",
        "１",
    ),
    *("0,123,456.7", "12,34,567", "1,234,56", "1,234'567", "1 234 56", "****", "NaN0", "#", "#1"),
]
MISSING = [
    *(
        "",
        " ",
        "nan",
        "NaN",
        "-nan",
        "NA",
        "N/A",
        "n/a",
        "#N/A",
        "#NV",
        "#DIV/0!",
        "#WERT!",
        "NULL",
        "null",
        "None",
        "-",
        "--",
    ),
    *(
        "1.#IND",
        "-1.#IND",
        "1.#QNAN",
        "-1.#QNAN0",
        "1.#SNAN",
        "-1.#IND00e+000",
        "-1,#IND",
        "1,#QNAN",
        "NaN(ind)",
        r"\N",
    ),
    *("-nan(ind)", "<NA>", "NaT", ".", "?"),
]


@pytest.mark.parametrize(("text", "decimal"), READ)
def test_numbers(text, decimal):
    assert number(text, decimal) == READ[text, decimal]
    assert is_number(text)
    assert not is_missing(text)
    assert np.array_equal(numbers(["0", text], decimal), [0, READ[text, decimal]])


@pytest.mark.parametrize("text", NEITHER)
@pytest.mark.parametrize("decimal", [".", ","])
def test_other_texts_are_no_numbers(text, decimal):
    assert number(text, decimal) is None
    assert not is_number(text)
    assert not is_missing(text)
    assert numbers(["0", "1", text, "x"], decimal) == 2


@pytest.mark.parametrize("text", MISSING)
@pytest.mark.parametrize("decimal", [".", ","])
def test_missing_values(text, decimal):
    assert math.isnan(number(text, decimal))
    assert is_missing(text)
    assert not is_number(text)
    assert np.array_equal(numbers(["0", text], decimal), [0, math.nan], equal_nan=True)


def test_the_other_sign_is_no_decimal_sign():
    for text in ("1.5", "0.123", "-1.2345", "1.234e5", "12345.678"):
        assert number(text, ",") is None
        assert number(text.replace(".", ","), ".") is None
        assert numbers([text], ",") == numbers([text.replace(".", ",")], ".") == 0


def test_two_numbers_in_a_text_of_two_lines_are_none():
    for decimal in (".", ","):
        assert numbers(["0", "1\n2", "3"], decimal) == 1
