"""Clocks, missing values and publishers of the messages of a topic, in bags of every kind alike."""

import re

import numpy as np
import pytest
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_typestore

from skill.recordings.reading import read_recordings
from tests.skill.recordings.wrench_messages import START, cdr, messages, ros1, write_bag, write_db3, write_mcap

TIME = START + np.arange(50) / 100
WRITERS = {".mcap": (write_mcap, cdr), ".db3": (write_db3, cdr), ".bag": (write_bag, ros1)}


@pytest.fixture(params=WRITERS)
def write(request, tmp_path):
    writer, encode = WRITERS[request.param]

    def write_file(*parts):
        path = tmp_path / f"a{request.param}"
        writer(path, [m for options in parts for m in messages(**options, write=encode)])
        return path

    return write_file


# ------------------------------------------------------------------ clocks


@pytest.mark.parametrize("unset", [1, 2, 30])
def test_messages_before_the_first_stamp_are_left_out_with_a_word(write, unset):
    stamps = np.where(np.arange(50) < unset, 0, TIME)
    path = write({"stamps": stamps, "logged": TIME + 0.001})
    with pytest.warns(UserWarning, match=rf"a\.\w+: topic '/ft': {unset} of 50 messages left out, .* no time stamp"):
        [found] = read_recordings(path)
    np.testing.assert_allclose(found.time, TIME[unset:], rtol=0, atol=1e-6)
    np.testing.assert_array_equal(found.values[:, 0], np.arange(unset, 50))
    [found] = read_recordings(path, columns=["time=log_time"])
    np.testing.assert_allclose(found.time, TIME + 0.001, rtol=0, atol=1e-6)


@pytest.mark.parametrize("start", [0.0, 0.5, 1e5])
def test_a_simulation_has_its_own_clock_which_may_begin_at_zero(write, start, recwarn):
    stamps, logged = start + 0.01 * np.arange(50), START + 0.02 * np.arange(50)  # at half of real time
    [found] = read_recordings(write({"stamps": stamps, "logged": logged}))
    np.testing.assert_allclose(found.time, stamps, rtol=0, atol=1e-9)
    assert not recwarn


CLOCKS = {  # stamps, and what the message says
    "simulated, then of the system": (np.where(np.arange(50) < 20, TIME - START + 3, TIME), r"jump by 1\.7e\+09 s"),
    "of the system, then simulated": (np.where(np.arange(50) < 20, TIME, TIME - START), r"jump by -1\.7e\+09 s"),
    "lost in between": (np.where(np.arange(50) == 20, 0, TIME), r"message 20 \(2 such\)"),
    "two publishers": (
        np.where(np.arange(50) % 2, TIME - START + 9, TIME),
        r"of another clock,.*message 1 \(49 such\)",
    ),
    "another time zone": (TIME + np.where(np.arange(50) < 20, 0, 3600), "jump by 3600.01"),
    "set back": (TIME - np.where(np.arange(50) < 20, 0, 0.15), r"go back from .* in message 20 \(1 such\)"),
    "played twice": (START + np.arange(50) % 25 / 100, r"go back from .* in message 25 \(1 such\)"),
    "too coarse": (START + np.arange(50) // 5 / 20, r"repeat from .* \(40 such\)"),
    "frozen": (np.full(50, TIME[0]), r"repeat from .* \(49 such\)"),
}


@pytest.mark.parametrize("name", CLOCKS)
def test_stamps_of_several_clocks_are_refused_and_the_remedy_works(write, name):
    stamps, message = CLOCKS[name]
    path = write({"stamps": stamps, "logged": TIME + 0.001})
    with pytest.raises(ValueError, match=rf"a\.\w+: topic '/ft': the header stamps .*{message}") as refused:
        read_recordings(path)
    assert "\n" not in str(refused.value)
    remedy = re.search(r"; --columns (time=\w+) takes the time of logging$", str(refused.value))[1]
    [found] = read_recordings(path, columns=[remedy])
    np.testing.assert_allclose(found.time, TIME + 0.001, rtol=0, atol=1e-6)
    np.testing.assert_array_equal(found.values[:, 0], np.arange(50))


def test_messages_that_were_logged_late_are_sorted_by_their_stamps(write, recwarn):
    logged = TIME + 0.001 + np.where(np.arange(50) % 7 == 3, 0.025, 0)
    assert (np.diff(logged) < 0).any()
    [found] = read_recordings(write({"stamps": TIME, "logged": logged}))
    np.testing.assert_allclose(found.time, TIME, rtol=0, atol=1e-6)
    np.testing.assert_array_equal(found.values[:, 0], np.arange(50))
    assert not recwarn


def test_messages_that_are_there_twice_count_once(write):
    path = write(
        {"stamps": TIME, "logged": TIME + 0.001},
        {"stamps": TIME[10:20], "logged": TIME[10:20] + 0.003, "wrenches": np.arange(10, 20)[:, None] + np.arange(6)},
    )
    with pytest.warns(UserWarning, match="10 of 60 messages left out, which have the stamp and the values of another"):
        [found] = read_recordings(path)
    np.testing.assert_array_equal(found.values[:, 0], np.arange(50))


# ----------------------------------------------------------- missing values


@pytest.mark.parametrize("gone", [[0, 1, 2], [49], [20, 21]])
def test_messages_without_values_are_left_out_with_a_word(write, gone):
    wrenches = np.arange(50)[:, None] + np.arange(6.0)
    wrenches[gone] = np.nan
    path = write({"stamps": TIME, "wrenches": wrenches})
    with pytest.warns(UserWarning, match=rf"{len(gone)} of 50 messages left out, which have no values \(NaN\)"):
        [found] = read_recordings(path)
    np.testing.assert_array_equal(found.values, np.delete(wrenches, gone, axis=0))
    np.testing.assert_allclose(found.time, np.delete(TIME, gone), rtol=0, atol=1e-6)


# --------------------------------------------------------------- publishers


@pytest.mark.parametrize("frames", [["left", "right"] * 25, ["left"] * 25 + ["right"] * 25, [""] + ["right"] * 49])
def test_messages_of_several_frames_are_refused(write, frames):
    path = write({"stamps": TIME, "frames": frames})
    with pytest.raises(
        ValueError, match=rf"messages of the frames \['{min(frames)}', 'right'\], expected those of one"
    ):
        read_recordings(path)


def test_the_frame_of_messages_that_are_left_out_does_not_count_nor_does_a_slash(write):
    frames = ["", *["ft"] * 30, *["/ft"] * 19]
    wrenches = np.arange(50)[:, None] + np.arange(6.0)
    wrenches[0] = np.nan
    with pytest.warns(UserWarning, match="no values"):
        [found] = read_recordings(write({"stamps": TIME, "frames": frames, "wrenches": wrenches}))
    assert len(found.time) == 49


def two_publishers(path, first, second):
    """Two connections of one topic, as bags of ROS 1 have them; the time of logging decides the order."""
    store = get_typestore(Stores.ROS1_NOETIC)
    with Writer(path) as writer:
        for name, part in (("/node_1", first), ("/node_2", second)):
            connection = writer.add_connection(
                "/ft", "geometry_msgs/msg/WrenchStamped", typestore=store, callerid=name, latching=0
            )
            for _, logged, data in part:
                writer.write(connection, logged, data)
    return path


def test_publishers_at_the_same_time_are_refused_and_one_after_the_other_are_not(tmp_path):
    path = two_publishers(tmp_path / "a.bag", messages(TIME, write=ros1), messages(TIME + 0.004, write=ros1))
    message = r"messages of \['/node_1', '/node_2'\] at the same time, expected one publisher"
    with pytest.raises(ValueError, match=message):
        read_recordings(path)
    path = two_publishers(tmp_path / "b.bag", messages(TIME, write=ros1), messages(TIME + 2, write=ros1))
    assert len(read_recordings(path)[0].time) == 100
