"""The simulated contact agrees with theory; the full measurement is `benchmarks.physics.theory`."""

import numpy as np
import pytest

from benchmarks.physics.contact_measurements import (
    PegTheory,
    force_balance,
    jamming_trials,
    measured_entry_tilt,
    measured_two_point_depth,
)
from benchmarks.physics.contact_probe import ContactProbe, PlanarPose
from models.contact_theory import largest_entry_tilt, two_point_depth
from models.scenario import Scenario

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


@pytest.mark.slow
def test_loads_slide_inside_the_jamming_diagram_and_stick_outside():
    trials = jamming_trials(Scenario(), 0.2, depth=0.020, count=12, seed=1)
    assert trials.agreement() == 1.0
    assert 0 < trials.slid.sum() < 12


@pytest.mark.slow
def test_the_axial_force_of_sliding_is_predicted():
    predicted, measured = force_balance(Scenario(), 0.2, depth=0.020, shares=[0.0, 0.6])
    assert measured == pytest.approx(predicted, rel=0.05)


def test_a_held_axis_does_not_move(probe):
    probe.place(PlanarPose(0.0, -0.01, 0.0))
    probe.load(0.0, -1.0, 0.0)
    probe.hold("z")
    probe.step(5)
    assert probe.pose().z == pytest.approx(-0.01, abs=1e-12)
    probe.hold()
    probe.step(5)
    assert probe.pose().z < -0.01
