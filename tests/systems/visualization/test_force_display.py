import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from experiments.trial import TrialRun, trial_scenario
from interfaces.reports import replay_scene
from interfaces.reports.motion import motion_of_run
from models.scenario import TRIAL_STREAM, resolve_scenario
from systems.plant.contact_plant import AddRigPlant
from systems.rig import WireRig
from systems.visualization.force_display import FORCE_COLOUR, ForceDisplay
from tests.interfaces.reports.test_replay_scene import decoded, drawn_arrows
from tests.systems.visualization.canvas import Canvas

ARROW = "force_on_the_peg"


def test_the_floor_pushes_the_peg_up_and_the_arrow_starts_at_the_tip(quick_scenario):
    scenario = resolve_scenario(quick_scenario, seed=1, stream=TRIAL_STREAM)
    builder, canvas = DiagramBuilder(), Canvas()
    contact = AddRigPlant(builder, scenario)
    ForceDisplay.AddToBuilder(builder=builder, contact=contact, meshcat=canvas, period=1 / 32)
    builder.ExportInput(contact.carriage_force, "carriage_force")
    builder.ExportInput(contact.gimbal_equilibrium, "gimbal_equilibrium")
    diagram = builder.Build()
    simulator = Simulator(diagram)
    context = simulator.get_mutable_context()
    diagram.GetInputPort("carriage_force").FixValue(context, np.zeros(1))
    diagram.GetInputPort("gimbal_equilibrium").FixValue(context, np.zeros(4))
    tip = -scenario.geometry.hole_depth - 1e-5
    contact.set_start(context, carriage=scenario.sensor.height + tip, pitch=0.0, yaw=0.0)
    simulator.AdvanceTo(scenario.contact.time_step)  # contact results are those of the last step
    dut = diagram.GetSubsystemByName("force_display")
    dut._publish(dut.GetMyContextFromRoot(context))
    start, end = canvas.arrow(ARROW)
    np.testing.assert_allclose(start, [0.0, 0.0, contact.tip_height(context)], atol=1e-6)
    assert end[2] - start[2] > 1e-3  # more than 1 N
    np.testing.assert_allclose((end - start)[:2], 0.0, atol=0.05 * (end[2] - start[2]))


@pytest.mark.slow
def test_recording_and_replay_show_the_force_of_one_moment_in_the_same_direction(quick_scenario, skill):
    """The recording publishes the contact force, the replay shows what the sensor has measured."""
    scenario = trial_scenario(quick_scenario, number=1)
    scenario.trial.time_limit = 1.2
    builder, canvas = DiagramBuilder(), Canvas()
    contact = AddRigPlant(builder, scenario)
    ForceDisplay.AddToBuilder(builder=builder, contact=contact, meshcat=canvas, period=scenario.controller.period)
    rig = WireRig(builder, scenario, skill, contact)
    run = TrialRun(rig, scenario, number=1)
    run.advance(scenario.trial.time_limit)
    motion = motion_of_run(run.record(skill)[1])
    replayed = drawn_arrows(decoded(motion), "force")
    compared = 0
    for k, time in enumerate(motion.time):
        moments = [t for path, t in canvas.transforms_at if path == ARROW and abs(t - time) < 1e-6]
        if not moments or np.linalg.norm(motion.force[k]) < 3.0:
            continue
        recorded = canvas.transforms_at[ARROW, moments[0]].rotation().matrix()[:, 2]
        compared += 1
        assert recorded @ replayed[k] > 0.8 * np.linalg.norm(replayed[k])
        assert recorded @ motion.contact_forces[k].sum(axis=0) > 0.0
    assert compared > 5


def test_the_colour_is_that_of_the_replay():
    assert f"#{replay_scene.FORCE_COLOUR:06X}" == FORCE_COLOUR
