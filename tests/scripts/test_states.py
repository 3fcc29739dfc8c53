"""The command states, from recordings in CSV files to the page and the tables."""

import re

import numpy as np
import pandas as pd
import pytest

from tests.scripts.commands import error_line, files, invoke
from tests.state_recordings import CHANNELS, NAMES, three_contacts, write_files
from tests.states_pages import bands_of, series_of


def states(*arguments):
    done = invoke("states", *arguments)
    assert done.exit_code == 0, done.output
    return done


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    """What the command makes of three recordings: the folder and what it printed."""
    folder = tmp_path_factory.mktemp("a <b> folder")
    paths = write_files(folder)
    contents = [path.read_bytes() for path in paths]
    done = states(*paths, "--out", folder / "states.html")
    assert [path.read_bytes() for path in paths] == contents
    return folder, done.stdout


# ------------------------------------------------------------ what it writes


def test_the_page_and_a_table_beside_each_file_are_written(result):
    folder, text = result
    names = [f"insert_{k}.{kind}" for k in range(3) for kind in ("csv", "states.csv")]
    assert files(folder) == sorted([*names, "states.html"])
    assert "3 contact states in 3 recordings" in text
    assert f"{folder / 'insert_0.states.csv'} and 2 others" in text


def test_the_tables_have_the_state_of_each_sample(result):
    folder, _ = result
    order = ["reach <i>", "touch", "press"]
    for k in range(3):
        table = pd.read_csv(folder / f"insert_{k}.states.csv")
        data = three_contacts(k)
        assert list(table) == ["trial", "time", "state", "probability"]
        np.testing.assert_allclose(table["time"], data["time"])
        assert (table["state"] == data["phase"].map(order.index)).mean() > 0.97
        assert table["probability"].between(1 / 3, 1.0).all()
        assert table["trial"].isna().all()


def test_the_page_has_every_recording_with_its_states_and_phases(result):
    folder, _ = result
    page = (folder / "states.html").read_text()
    named = re.findall(r"</i> (.*?)</span>", page.split('id="legend"')[1].split("</p>")[0])
    assert named[0] == NAMES[0]
    assert re.fullmatch(r"(8|7\.9|8\.1) N along -z", named[1])
    assert re.fullmatch(r"(19|20) N along -z -x, 0\.\d+ N m about \+y", named[2])
    for k, (time, series) in enumerate(series_of(page)):
        recorded = three_contacts(k)
        assert len(time) == len(recorded)
        np.testing.assert_allclose(series["fz"], recorded["fz"], atol=0.005)
        assert [text for _, text in bands_of(page, "state")[k]] == ["0", "1", "2"]
        assert [text for _, text in bands_of(page, "phase")[k]] == ["reach &lt;i&gt;", "touch", "press"]
    assert "<b> folder" not in page
    assert "Competitive Agglomeration found " in page


def test_the_same_command_replaces_its_own_files_and_does_not_read_its_tables(result, tmp_path):
    paths = write_files(tmp_path, 2, phases=False)
    states(*paths, "--out", tmp_path / "states.html", "--seed", 5)
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    (tmp_path / ".states.html.tmp-abcdefgh").write_text("killed")
    done = states(*sorted(tmp_path.glob("*.csv")), "--out", tmp_path / "states.html", "--seed", 5)
    assert "2 tables of states among the files, not read" in done.stdout
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before
    assert "adjusted Rand index" not in done.stdout
    assert "Known phases" not in (tmp_path / "states.html").read_text()


def test_trials_units_and_rates_of_one_file(tmp_path):
    path = tmp_path / "runs.csv"
    table = pd.concat([three_contacts(k, rate=200.0).assign(part=f"p{k}") for k in range(3)])
    table = table.assign(clock=1e3 * table.pop("time"), load=table.pop("fz") / 1e3, stage=table.pop("phase"))
    table.drop(columns=["fx", "fy", "mx", "my", "mz"]).to_csv(path, index=False)
    options = ("--columns", "fz=load:kN", "--columns", "time=clock:ms", "--trial-column", "part")
    done = states(path, *options, "--phase-column", "stage", "--rate", 25, "--out", tmp_path / "states.html")
    assert "3 contact states in 3 recordings" in done.stdout
    page = (tmp_path / "states.html").read_text()
    found = series_of(page)
    assert {tuple(series) for _, series in found} == {("fz",)}
    assert min(series["fz"].min() for _, series in found) == pytest.approx(-16.5, abs=0.6)
    assert np.median(np.diff(found[0][0])) == pytest.approx(0.04)
    assert re.search(r'title="state 0: fz -?0\.\d+ N"', page)
    labels = pd.read_csv(tmp_path / "runs.states.csv")
    assert labels["trial"].unique().tolist() == ["p0", "p1", "p2"]
    assert len(labels) == sum(len(time) for time, _ in found)
    assert "<dt>--columns</dt><dd>fz=load:kN, time=clock:ms</dd>" in page
    assert "<dt>rate</dt><dd>at most 25 Hz</dd>" in page


def test_numbers_without_names_and_time_need_the_rate_of_their_rows(tmp_path):
    paths = [tmp_path / f"{k}.txt" for k in range(2)]
    for k, path in enumerate(paths):
        np.savetxt(path, three_contacts(k, rate=100.0)[list(CHANNELS)])
    line = refused(tmp_path, *paths, "--out", tmp_path / "states.html")
    remedy = line.partition(f"e.g. haptic-skill states {paths[0]} ")[2]
    assert remedy == "--columns fx,fy,fz,mx,my,mz --sampling-rate 100"
    done = states(*paths, *remedy.split(), "--out", tmp_path / "states.html")
    assert "samples at 100 Hz; a recording lasts " in done.stdout


def test_few_recordings_rates_that_differ_and_a_gap_are_mentioned(tmp_path, result):
    first, second = write_files(tmp_path, 2)
    three_contacts(1, rate=20.0).to_csv(second, index=False)
    line = refused(tmp_path, first, second, "--out", tmp_path / "states.html")
    assert "20 Hz with --columns time=time:s or 20000 Hz with --columns time=time:ms; say which" in line
    pd.concat([three_contacts(0), three_contacts(1, start=60.0)]).to_csv(first, index=False)
    done = states(first, second, "--columns", "time=time:s", "--out", tmp_path / "states.html")
    text = " ".join(done.stdout.split())
    assert "two recordings hide states in what differs between them; three or more are better" in text
    assert re.search("rates from 20 to 5[0-9.]+ Hz; --rate 20 makes them alike", text)
    assert re.search(r"insert_0.csv has a gap of 5\d.\d s, which counts as one interval; is it one recording\?", text)
    assert "two recordings hide" not in result[1]


# ------------------------------------------------------------ bad input


def refused(tmp_path, *arguments):
    """The error line of the command; no file is written or changed."""
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    line = error_line(invoke("states", *arguments))
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == before
    return line


def test_files_agree_about_orientations_beside_the_boundary_of_one_file(tmp_path):
    """By itself, a file tells a turn of 150 degrees about -z as it is, and one of 152 as 208 about +z."""
    paths = write_files(tmp_path, 3)
    for path, degrees in zip(paths, (150.0, 152.0, 150.0), strict=True):
        turn = np.radians(degrees) + 0.002 * np.random.default_rng(0).normal(size=len(pd.read_csv(path)))
        pd.read_csv(path).assign(rx=0.0, ry=0.0, rz=-turn).to_csv(path, index=False)
    states(*paths, "--out", tmp_path / "states.html")
    found = series_of((tmp_path / "states.html").read_text())
    assert len({np.sign(np.median(series["rz"])) for _, series in found}) == 1


def test_what_is_no_set_of_recordings_is_one_error_that_names_it(tmp_path):
    first, second = write_files(tmp_path, 2)
    three_contacts(1).drop(columns=["mx", "my", "mz"]).to_csv(tmp_path / "forces.csv", index=False)
    (tmp_path / "b").mkdir()
    (same_name,) = write_files(tmp_path / "b", 1)
    (tmp_path / "a.states.csv").write_text("trial,time,state,probability\n,0,0,1\n")
    for arguments, message in (
        ([first], "insert_0.csv: a single recording, expected two or more"),
        ([first, second, tmp_path / "b" / ".." / "insert_1.csv"], "given twice"),
        ([first, tmp_path / "forces.csv"], "forces.csv has the channels fx fy fz, but insert_0.csv has fx fy fz mx"),
        (
            [first, same_name, "--labels", tmp_path / "c"],
            f"states of {first} and the table of states of {same_name} are the same file",
        ),
        ([tmp_path / "a.states.csv"], "a table of states; expected recordings"),
        ([first, second, "--rate", "nan"], "expected a positive number of Hz"),
    ):
        assert message in refused(tmp_path, *arguments, "--out", tmp_path / "states.html")


@pytest.mark.parametrize("name", ["notes.html", "insert_1.states.csv"])
def test_foreign_files_are_not_replaced(tmp_path, name):
    paths = write_files(tmp_path, 2)
    if name not in {path.name for path in paths}:
        (tmp_path / name).write_text("mine\n")
    out = tmp_path / ("states.html" if name.endswith("states.csv") else name)
    line = refused(tmp_path, *paths, "--out", out)
    assert f"{name}: is another file, and is not replaced" in line
