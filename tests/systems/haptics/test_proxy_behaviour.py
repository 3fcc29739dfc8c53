"""The behaviour of the proxy in the virtual hole (Fig. 2 of the paper): it follows, slides and stops."""

import math

import numpy as np
import pytest
from pydrake.math import RigidTransform
from pydrake.systems.analysis import Simulator

from models.scenario import Scenario
from systems.math.rotation import from_rotation_vector
from systems.servo.probe import Probe
from systems.servo.served_environment import MakeServedEnvironment

pytestmark = pytest.mark.slow
G, K = Scenario().geometry, Scenario().coupling.stiffness
INSIDE = -0.012  # in units of m
STICTION = 1e-4  # in units of m/s; Drake's static friction allows this speed


def follow(a, b, *, time, duration, friction=0.0):
    """Poses of the free peg, which starts at a pose, while the probe goes from there to another one, and stays."""
    scenario = Scenario(fixture="free")
    scenario.start.tilt, scenario.start.offset = [0.0, 0.0], [0.0, 0.0]
    scenario.contact.friction, step = friction, scenario.contact.time_step
    environment = MakeServedEnvironment(scenario)
    simulator = Simulator(environment.diagram)
    context = simulator.get_mutable_context()
    environment.plant.set_start(context, a)
    way, poses = b.translation() - a.translation(), []
    for t in np.arange(0.0, duration, step):
        velocity = np.append(np.zeros(3), way / time * (t < time))
        X_HD = RigidTransform(a.rotation(), a.translation() + min(1.0, t / time) * way)
        environment.set_probe(context, Probe(t, X_HD, velocity, np.zeros(6), 0.0, 0.0, 0.0, 1.0, 0.0))
        simulator.AdvanceTo(t + step)
        poses.append(environment.plant.peg_pose(context))
    return poses


def at(x, y, z, tilt=(0.0, 0.0)):
    return RigidTransform(from_rotation_vector(np.array([*tilt, 0.0])), [x, y, z])


@pytest.mark.parametrize("angle", [0.0, 0.7])
def test_the_peg_slides_along_the_wall_of_the_bore_to_the_depth_of_the_probe(angle):
    c, s = math.cos(angle), math.sin(angle)
    b = at(0.002 * c, 0.002 * s, INSIDE - 0.004)
    X = follow(at(0.0, 0.0, INSIDE), b, time=0.4, duration=1.2)[-1]
    assert X.translation()[2] == pytest.approx(INSIDE - 0.004, abs=2e-5)
    assert 0.0 < X.translation()[:2] @ [c, s] < G.clearance + 20e-6
    assert abs(X.translation()[:2] @ [-s, c]) < G.clearance


def test_a_jammed_peg_stops():
    """A peg that is tilted by more than c/mu wedges, and stays when it is pushed."""
    a = at(0.0, 0.0, 5e-4, (0.0, 0.05))
    poses = follow(a, a @ RigidTransform([0.0, 0.0, -0.009]), time=0.6, duration=1.6, friction=0.3)
    depths = np.array([-X.translation()[2] for X in poses])
    assert depths[-1] < 0.7 * 0.0085
    assert np.ptp(depths[3 * len(depths) // 4 :]) < 1.2 * STICTION * 0.4


@pytest.mark.parametrize(("force", "bound"), [(3.0, 5e-6), (20.0, 15e-6)])
@pytest.mark.parametrize("where", ["face", "wall"])
def test_the_penetration_is_below_the_bound(where, force, bound):
    reach = force / K
    if where == "face":
        poses = follow(at(0.0205, 0.0, 2e-5), at(0.0205, 0.0, -reach), time=0.3, duration=1.0)
        depths = [G.peg_radius * np.linalg.norm(X.rotation().col(2)[:2]) - X.translation()[2] for X in poses]
    else:
        poses = follow(at(0.0, 0.0, INSIDE), at(G.clearance + reach, 0.0, INSIDE), time=0.3, duration=1.0)
        depths = [np.linalg.norm(X.translation()[:2]) - G.clearance for X in poses]
    assert max(depths) < bound
