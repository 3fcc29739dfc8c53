"""Demonstrations and rig runs as logs in MCAP: what Foxglove and the tools of ROS 2 open.

Wrench and poses are messages of ROS 2, encoded in CDR by the package ``rosbags``. Contact state, commands, faults and
the outcome are JSON with a JSON Schema. All messages of a sample have its time, counted from 1970 where the recording
counts from its start.
"""

from __future__ import annotations

import io
import json
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from experiments.exact_states import UNKNOWN
from experiments.provenance import version_of
from interfaces.exports.episodes import demonstration_labels
from interfaces.reports.motion import Motion, motion_of_demonstration, motion_of_run
from models.contact_bodies import ContactLabel
from skill.arrays import Array
from skill.data.axes import AXES
from skill.data.demonstration import ACTIONS, Demonstration
from skill.data.rig_run import RigRun
from systems.law.faults import Fault

if TYPE_CHECKING:
    from rosbags.typesys.store import Typestore

WRENCH, POSE = "geometry_msgs/msg/WrenchStamped", "geometry_msgs/msg/PoseStamped"

PARTS = {WRENCH: ("Wrench", "Vector3", "Vector3"), POSE: ("Pose", "Point", "Quaternion")}
"""The type in such a message, and those of its two parts, in the package ``geometry_msgs``."""

BILLION = 1_000_000_000

FAULTS = {fault.value: fault.label for fault in Fault}

NUMBER, WHOLE, TEXT, FLAG = ({"type": kind} for kind in ("number", "integer", "string", "boolean"))

JSON_TYPES: dict[str, dict[str, dict[str, str]]] = {
    "haptic_skill.ContactState": {"number": WHOLE, "name": TEXT, "known": FLAG},
    "haptic_skill.RigCommand": {
        **dict.fromkeys(("target_pitch", "target_yaw", "target_clocking", "feed_speed", "support"), NUMBER),
        **{"back_off": FLAG, "turning": NUMBER},
    },
    "haptic_skill.HandMotion": dict.fromkeys(ACTIONS, NUMBER),
    "haptic_skill.RigState": dict.fromkeys(
        ("depth", *(f"{axis}_{count}" for axis in AXES for count in ("taken", "lost"))), NUMBER
    ),
    "haptic_skill.Fault": {"number": WHOLE, "name": TEXT},
    "haptic_skill.Outcome": {"outcome": TEXT, "success": FLAG, "result": {"type": "object"}},
}
"""Fields of the messages in JSON, in SI units."""


class _Message(NamedTuple):
    """A message at a time, ns.

    Its content is the fields of a message in JSON, or the coordinate frame of a message of ROS 2 and its numbers: force
    (N) and torque (N m); or position (m) and quaternion x y z w.
    """

    time: int
    topic: str
    kind: str
    content: Mapping[str, Any] | tuple[str, Sequence[float]]


def recording_log(recording: Demonstration | RigRun) -> tuple[bytes, Counter[str]]:
    """Returns a recording as a log: the MCAP file, and the number of messages of each topic.

    Raises:
        ModuleNotFoundError: if the package ``mcap`` or ``rosbags`` is missing.
        ValueError: if the recording has no geometry, or begins before the time 0.
    """
    from mcap.writer import Writer
    from rosbags.typesys import Stores, get_typestore

    ros = get_typestore(Stores.ROS2_HUMBLE)
    stream, counts = io.BytesIO(), Counter[str]()
    writer = Writer(stream)
    writer.start(library=f"haptic-skill {version_of('haptic-skill')}")
    schemas: dict[str, int] = {}
    channels: dict[str, int] = {}
    messages = _run_messages(recording) if isinstance(recording, RigRun) else _demonstration_messages(recording)
    for time, topic, kind, content in messages:
        schema, encoding = ("ros2msg", "cdr") if kind in PARTS else ("jsonschema", "json")
        if kind not in schemas:
            definition = ros.generate_msgdef(kind, ros_version=2)[0] if kind in PARTS else _json_schema(kind)
            schemas[kind] = writer.register_schema(kind, schema, definition.encode())
        if topic not in channels:
            channels[topic] = writer.register_channel(topic, encoding, schemas[kind])
        data = _cdr(ros, time, kind, *content) if isinstance(content, tuple) else json.dumps(content).encode()
        writer.add_message(channels[topic], log_time=time, publish_time=time, data=data)
        counts[topic] += 1
    kind = "rig_run" if isinstance(recording, RigRun) else "demonstration"
    metadata = {str(name): json.dumps(value) for name, value in recording.metadata.items()}
    writer.add_metadata("haptic_skill", {"kind": kind, **metadata})
    writer.finish()  # type: ignore[no-untyped-call]
    return stream.getvalue(), counts


def _run_messages(run: RigRun) -> Iterator[_Message]:
    samples, names = run.samples, run.metadata.get("state_names") or []
    motion = motion_of_run(run)
    times = _nanoseconds(samples["time"].to_numpy())
    fault = None
    for k, (time, row) in enumerate(zip(times, samples.to_dict("records"), strict=True)):
        yield _wrench(time, motion, k)
        for body in ("peg", "hole"):
            yield _pose(time, motion, k, body, "world")
        state = int(row["state"])
        name = names[state] if state < len(names) else str(state)
        yield _state(time, "/contact_state", state, name, known=row["known"] > 0.5)
        command = {name: row[name] for name in JSON_TYPES["haptic_skill.RigCommand"]}
        command["back_off"] = row["back_off"] > 0.5
        yield _Message(time, "/command", "haptic_skill.RigCommand", command)
        rig = {name: row[name] for name in JSON_TYPES["haptic_skill.RigState"]}
        yield _Message(time, "/rig_state", "haptic_skill.RigState", rig)
        if row["fault"] != fault:  # at the start, and where it changes
            fault = row["fault"]
            found = {"number": int(fault), "name": FAULTS.get(int(fault), "not known")}
            yield _Message(time, "/fault", "haptic_skill.Fault", found)
    # JSON has neither NaN nor infinite numbers.
    result = {name: v for name, v in run.result.items() if not (isinstance(v, float) and not np.isfinite(v))}
    reason = str(run.result.get("reason", ""))
    yield _outcome(times[-1], reason, success=bool(run.result.get("inserted")), result=result)


def _demonstration_messages(demonstration: Demonstration) -> Iterator[_Message]:
    samples = demonstration.samples
    motion = motion_of_demonstration(demonstration)
    times = _nanoseconds(samples["time"].to_numpy())
    labels = demonstration_labels(demonstration)
    motions = samples[list(ACTIONS)].to_numpy().tolist()
    for k, (time, moved) in enumerate(zip(times, motions, strict=True)):
        yield _wrench(time, motion, k)
        yield _pose(time, motion, k, "peg", "hole")
        label = int(labels[k])
        name = "not known" if label == UNKNOWN else ContactLabel(label).label
        yield _state(time, "/exact_contact", label, name, known=label != UNKNOWN)
        yield _Message(time, "/command", "haptic_skill.HandMotion", dict(zip(ACTIONS, moved, strict=True)))
    yield _outcome(times[-1], demonstration.reason, success=demonstration.good, result={})


def _cdr(ros: Typestore, time: int, kind: str, frame: str, numbers: Sequence[float]) -> bytes:
    """A message of ROS 2 with a header, in CDR."""
    stamp = ros.types["builtin_interfaces/msg/Time"](*divmod(time, BILLION))
    whole, first, second = (ros.types[f"geometry_msgs/msg/{part}"] for part in PARTS[kind])
    content = whole(first(*numbers[:3]), second(*numbers[3:]))
    message = ros.types[kind](ros.types["std_msgs/msg/Header"](stamp, frame), content)
    return bytes(ros.serialize_cdr(message, kind))


def _wrench(time: int, motion: Motion, k: int) -> _Message:
    numbers = [*motion.force[k].tolist(), *motion.moment[k].tolist()]
    return _Message(time, "/wrench", WRENCH, ("peg_tip", numbers))


def _pose(time: int, motion: Motion, k: int, body: str, frame: str) -> _Message:
    """The pose of peg or hole in a frame; for a demonstration, W is H."""
    rotation: Rotation
    rotation, position = (motion.R_WP, motion.p_WP) if body == "peg" else (motion.R_WH, motion.p_WH)
    numbers = [*position[k].tolist(), *rotation[k].as_quat(canonical=True).tolist()]
    return _Message(time, f"/{body}/pose", POSE, (frame, numbers))


def _state(time: int, topic: str, number: int, name: str, *, known: bool) -> _Message:
    return _Message(time, topic, "haptic_skill.ContactState", {"number": number, "name": name, "known": bool(known)})


def _outcome(time: int, reason: str, *, success: bool, result: Mapping[str, Any]) -> _Message:
    content = {"outcome": reason, "success": success, "result": dict(result)}
    return _Message(time, "/outcome", "haptic_skill.Outcome", content)


def _nanoseconds(times: Array) -> list[int]:
    """Time stamps (n,), s, in whole nanoseconds."""
    if times[0] < 0.0:
        raise ValueError(f"the recording begins at {times[0]:g} s, expected 0 or later: a log has no earlier time")
    found: list[int] = np.rint(times * BILLION).astype(np.int64).tolist()
    return found


def _json_schema(kind: str) -> str:
    fields = JSON_TYPES[kind]
    schema = {"title": kind, "type": "object", "properties": fields, "required": list(fields)}
    return json.dumps(schema)
