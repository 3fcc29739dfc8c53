import copy
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from pydrake.systems.analysis import Simulator

from experiments.trial.diagram_trial import run_rig
from models.scenario import FREE_FACETS, TRIAL_STREAM, load_scenario, resolve_scenario
from systems.rig import MakeRig
from tests.diagrams import unconnected_inputs, unused_plant_inputs

NOT_CONNECTED = unused_plant_inputs() | {
    ("plant", name) for name in ("applied_spatial_force", "gimbal_actuation", "mount_actuation", "feed_desired_state")
}


@pytest.fixture
def resolved(quick_scenario):
    """A scenario whose peg touches the mouth within 0.1 s."""
    quick_scenario.start.height = 2e-4
    quick_scenario.start.tilt = [0.04, -0.03]
    quick_scenario.rig.pivot_height = 0.002
    return resolve_scenario(quick_scenario, seed=1, stream=TRIAL_STREAM)


def started(rig):
    simulator = Simulator(rig.diagram)
    rig.set_start(simulator.get_mutable_context())
    return simulator


def test_every_input_is_connected_except_for_the_unused_ones_of_the_plant(resolved, skill):
    assert unconnected_inputs(MakeRig(resolved, skill).diagram) - NOT_CONNECTED == set()


def test_an_unresolved_scenario_is_an_error(quick_scenario, skill):
    with pytest.raises(ValueError, match="not resolved"):
        MakeRig(quick_scenario, skill)


def test_the_hole_starts_at_the_opposite_of_the_pegs_tilt(resolved, skill):
    rig = MakeRig(resolved, skill)
    simulator = started(rig)
    plant = rig.plant.plant
    own = plant.GetMyContextFromRoot(simulator.get_context())
    X_WH, X_WP = (plant.EvalBodyPoseInWorld(own, body) for body in (rig.plant.block, rig.plant.peg))
    np.testing.assert_allclose(X_WP.translation(), [0.0, 0.0, resolved.start.height], atol=1e-12)
    np.testing.assert_allclose(X_WP.rotation().matrix(), np.eye(3), atol=1e-12)
    axis = (X_WH.inverse() @ X_WP).rotation().col(2)
    theta = np.array(resolved.start.tilt)
    np.testing.assert_allclose(axis[:2], [theta[1], -theta[0]], atol=np.linalg.norm(theta) ** 3)


def test_the_rig_runs_with_every_key_changed(quick_scenario, skill):
    scenario = load_scenario("one_of_everything")
    scenario.geometry = replace(quick_scenario.geometry, facets=FREE_FACETS)  # the geometry of the skill
    scenario.start.depth = 0.0  # for demonstrations only
    scenario.rig.clocking_stage = False  # as this geometry is round
    scenario.carrier = "rig"
    resolved = resolve_scenario(scenario, seed=0, stream=TRIAL_STREAM)
    foreign = copy.copy(skill)
    foreign.metadata_ = {}  # foreign demonstrations need not state their geometry
    rig = MakeRig(resolved, foreign)
    simulator = started(rig)
    simulator.AdvanceTo(0.1)
    logged = rig.recorder.samples(simulator.get_context())
    assert np.isfinite(logged.to_numpy()).all()
    assert len(logged) == 1 + round(0.1 / resolved.controller.period)


def test_a_skill_for_another_geometry_is_an_error(skill, quick_scenario):
    quick_scenario.geometry.hole_radius = 0.01006
    resolved = resolve_scenario(quick_scenario, seed=0, stream=TRIAL_STREAM)
    with pytest.raises(ValueError, match=r"trained for geometry.hole_radius 0.01005 m, not 0.01006 m"):
        MakeRig(resolved, skill)


def test_another_trial_in_the_same_diagram_is_that_of_a_new_diagram_bit_for_bit(resolved, quick_scenario, skill):
    quick_scenario.start.tilt, quick_scenario.rig.pivot_height = [-0.05, 0.02], -0.0015
    quick_scenario.contact.friction = 0.31
    quick_scenario.trial.time_limit = resolved.trial.time_limit = 0.6
    other = resolve_scenario(quick_scenario, seed=2, stream=TRIAL_STREAM)
    used, fresh = (run_rig(MakeRig(scenario, skill), other, seed=2) for scenario in (resolved, other))
    pd.testing.assert_frame_equal(used.samples, fresh.samples, check_exact=True)
    assert used.result == fresh.result
    assert used.result.peak_load > 1.0


@pytest.mark.parametrize(
    "change",
    [
        lambda s: setattr(s.geometry, "hole_radius", 0.0102),
        lambda s: setattr(s.start, "tilt", None),
        lambda s: setattr(s.rig, "pivot_height", None),
        lambda s: setattr(s.contact, "dissipation", 9.0),
    ],
)
def test_a_scenario_of_another_rig_is_refused(resolved, skill, change):
    other = copy.deepcopy(resolved)
    change(other)
    rig = MakeRig(resolved, skill)
    with pytest.raises(ValueError, match="expected one that differs only in what resolve_scenario draws"):
        rig.set_trial(rig.diagram.CreateDefaultContext(), other)
