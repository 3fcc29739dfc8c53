"""Logs in MCAP, read with the reader of MCAP, the decoder of ROS 2 of the package rosbags, and our own reader."""

import io
import json
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("mcap")

from mcap.reader import make_reader
from rosbags.typesys import Stores, get_typestore
from scipy.spatial.transform import Rotation

from interfaces.exports.mcap_log import JSON_TYPES, PARTS, POSE, WRENCH, recording_log
from interfaces.reports.motion import motion_of_run
from skill.recordings.bag import read_bag
from tests.trajectories import make_demonstration, make_rig_run

RECORDINGS = {"run": make_rig_run, "demonstration": make_demonstration}


@pytest.fixture(params=RECORDINGS)
def recording(request):
    return RECORDINGS[request.param]()


def read(log):
    """The topics of a log: their schema, channel and messages."""
    data, _ = log
    topics = {}
    for schema, channel, message in make_reader(io.BytesIO(data), validate_crcs=True).iter_messages():
        topics.setdefault(channel.topic, (schema, channel, []))[2].append(message)
    return topics


def test_the_reader_of_mcap_finds_all_messages(recording):
    log = recording_log(recording)
    topics = read(log)
    assert {topic: len(messages) for topic, (_, _, messages) in topics.items()} == log[1]
    assert len(topics["/wrench"][2]) == len(recording.samples)
    summary = make_reader(io.BytesIO(log[0])).get_summary()
    assert summary.statistics.message_count == sum(log[1].values())


def test_schemas_say_how_the_messages_are_encoded(recording):
    for schema, channel, messages in read(recording_log(recording)).values():
        if schema.name in PARTS:
            assert (schema.encoding, channel.message_encoding) == ("ros2msg", "cdr")
            assert schema.data.decode().startswith("std_msgs/Header header\ngeometry_msgs/")
            continue
        assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
        definition = json.loads(schema.data)
        assert definition["properties"] == JSON_TYPES[schema.name]
        kinds = {"number": int | float, "integer": int, "string": str, "boolean": bool, "object": dict}
        for message in messages:
            content = json.loads(message.data)
            assert set(content) == set(definition["required"])
            for name, field in definition["properties"].items():
                assert isinstance(content[name], kinds[field["type"]])


@pytest.mark.parametrize("k", [0, -1])
def test_rosbags_decodes_the_first_and_last_messages(recording, k):
    types, topics, samples = get_typestore(Stores.ROS2_HUMBLE), read(recording_log(recording)), recording.samples
    row = samples.iloc[k]
    time = round(row["time"] * 1e9)
    message = types.deserialize_cdr(topics["/wrench"][2][k].data, WRENCH)
    assert message.header.frame_id == "peg_tip"
    assert message.header.stamp.sec * 10**9 + message.header.stamp.nanosec == time == topics["/wrench"][2][k].log_time
    found = [getattr(part, a) for part in (message.wrench.force, message.wrench.torque) for a in "xyz"]
    assert found == row[["fx", "fy", "fz", "mx", "my", "mz"]].tolist()
    pose = types.deserialize_cdr(topics["/peg/pose"][2][k].data, POSE)
    position, q = pose.pose.position, pose.pose.orientation
    is_run = "tip_z" in samples
    assert pose.header.frame_id == ("world" if is_run else "hole")
    assert position.z == (row["tip_z"] if is_run else row["z"])
    turn = np.zeros(3) if is_run else row[["ax", "ay", "az"]].to_numpy(dtype=float) * row["angle"]
    np.testing.assert_allclose(Rotation.from_quat([q.x, q.y, q.z, q.w]).as_rotvec(), turn, atol=1e-12)


def test_the_pose_of_the_hole_is_that_of_the_motion():
    run = make_rig_run(rig={"pivot_height": -0.002})
    types, motion = get_typestore(Stores.ROS2_HUMBLE), motion_of_run(run)
    pose = types.deserialize_cdr(read(recording_log(run))["/hole/pose"][2][7].data, POSE).pose
    np.testing.assert_array_equal([getattr(pose.position, a) for a in "xyz"], motion.p_WH[7])
    found = Rotation.from_quat([getattr(pose.orientation, a) for a in "xyzw"])
    np.testing.assert_allclose(found.as_matrix(), motion.R_WH[7].as_matrix(), atol=1e-12)


def test_the_own_reader_reads_the_wrench_back(recording, tmp_path):
    path = tmp_path / "a.mcap"
    path.write_bytes(recording_log(recording)[0])
    [found] = read_bag(path)
    np.testing.assert_array_equal(found.values, recording.samples[list(found.channels)])
    np.testing.assert_allclose(found.time, recording.samples["time"], rtol=0, atol=1e-9)


def contents(log, topic):
    return [json.loads(message.data) for message in read(log)[topic][2]]


def test_states_commands_and_the_result_of_a_run():
    run = make_rig_run()
    log = recording_log(run)
    states, names = contents(log, "/contact_state"), run.metadata["state_names"]
    assert [s["number"] for s in states] == run.samples["state"].tolist()
    assert all(s["name"] == names[s["number"]] for s in states)
    assert [c["feed_speed"] for c in contents(log, "/command")] == run.samples["feed_speed"].tolist()
    assert [c["back_off"] for c in contents(log, "/command")] == (run.samples["back_off"] > 0).tolist()
    [outcome] = contents(log, "/outcome")
    assert outcome == {"outcome": "inserted", "success": True, "result": run.result}
    [metadata] = make_reader(io.BytesIO(log[0])).iter_metadata()
    assert json.loads(metadata.metadata["geometry"]) == run.metadata["geometry"]


def test_faults_are_logged_where_they_change():
    run = make_rig_run()
    samples = run.samples.copy()
    samples.loc[40:, "fault"] = 7
    samples.loc[80:, "fault"] = 999
    log = recording_log(replace(run, samples=samples))
    names = ["none", "motor stalled", "not known"]
    assert [fault["name"] for fault in contents(log, "/fault")] == names
    times = [message.log_time for message in read(log)["/fault"][2]]
    assert times == [round(t * 1e9) for t in samples["time"].iloc[[0, 40, 80]]]


def test_the_contact_of_a_demonstration_is_exact():
    found = contents(recording_log(make_demonstration()), "/exact_contact")
    assert found[0] == {"number": 0, "name": "free", "known": True}


def test_a_recording_that_begins_before_zero_is_refused():
    demonstration = make_demonstration()
    early = replace(demonstration, samples=demonstration.samples.assign(time=demonstration.samples["time"] - 1.0))
    with pytest.raises(ValueError, match="begins at -1 s, expected 0 or later"):
        recording_log(early)
