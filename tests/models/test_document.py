"""The text of a scenario: what is refused, with which line, and how fast."""

import pytest
import yaml

from models.document import MAX_SIZE, brief, read_document, read_text
from models.scenario import SCENARIO_FOLDER, Scenario, load_scenario, parse_scenario


def test_plain_values_are_those_of_yaml():
    text = "a: {b: [1, 2.5, -.inf, 1.0e+10], c: null, d: yes, e: text, 'f': \"1e10\"}\n# a comment\ng: 1_000"
    assert read_document(text, "text") == yaml.safe_load(text)
    for path in SCENARIO_FOLDER.glob("*.yaml"):
        assert read_document(path.read_text(), "text") == yaml.safe_load(path.read_text())
    assert read_document("", "text") is read_document("# nothing", "text") is None


@pytest.mark.parametrize(
    ("text", "value"),
    [("1e10", 1e10), ("1E10", 1e10), ("-2e-3", -2e-3), ("+5e+8", 5e8), ("1.e3", 1000.0), (".5e3", 500.0)],
)
def test_numbers_with_an_exponent_are_numbers(text, value):
    found = read_document(f"x: {text}", "text")["x"]
    assert found == value
    assert type(found) is float


BAD_TEXT = {
    "a duplicate key": ("contact:\n  friction: 0.1\n  friction: 0.2", "line 3: found the key 'contact.friction' again"),
    "a tab": ("contact:\n\tfriction: 0.2", r"line 2: found character '\\t'.*spaces, not with tabs"),
    "an unknown alias": ("contact: *mine", "line 1: found undefined alias 'mine'"),
    "deep lists": ("[" * 1000, "invalid YAML: nested too deeply"),
    "a tag": ("contact: !!python/object/apply:os.system [ls]", "line 1: found the tag '.*os.system', expected plain"),
    "a long text": ("#" * (MAX_SIZE + 1), f"found more than {MAX_SIZE} characters"),
    "a control character": ("seed: \x01", "unacceptable character #x0001"),
    "two documents": ("seed: 1\n---\nseed: 2", "line 2: .*another document"),
    "an open bracket": ("contact: {friction: 0.2", "line 1: expected ',' or '}'"),
    "a list as a key": ("? [a]\n: b", "line 1: found unhashable key"),
}


@pytest.mark.parametrize(("text", "message"), BAD_TEXT.values(), ids=BAD_TEXT)
def test_a_bad_text_is_one_line_with_its_place(text, message):
    with pytest.raises(ValueError, match=f"^mine: .*{message}") as caught:
        read_document(text, "mine")
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 300


def test_aliases_and_merged_keys_are_read():
    text = "rig: &r {mount_damping: 50.0}\nsensor: {force_noise: &n [0.1, 0.1, 0.1], torque_noise: *n}"
    found = parse_scenario(text, "text")
    assert found.rig.mount_damping == 50.0
    assert found.sensor.force_noise == found.sensor.torque_noise == [0.1, 0.1, 0.1]
    assert found.sensor.force_noise is not found.sensor.torque_noise
    assert read_document("a: &a {x: 1, y: 2}\nb: {<<: *a, y: 3}", "text")["b"] == {"x": 1, "y": 3}


def test_a_file_that_is_not_utf_8_is_named_with_the_line(tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_bytes(b"seed: 1\n# f\xfcr\n")
    with pytest.raises(ValueError, match=r"mine.yaml: line 2: found byte 0xfc \(at 11\), expected text in UTF-8"):
        load_scenario(path)
    path.write_bytes("seed: 5  # µm".encode("utf-8-sig"))
    assert load_scenario(path).seed == 5


def test_a_huge_file_is_refused_without_reading_it(tmp_path):
    path = tmp_path / "mine.yaml"
    with path.open("wb") as file:
        file.truncate(10**12)  # a sparse file
    with pytest.raises(ValueError, match=f"mine.yaml: found more than {MAX_SIZE} bytes"):
        load_scenario(path)
    path.write_bytes(b"#" * MAX_SIZE)
    assert read_text(path, "mine") == "#" * MAX_SIZE
    assert load_scenario(path) == Scenario()


def test_a_long_value_is_shortened_on_one_line():
    assert brief("short") == "'short'"
    assert len(brief("x" * 1000)) <= 60
    assert len(brief([["y" * 1000] * 1000] * 1000)) < 3000
    assert "\n" not in brief("a\nb")


@pytest.mark.parametrize("number", ["010", "-017", "1:30", "+1:30:00", "0:30.5"])
def test_numbers_to_base_8_and_60_are_refused(number):
    with pytest.raises(
        ValueError, match=r"x: line 2: found '.*', which YAML reads to base 8 or 60, expected a decimal"
    ):
        read_document(f"a: 1\nb: [{number}]", "x")


@pytest.mark.parametrize(
    "text", ["0", "-0", "0.05", "10", "0x10", "'010'", "0e3", "e10", "1e1.5", "0x1e5x", "'1e10'", "--1e5"]
)
def test_decimal_numbers_and_texts_are_those_of_yaml(text):
    assert read_document(f"x: {text}", "x")["x"] == (0.0 if text == "0e3" else yaml.safe_load(text))
