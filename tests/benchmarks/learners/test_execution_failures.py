"""Execution failures: the reader, on synthetic files in the format of the data set, and the figures of these files."""

import json
import re

import numpy as np
import pytest

from benchmarks.learners.execution_failures import (
    ADDRESS,
    PUBLISHED,
    copies,
    longest_visits,
    main,
    read_problems,
    read_windows,
    statistics,
)


def windows_of(classes, seed=0):
    """Windows of whole numbers: free throughout if "normal", and else in contact from a random sample on."""
    rng = np.random.default_rng(seed)
    windows = rng.normal([0, 0, 80, 0, 0, 0], 3.0, size=(len(classes), 15, 6))
    for window, name in zip(windows, classes, strict=True):
        if name != "normal":
            window[rng.integers(5, 11) :] += [0, 60, -400, 90, 0, 0]
    return windows.round().astype(int)


def text_of(windows, classes, *, gap="\n\n\n", indent="\t"):
    """The text of a problem; by default as in the files: indented, tabs, two empty lines, no end of the last line."""
    parts = [
        "\n".join([name, *(indent + "\t".join(map(str, wrench)) for wrench in window)])
        for window, name in zip(windows, classes, strict=True)
    ]
    return gap.join(parts)


CLASSES = ["normal", "fr_collision", "normal"]


@pytest.mark.parametrize("change", [str, lambda t: t + "\n\n", lambda t: t.replace("\n", "\r\n"), str.expandtabs])
@pytest.mark.parametrize("form", [{}, {"gap": "\n\n", "indent": ""}, {"gap": "\n"}])
def test_windows_are_read_as_written(tmp_path, form, change):
    written = windows_of(CLASSES)
    (tmp_path / "lp1.data").write_bytes(change(text_of(written, CLASSES, **form)).encode())
    windows, classes = read_windows(tmp_path / "lp1.data")
    np.testing.assert_array_equal(windows, written)
    assert list(classes) == CLASSES


LINES = text_of(windows_of(CLASSES), CLASSES).split("\n")  # a class, 15 wrenches, two empty lines


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda lines: lines[:4] + lines[5:], ", line 18: 'fr_collision', expected 6 whole numbers"),
        (lambda lines: lines[:-1], ": 3 windows and 44 wrenches, expected 15 a window"),
        (lambda lines: [], ": 0 windows and 0 wrenches"),
        (lambda lines: lines[1:], ", line 1: '"),
        (lambda lines: [*lines[:3], lines[3] + "\t1", *lines[4:]], ", line 4: '"),
        (lambda lines: [*lines[:3], lines[3].rpartition("\t")[0], *lines[4:]], ", line 4: '"),
        (lambda lines: [*lines[:3], "\t1\t2\t3\t4\t5\tx", *lines[4:]], ", line 4: '1\t2\t3\t4\t5\tx', expected 6"),
        (lambda lines: [*lines[:3], "\t1\t2\t3\t4\t5\tnan", *lines[4:]], ", line 4: '1\t2\t3\t4\t5\tnan', expected 6"),
        (lambda lines: [*lines[:16], lines[3], *lines[16:]], ", line 17: '"),
    ],
)
def test_a_defect_names_its_line(tmp_path, change, message):
    path = tmp_path / "lp1.data"
    path.write_text("\n".join(change(LINES)))
    with pytest.raises(ValueError, match=re.escape(f"{path}{message}")):
        read_windows(path)


def test_missing_files_say_where_they_are_from(tmp_path):
    for name in ("lp1", "lp3", "lp4"):
        (tmp_path / f"{name}.data").touch()
    with pytest.raises(ValueError, match=re.escape(f"{tmp_path}: no lp2.data, lp5.data; download them from {ADDRESS}")):
        read_problems(tmp_path)


def test_copies_share_half_of_their_wrenches_in_any_order():
    one, other, third = windows_of(["a", "a", "a"])
    shifted = np.concatenate([one[7:], other[:7]])  # 8 of 15 are of the first, 7 of the second
    mixed = np.concatenate([other[:5], one[:5], third[:5]])
    groups = copies(np.array([one, other, one[::-1], shifted, third, mixed]))
    assert len(set(groups)) == 4
    assert groups[0] == groups[2] == groups[3]


def test_longest_visits():
    states = np.array([[0, 0, 1, 0, 0, 0], [2, 2, 1, 1, 2, 1]])
    np.testing.assert_array_equal(longest_visits(states[:, :, None] == np.arange(4)), [[3, 1, 0, 0], [0, 2, 2, 0]])


def test_statistics_are_those_of_the_channels():
    window = np.arange(90.0).reshape(1, 15, 6)
    found = statistics(window).reshape(4, 6)
    np.testing.assert_allclose(
        found, [42 + np.arange(6), np.full(6, 6 * np.sqrt(56 / 3)), np.arange(6), np.arange(84, 90)]
    )


@pytest.mark.slow
def test_figures_of_problems_whose_classes_are_states(tmp_path, capsys):
    classes = ["normal", "collision"] * 10
    for seed, name in enumerate(PUBLISHED):
        windows = windows_of(classes, seed)
        windows[2] = windows[0][::-1]  # a copy
        (tmp_path / f"{name}.data").write_text(text_of(windows, classes))
    main(tmp_path, repeats=1, json=tmp_path / "figures.json")
    figures = json.loads((tmp_path / "figures.json").read_text())
    assert list(figures["problems"]) == list(PUBLISHED)
    for row in figures["problems"].values():
        assert (row["windows"], row["copies"], row["classes"], row["majority"]) == (20, 1, 2, 0.5)
        for name in ("statistics", "states", "components"):
            assert row[name]["accuracy"] == 1.0
            assert row[name]["interval"] == [pytest.approx(1 / (1 + 1.96**2 / 20), abs=1e-4), 1.0]
    assert "lp5" in capsys.readouterr().out
