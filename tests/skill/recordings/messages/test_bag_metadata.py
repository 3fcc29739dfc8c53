"""What a rosbag2 declares of itself is compared with what is there."""

import re

import pytest
import yaml

from skill.recordings.reading import read_recordings
from tests.skill.recordings.messages.wrench_messages import check_series, series, write_db3, write_mcap

WRITERS = {"mcap": write_mcap, "db3": write_db3}


@pytest.fixture(params=WRITERS)
def bag(request, tmp_path):
    """A folder of three parts, and what it declares."""
    if request.param == "mcap":
        pytest.importorskip("mcap")
    messages, names = list(series()), [f"bag_{k}.{request.param}" for k in range(3)]
    for k, name in enumerate(names):
        WRITERS[request.param](tmp_path / name, [*messages[20 * k : 20 * k + 20], ("/camera", messages[0][1], b"a")])
    topics = [
        {"topic_metadata": {"name": name, "type": kind, "serialization_format": "cdr"}, "message_count": count}
        for name, kind, count in (("/ft", "geometry_msgs/msg/WrenchStamped", 50), ("/camera", "any", 3))
    ]
    information = {
        **{"version": 5, "message_count": 53, "topics_with_message_count": topics},
        **{"duration": {"nanoseconds": 490_000_000}, "relative_file_paths": names},
    }
    return tmp_path, information


def declare(folder, information):
    (folder / "metadata.yaml").write_text(yaml.safe_dump({"rosbag2_bagfile_information": information}))


def refused(folder, *texts):
    with pytest.raises(ValueError, match=re.escape(str(folder))) as error:
        read_recordings(folder)
    assert "\n" not in str(error.value)
    for text in (*texts, "ros2 bag reindex"):
        assert text in str(error.value)


def test_a_bag_that_has_what_it_declares_is_read(bag):
    folder, information = bag
    declare(folder, information)
    check_series(read_recordings(folder)[0])
    declare(
        folder, information | {"relative_file_paths": [f"old/{p}.zstd" for p in information["relative_file_paths"]]}
    )
    check_series(read_recordings(folder)[0])  # its parts were unpacked


@pytest.mark.parametrize("lost", [[0], [1], [2], [0, 2]])
def test_missing_parts_are_named(bag, lost):
    folder, information = bag
    declare(folder, information)
    names = [information["relative_file_paths"][k] for k in lost]
    for name in names:
        (folder / name).unlink()
    refused(folder, f"{3 - len(lost)} files, but metadata.yaml declares 3; missing: {names}")


def test_a_part_of_another_bag_is_named(bag):
    folder, information = bag
    last = information["relative_file_paths"].pop()
    declare(folder, information)
    refused(folder, f"3 files, but metadata.yaml declares 2; not declared: ['{last}']")


@pytest.mark.parametrize(("declared", "text"), [(57, "7 are missing"), (49, "1 are too many"), (0, "50 are too many")])
def test_another_number_of_messages_is_refused(bag, declared, text):
    folder, information = bag
    information["topics_with_message_count"][0]["message_count"] = declared
    declare(folder, information)
    refused(folder, f"50 messages of topic '/ft', but metadata.yaml declares {declared}; {text}")


def test_another_duration_is_refused(bag):
    folder, information = bag
    information["duration"]["nanoseconds"] = 60 * 10**9
    declare(folder, information)
    refused(folder, "its messages last 0.49 s, but metadata.yaml declares 60 s")


@pytest.mark.parametrize(
    "text",
    ["rosbag2_bagfile_information:", "rosbag2_bagfile_information: [1", "a: &a [*a]\nrosbag2_bagfile_information: 3"],
)
def test_damaged_metadata_are_refused(bag, text):
    folder, _ = bag
    (folder / "metadata.yaml").write_text(text)
    refused(folder, "metadata.yaml: damaged (")


def test_metadata_of_something_else_declare_nothing(bag):
    folder, _ = bag
    (folder / "metadata.yaml").write_text("operator: somebody\n")
    check_series(read_recordings(folder)[0])
