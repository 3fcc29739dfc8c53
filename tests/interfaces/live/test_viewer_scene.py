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
    MeshcatVisualizer,
    MeshcatVisualizerParams,
    Rgba,
    Role,
    Sphere,
)
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.framework import DiagramBuilder
from tornado.websocket import websocket_connect

from interfaces.live.display import draw_bodies
from interfaces.live.messages import Outbox
from interfaces.live.viewer_scene import ViewerScene
from models.scenario import Scenario
from systems.plant.contact_plant import AddVirtualPlant

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
    """A message without identities, and without what has its default value in Drake's messages."""
    if isinstance(value, dict):
        drop = IGNORED | ({"geometry", "material", "path"} if value.get("type") in {"Mesh", "set_target"} else set())
        return {name: comparable(v) for name, v in value.items() if name not in drop}
    return [comparable(v) for v in value] if isinstance(value, list) else value


def assert_same(ours, theirs):
    if isinstance(ours, dict):
        assert ours.keys() == theirs.keys()
        for name in ours:
            assert_same(ours[name], theirs[name])
    elif isinstance(ours, list) and ours and not isinstance(ours[0], dict):
        np.testing.assert_allclose(ours, theirs, atol=1e-12)
    elif isinstance(ours, list):
        for mine, other in zip(ours, theirs, strict=True):
            assert_same(mine, other)
    else:
        assert ours == theirs


def test_the_messages_are_those_of_drake():
    reference = Meshcat(MeshcatParams(host="127.0.0.1", show_stats_plot=False))
    outbox = Outbox()
    for meshcat in (reference, ViewerScene(outbox)):
        draw(meshcat)
    theirs, ours = sent_by(reference), by_key(outbox.since(0)[1])
    assert len(ours) == 9
    for key, message in ours.items():
        assert_same(message, theirs[key])


def test_peg_and_block_look_as_drake_draws_them():
    reference = Meshcat(MeshcatParams(host="127.0.0.1", show_stats_plot=False))
    outbox = Outbox()
    builder = DiagramBuilder()
    contact = AddVirtualPlant(builder, Scenario())
    MeshcatVisualizer.AddToBuilder(
        builder, contact.scene_graph, reference, MeshcatVisualizerParams(role=Role.kIllustration, prefix="theirs")
    )
    draw_bodies(ViewerScene(outbox), contact)
    diagram = builder.Build()
    diagram.ForcedPublish(diagram.CreateDefaultContext())
    theirs, ours = sent_by(reference), by_key(outbox.since(0)[1])
    paths = {
        "/drake/plant/peg/peg/peg::peg_picture": "/drake/theirs/peg/peg/peg/peg_picture",
        "/drake/plant/hole/block/hole::block_picture": "/drake/theirs/hole/block/hole/block_picture",
    }
    assert ours.keys() == {(kind, path, None) for kind in ("set_object", "set_transform") for path in paths}
    for (kind, path, _), message in ours.items():
        assert message.pop("path") == path
        reference_message = theirs[kind, paths[path], None]
        assert reference_message.pop("path") == paths[path]
        assert_same(message, reference_message)


@pytest.mark.parametrize("shape", [Sphere(1.0), Mesh("there.obj")])
def test_other_shapes_are_refused(shape):
    with pytest.raises(ValueError, match="expected a cylinder, a cone or a mesh in memory"):
        ViewerScene(Outbox()).SetObject("a", shape)
