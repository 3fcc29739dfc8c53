"""The simulated contact agrees with theory; the full measurement is `benchmarks.physics.theory`."""

import math

import numpy as np
import pytest
from pydrake.math import RigidTransform, RotationMatrix

from benchmarks.physics.contact_measurements import (
    PRESSED,
    PegTheory,
    force_balance,
    jamming_trials,
    measured_entry_tilt,
    measured_two_point_depth,
    measured_wedging_tilt,
    press,
    prism_in,
)
from benchmarks.physics.contact_probe import ContactProbe, PosedMeshes
from benchmarks.physics.exact_probe import ExactProbe
from models.clearance import numerics_of_clearance
from models.contact_theory import exact_wedging_tilt, largest_entry_tilt, two_point_depth
from models.scenario import Scenario
from models.section import CORNER

SIZES = {"peg_radius": 0.010, "hole_radius": 0.01005}


@pytest.fixture(scope="module")
def probe():
    return ContactProbe(Scenario())


@pytest.mark.parametrize("degrees", [0.3, 1.0, 2.6])
def test_the_meshes_have_two_contacts_at_the_exact_depth(probe, degrees):
    measured = measured_two_point_depth(probe, PegTheory.of(Scenario()), np.radians(degrees))
    # The corners beside the touching one are r (1 - cos(theta)) (1 - cos(2 pi/n)) too near: 0.35 um at 2.6 degrees.
    assert measured == pytest.approx(float(two_point_depth(np.radians(degrees), **SIZES)), rel=5e-3)


def test_the_largest_entry_tilt_is_exact(probe):
    measured = measured_entry_tilt(probe, PegTheory.of(Scenario()))
    assert measured == pytest.approx(largest_entry_tilt(**SIZES), rel=0.01)


def test_the_rule_of_numerics_keeps_the_play_of_half_the_clearance():
    nominal, tilt = Scenario(), 0.02
    nominal.geometry.hole_radius = 1.0025 * nominal.geometry.peg_radius
    sizes = PegTheory.of(nominal)
    exact = float(two_point_depth(tilt, peg_radius=sizes.r, hole_radius=sizes.R))
    rule, coarse = (
        abs(measured_two_point_depth(ContactProbe(scenario), sizes, tilt) / exact - 1.0)
        for scenario in (numerics_of_clearance(nominal), nominal)
    )
    assert rule < 0.5 * coarse < 0.05


@pytest.mark.slow
def test_loads_slide_inside_the_jamming_diagram_and_stick_outside():
    trials = jamming_trials(Scenario(), 0.2, depth=0.020, count=6, seed=1)
    assert trials.agreement() == 1.0
    assert 0 < trials.slid.sum() < 6


@pytest.mark.slow
def test_the_axial_force_of_sliding_is_predicted():
    predicted, measured = force_balance(Scenario(), 0.2, depth=0.020, shares=[0.0, 0.6])
    assert measured == pytest.approx(predicted, rel=0.05)


@pytest.mark.slow
@pytest.mark.parametrize("friction", [0.15, 0.35])
def test_rigid_bodies_obey_all_laws(friction):
    rigid = {"engine": ExactProbe}
    assert jamming_trials(Scenario(), friction, depth=0.020, count=40, seed=3, **rigid).agreement() == 1.0
    predicted, measured = force_balance(Scenario(), friction, depth=0.020, shares=[0.0, 0.6], **rigid)
    assert measured == pytest.approx(predicted, rel=0.02)  # the law leaves out the tilt of the normal at the mouth
    wedge, _ = measured_wedging_tilt(Scenario(), friction, **rigid)
    assert wedge == pytest.approx(exact_wedging_tilt(**SIZES, friction=friction), rel=3e-3)


@pytest.mark.slow
@pytest.mark.parametrize("plane", ["square", "square, diagonal"])
def test_a_prism_obeys_the_laws_in_the_plane_of_its_sides_and_of_its_corners(plane):
    scenario, rigid = prism_in(plane), {"engine": ExactProbe}
    sizes = PegTheory.of(scenario)
    wide = 0.010 if plane == "square" else 0.010 * (math.sqrt(2.0) * (1.0 - CORNER) + CORNER)
    assert (sizes.r, sizes.R) == pytest.approx((wide, wide + 50e-6))
    assert jamming_trials(scenario, 0.2, depth=0.020, count=10, seed=3, **rigid).agreement() == 1.0
    predicted, measured = force_balance(scenario, 0.2, depth=0.020, shares=[0.6], **rigid)
    assert measured == pytest.approx(predicted, rel=0.02)
    wedge, _ = measured_wedging_tilt(scenario, 0.2, **rigid)
    assert wedge == pytest.approx(exact_wedging_tilt(peg_radius=sizes.r, hole_radius=sizes.R, friction=0.2), rel=3e-3)


def test_the_depth_at_rest_converges_with_the_stiffness_and_not_with_the_step():
    errors = {}
    for stiffness, step in ((1e7, 2.5e-4), (1e8, 2.5e-4), (1e8, 1e-4), (1e9, 2.5e-4)):
        scenario = Scenario()
        scenario.contact.stiffness = stiffness
        probe = ExactProbe(scenario, time_step=step, **PRESSED)
        row = press(probe, PegTheory.of(scenario), scenario.geometry.assembly, np.radians(1.0), 5.0)
        errors[stiffness, step] = row["depth_error"]
    assert 0.03 < errors[1e7, 2.5e-4] < 0.05
    assert errors[1e8, 1e-4] == pytest.approx(errors[1e8, 2.5e-4], abs=1e-3)
    assert errors[1e9, 2.5e-4] < 0.2 * errors[1e8, 2.5e-4] + 1e-4 < 0.04 * errors[1e7, 2.5e-4]


def test_posed_meshes_touch_where_the_peg_is_wider_than_the_free_space():
    """A corner of each polygon lies on the axis x; the clearance is 50 um."""
    meshes = PosedMeshes(Scenario())
    assert not meshes.touch(RigidTransform([49.9e-6, 0.0, -0.010]))
    assert meshes.touch(RigidTransform([50.1e-6, 0.0, -0.010]))
    # A turn about the own axis by half a side costs a sagitta of 48 um.
    turned = RotationMatrix.MakeZRotation(np.pi / 32)
    assert not meshes.touch(RigidTransform(turned, [0.0, 0.0, -0.010]))
    assert meshes.touch(RigidTransform(turned, [4e-6, 0.0, -0.010]))
