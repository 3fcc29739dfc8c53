"""Demonstrations and rig runs as logs in MCAP: what Foxglove and the tools of ROS 2 open.

Wrench and poses are messages of ROS 2; contact state, commands, faults and the outcome are JSON with a JSON Schema. All
messages of a sample have its time, counted from 1970 where the recording counts from its start.
"""

from __future__ import annotations

import io
import json
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from experiments.exact_states import UNKNOWN
from experiments.provenance import version_of
from interfaces.exports.demonstration_episodes import contact_labels
from interfaces.exports.ros_messages import BILLION, POSE, SCHEMAS, WRENCH, stamped
from interfaces.reports.motion import Motion, motion_of_demonstration, motion_of_run
from models.contact_geometry import ContactLabel
from skill.arrays import Array
from skill.data.demonstration import ACTIONS, Demonstration
from skill.data.rig_run import CONTEXT_COLUMNS, CONTROL_COLUMNS, RigRun
from systems.control.faults import Fault

FRAMES = {"peg": "peg_tip", "hole": "hole", "world": "world"}
"""Names of the coordinate frames: P, H and W."""

FAULTS = {fault.value: fault.label for fault in Fault}

NUMBER, WHOLE, TEXT, FLAG = ({"type": kind} for kind in ("number", "integer", "string", "boolean"))

JSON_TYPES: dict[str, dict[str, dict[str, str]]] = {
    "haptic_skill.ContactState": {"number": WHOLE, "name": TEXT, "known": FLAG},
    "haptic_skill.Context": {"number": WHOLE, "probability": NUMBER, "evidence": NUMBER},
    "haptic_skill.RigCommand": {
        **dict.fromkeys(("target_pitch", "target_yaw", "feed_speed", "support"), NUMBER),
        **{"back_off": FLAG, "turning": NUMBER},
    },
    "haptic_skill.HandMotion": dict.fromkeys(ACTIONS, NUMBER),
    "haptic_skill.RigState": dict.fromkeys(("depth", "pitch_taken", "pitch_lost", "yaw_taken", "yaw_lost"), NUMBER),
    "haptic_skill.Fault": {"number": WHOLE, "name": TEXT},
    "haptic_skill.Outcome": {"outcome": TEXT, "success": FLAG, "result": {"type": "object"}},
}
"""Fields of the messages in JSON, in SI units."""


@dataclass(frozen=True)
class Log:
    """A log.

    Attributes:
        data: the MCAP file.
        messages: number of messages of each topic.
    """

    data: bytes
    messages: Mapping[str, int]


@dataclass(frozen=True)
class _Message:
    topic: str
    kind: str
    content: bytes | Mapping[str, Any]


def recording_log(recording: Demonstration | RigRun) -> Log:
    """Returns a recording as a log.

    Raises:
        ModuleNotFoundError: if the package ``mcap`` is missing.
        ValueError: if the recording has no geometry, or begins before the time 0.
    """
    from mcap.writer import Writer

    stream, counts = io.BytesIO(), Counter[str]()
    writer = Writer(stream)
    writer.start(library=f"haptic-skill {version_of('haptic-skill')}")
    schemas: dict[str, int] = {}
    channels: dict[str, int] = {}
    messages = _run_messages(recording) if isinstance(recording, RigRun) else _demonstration_messages(recording)
    for time, message in messages:
        kind, topic = message.kind, message.topic
        if kind not in schemas:
            definition = SCHEMAS.get(kind)
            encoding = "jsonschema" if definition is None else "ros2msg"
            schemas[kind] = writer.register_schema(kind, encoding, (definition or _json_schema(kind)).encode())
        if topic not in channels:
            encoding = "cdr" if kind in SCHEMAS else "json"
            channels[topic] = writer.register_channel(topic, encoding, schemas[kind])
        content = message.content
        data = content if isinstance(content, bytes) else json.dumps(content).encode()
        writer.add_message(channels[topic], log_time=time, publish_time=time, data=data)
        counts[topic] += 1
    writer.add_metadata("haptic_skill", _header(recording))
    writer.finish()  # type: ignore[no-untyped-call]
    return Log(stream.getvalue(), counts)


def _run_messages(run: RigRun) -> Iterator[tuple[int, _Message]]:
    samples, names = run.samples, run.metadata.get("state_names") or []
    motion = motion_of_run(run)
    times = _nanoseconds(samples["time"].to_numpy())
    contexts = set(CONTEXT_COLUMNS) <= set(samples.columns)
    fault = None
    for k, (time, row) in enumerate(zip(times, samples.to_dict("records"), strict=True)):
        yield time, _wrench(time, motion, k)
        for body in ("peg", "hole"):
            yield time, _pose(time, motion, k, body, "world")
        state = int(row["state"])
        name = names[state] if state < len(names) else str(state)
        yield time, _state("/contact_state", state, name, known=row["known"] > 0.5)
        if contexts:
            values = (int(row["context"]), row["context_probability"], row["context_evidence"])
            fields = dict(zip(("number", "probability", "evidence"), values, strict=True))
            yield time, _Message("/context", "haptic_skill.Context", fields)
        command = {name: row[name] for name in ("target_pitch", "target_yaw", "feed_speed", "support")}
        command |= {"back_off": row["back_off"] > 0.5, "turning": row.get(CONTROL_COLUMNS[0], 1.0)}
        yield time, _Message("/command", "haptic_skill.RigCommand", command)
        rig = {name: row[name] for name in JSON_TYPES["haptic_skill.RigState"]}
        yield time, _Message("/rig_state", "haptic_skill.RigState", rig)
        if row["fault"] != fault:  # at the start, and where it changes
            fault = row["fault"]
            found = {"number": int(fault), "name": FAULTS.get(int(fault), "not known")}
            yield time, _Message("/fault", "haptic_skill.Fault", found)
    reason = str(run.result.get("reason", ""))
    yield times[-1], _outcome(reason, success=bool(run.result.get("inserted")), result=_finite(run.result))


def _demonstration_messages(demonstration: Demonstration) -> Iterator[tuple[int, _Message]]:
    samples = demonstration.samples
    motion = motion_of_demonstration(demonstration)
    times = _nanoseconds(samples["time"].to_numpy())
    labels = contact_labels(demonstration)
    motions = samples[list(ACTIONS)].to_numpy().tolist()
    for k, (time, moved) in enumerate(zip(times, motions, strict=True)):
        yield time, _wrench(time, motion, k)
        yield time, _pose(time, motion, k, "peg", "hole")
        label = int(labels[k])
        name = "not known" if label == UNKNOWN else ContactLabel(label).label
        yield time, _state("/exact_contact", label, name, known=label != UNKNOWN)
        yield time, _Message("/command", "haptic_skill.HandMotion", dict(zip(ACTIONS, moved, strict=True)))
    yield times[-1], _outcome(demonstration.reason, success=demonstration.good, result={})


def _wrench(time: int, motion: Motion, k: int) -> _Message:
    numbers = [*motion.force[k].tolist(), *motion.moment[k].tolist()]
    return _Message("/wrench", WRENCH, stamped(time, FRAMES["peg"], numbers))


def _pose(time: int, motion: Motion, k: int, body: str, frame: str) -> _Message:
    """The pose of peg or hole in a frame; for a demonstration, W is H."""
    rotation: Rotation
    rotation, position = (motion.R_WP, motion.p_WP) if body == "peg" else (motion.R_WH, motion.p_WH)
    numbers = [*position[k].tolist(), *rotation[k].as_quat(canonical=True).tolist()]
    return _Message(f"/{body}/pose", POSE, stamped(time, FRAMES[frame], numbers))


def _state(topic: str, number: int, name: str, *, known: bool) -> _Message:
    return _Message(topic, "haptic_skill.ContactState", {"number": number, "name": name, "known": bool(known)})


def _outcome(reason: str, *, success: bool, result: Mapping[str, Any]) -> _Message:
    content = {"outcome": reason, "success": success, "result": dict(result)}
    return _Message("/outcome", "haptic_skill.Outcome", content)


def _finite(result: Mapping[str, Any]) -> dict[str, Any]:
    """A result without NaN and infinite numbers, which JSON does not have."""
    return {name: value for name, value in result.items() if not (isinstance(value, float) and not np.isfinite(value))}


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


def _header(recording: Demonstration | RigRun) -> dict[str, str]:
    """Geometry, scenario, seed and versions of a recording, as JSON texts."""
    kind = "rig_run" if isinstance(recording, RigRun) else "demonstration"
    return {"kind": kind, **{str(name): json.dumps(value) for name, value in recording.metadata.items()}}
