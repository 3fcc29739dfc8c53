"""The behaviour of the proxy in the virtual hole (Fig. 2 of the paper): it follows, slides and stops."""

import math

import numpy as np
import pytest
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder, LeafSystem

from models.scenario import Scenario
from systems.haptics.haptic_proxy import HapticProxy
from systems.haptics.virtual_fixture import FreeFixture
from systems.math.rotation import from_rotation_vector
from systems.plant.contact_plant import AddVirtualPlant

S = Scenario()
G = S.geometry
K = S.coupling.stiffness
INSIDE = -0.012  # in units of m
GAP = G.clearance  # between the two polygons at their edges; 0.5 % less at their faces
STICTION = 1e-4  # in units of m/s; Drake's static friction allows this speed


class GuidedProbe(LeafSystem):
    """A probe that follows a path of poses."""

    def __init__(self, path):
        super().__init__()
        self._path = path
        pose = self.DeclareAbstractOutputPort("pose", Value[RigidTransform], self._calc, {self.time_ticket()})
        self.pose = pose
        self.velocity = self.DeclareVectorOutputPort("velocity", 6, self._calc_velocity, {self.time_ticket()})

    def _calc(self, context, output):
        output.set_value(self._path(context.get_time()))

    def _calc_velocity(self, context, output):
        t, h = context.get_time(), 1e-6
        moved = self._path(t + h).translation() - self._path(t).translation()
        output.SetFromVector([0, 0, 0, *(moved / h)])


def follow(path, *, duration, start, friction=0.0, every=None):
    """Poses of the peg while the probe follows ``path``, every ``every`` s or at the end."""
    scenario = Scenario()
    scenario.contact.friction = friction
    builder = DiagramBuilder()
    contact = AddVirtualPlant(builder, scenario)
    proxy = builder.AddSystem(HapticProxy(coupling=scenario.coupling, fixture=FreeFixture(), peg=contact.peg.index()))
    probe = builder.AddSystem(GuidedProbe(path))
    builder.Connect(probe.pose, proxy.GetInputPort("probe_pose"))
    builder.Connect(probe.velocity, proxy.GetInputPort("probe_velocity"))
    builder.Connect(contact.plant.get_state_output_port(contact.peg.model_instance()), proxy.GetInputPort("peg_state"))
    builder.Connect(proxy.GetOutputPort("peg_forces"), contact.plant.get_applied_spatial_force_input_port())
    simulator = Simulator(builder.Build())
    own = contact.plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    contact.plant.SetFreeBodyPose(own, contact.peg, start)
    poses = []
    for t in np.arange(0.0, duration, every or duration) + (every or duration):
        simulator.AdvanceTo(t)
        poses.append(contact.peg.EvalPoseInWorld(own))
    return poses


def at(x, y, z, tilt=(0.0, 0.0)):
    return RigidTransform(from_rotation_vector(np.array([*tilt, 0.0])), [x, y, z])


def straight(a, b, time):
    return lambda t: RigidTransform(
        a.rotation(), a.translation() + min(1.0, t / time) * (b.translation() - a.translation())
    )


@pytest.mark.slow
@pytest.mark.parametrize("angle", [0.0, 0.7])
def test_the_peg_slides_along_the_wall_of_the_bore_to_the_depth_of_the_probe(angle):
    c, s = math.cos(angle), math.sin(angle)
    a, b = at(0.0, 0.0, INSIDE), at(0.002 * c, 0.002 * s, INSIDE - 0.004)
    (X,) = follow(straight(a, b, 0.4), duration=1.2, start=a)
    assert X.translation()[2] == pytest.approx(INSIDE - 0.004, abs=2e-5)
    outward = X.translation()[:2] @ [c, s]
    assert 0.0 < outward < G.clearance + 20e-6
    assert abs(X.translation()[:2] @ [-s, c]) < G.clearance


@pytest.mark.slow
def test_a_jammed_peg_stops():
    """A peg that is tilted by more than c/mu wedges, and stays when it is pushed."""
    tilt = (0.0, 0.05)
    a = at(0.0, 0.0, 5e-4, tilt)
    deep = a.rotation().multiply(np.array([0.0, 0.0, -0.009]))
    b = RigidTransform(a.rotation(), a.translation() + deep)
    poses = follow(straight(a, b, 0.6), duration=1.6, start=a, friction=0.3, every=0.1)
    depths = np.array([-X.translation()[2] for X in poses])
    assert depths[-1] < 0.7 * 0.0085
    assert np.ptp(depths[-4:]) < 1.2 * STICTION * 0.3


@pytest.mark.slow
@pytest.mark.parametrize(("force", "bound"), [(3.0, 5e-6), (20.0, 15e-6)])
@pytest.mark.parametrize("where", ["face", "wall"])
def test_the_penetration_is_below_the_bound(where, force, bound):
    reach = force / K
    if where == "face":
        a, b = at(0.0205, 0.0, 2e-5), at(0.0205, 0.0, -reach)
    else:
        a, b = at(0.0, 0.0, INSIDE), at(G.clearance + reach, 0.0, INSIDE)
    poses = follow(straight(a, b, 0.3), duration=1.0, start=a, every=0.01)
    if where == "face":
        rims = [X.translation()[2] - G.peg_radius * np.linalg.norm(X.rotation().col(2)[:2]) for X in poses]
        depth = -min(rims)
    else:
        depth = max(np.linalg.norm(X.translation()[:2]) for X in poses) - GAP
    assert depth < bound
