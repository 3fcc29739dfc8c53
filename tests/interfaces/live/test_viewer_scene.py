"""Tests the messages of the scene against those that Drake's Meshcat sends to its page."""

import asyncio

import numpy as np
import pytest
import umsgpack
from pydrake.geometry import (
    Cylinder,
    Mesh,
    Meshcat,
    MeshcatCone,
    MeshcatParams,
    Rgba,
    Sphere,
)
from pydrake.math import RigidTransform, RotationMatrix
from tornado.websocket import websocket_connect

from interfaces.live.messages import Outbox
from interfaces.live.viewer_scene import ViewerScene

POSE = RigidTransform(RotationMatrix.MakeXRotation(0.3), [1.0, 2.0, 3.0])
IGNORED = {"uuid", "vertexColors", "linewidth", "reflectivity", "wireframe", "wireframeLineWidth"}  # Drake's defaults


def draw(meshcat):
    meshcat.SetObject("rod", Cylinder(0.1, 2.0), Rgba(0.2, 0.4, 0.6, 0.5))
    meshcat.SetObject("grey", Cylinder(0.3, 1.0))
    meshcat.SetObject("/far/cone", MeshcatCone(0.5, 0.2, 0.1), Rgba(1.0, 0.0, 0.0))
    meshcat.SetTransform("rod", POSE)
    meshcat.SetProperty("grey", "scale", [2.0, 2.0, 2.0])
    meshcat.SetProperty("rod/<object>", "renderOrder", 3.0)
    meshcat.SetCameraPose(np.array([1.0, 2.0, 3.0]), np.array([4.0, 5.0, 6.0]))


def sent_by(meshcat):
    """The messages that a new page of Drake's Meshcat receives."""

    async def receive():
        page = await websocket_connect(f"ws://127.0.0.1:{meshcat.port()}/")
        messages = [await page.read_message()]
        while messages[-1] is not None and umsgpack.unpackb(messages[-1])["type"] != "show_realtime_rate":  # the last
            messages.append(await page.read_message())
        page.close()
        return messages

    return by_key(asyncio.run(receive()))


def by_key(messages):
    found = {}
    for message in map(umsgpack.unpackb, messages):
        key = (message["type"], message.get("path") if message["type"] != "set_target" else None)
        found[(*key, message.get("property"))] = comparable(message)
    return found


def comparable(value):
    """A message without identities, and without what has its default value in Drake's messages; numbers are rounded."""
    if isinstance(value, dict):
        drop = IGNORED | ({"geometry", "material", "path"} if value.get("type") in {"Mesh", "set_target"} else set())
        return {name: comparable(v) for name, v in value.items() if name not in drop}
    if isinstance(value, list):
        return [comparable(v) for v in value]
    return round(value, 9) if isinstance(value, float) else value


def test_the_messages_are_those_of_drake():
    reference = Meshcat(MeshcatParams(host="127.0.0.1", show_stats_plot=False))
    outbox = Outbox()
    for meshcat in (reference, ViewerScene(outbox)):
        draw(meshcat)
    theirs, ours = sent_by(reference), by_key(outbox.since(0)[1])
    assert len(ours) == 9
    for key, message in ours.items():
        assert message == theirs[key]


@pytest.mark.parametrize("shape", [Sphere(1.0), Mesh("there.obj")])
def test_other_shapes_are_refused(shape):
    with pytest.raises(ValueError, match="expected a cylinder, a cone or a mesh in memory"):
        ViewerScene(Outbox()).SetObject("a", shape)
