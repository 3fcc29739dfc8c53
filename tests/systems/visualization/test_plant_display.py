import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder

from experiments.trial.diagram_trial import TrialRun
from experiments.trial.trial_set import trial_scenario
from interfaces.reports import replay_scene
from interfaces.reports.motion import motion_of_run
from models.scenario import DEMONSTRATION_STREAM, TRIAL_STREAM, resolve_scenario
from systems.plant.contact_plant import NominalBodies
from systems.rig import AddEngine, MakeRig
from systems.virtual_environment import MakeVirtualEnvironment
from systems.visualization.plant_display import FORCE_COLOUR, RigDisplay
from tests.interfaces.reports.test_replay_scene import decoded, drawn_arrows
from tests.systems.visualization.canvas import Canvas

ARROW = "force_on_the_peg"


@pytest.mark.parametrize("engine", ["drake", "exact"])
def test_the_floor_pushes_the_peg_up_and_the_arrow_starts_at_the_tip(quick_scenario, engine):
    quick_scenario.contact.engine = engine
    scenario = resolve_scenario(quick_scenario, seed=1, stream=TRIAL_STREAM)
    builder, canvas = DiagramBuilder(), Canvas()
    plant = AddEngine(builder, scenario)
    RigDisplay.AddToBuilder(builder, scenario, plant, canvas, period=1 / 32)
    builder.ExportInput(plant.carriage_force, "carriage_force")
    builder.ExportInput(plant.gimbal_equilibrium, "gimbal_equilibrium")
    diagram = builder.Build()
    simulator = Simulator(diagram)
    context = simulator.get_mutable_context()
    diagram.GetInputPort("carriage_force").FixValue(context, np.zeros(1))
    diagram.GetInputPort("gimbal_equilibrium").FixValue(context, np.zeros(4))
    tip = -scenario.geometry.hole_depth - 1e-5
    plant.set_start(context, carriage=scenario.sensor.height + tip, angles=(0.0, 0.0))
    simulator.AdvanceTo(0.3)  # at rest on the floor
    dut = diagram.GetSubsystemByName("rig_display")
    dut._publish(dut.GetMyContextFromRoot(context))
    start, end = canvas.arrow(ARROW)
    np.testing.assert_allclose(start, [0.0, 0.0, plant.tip_height(context)], atol=1e-6)
    weight = NominalBodies.of(scenario).mass * 9.81  # what the carriage moves stands on the peg: 10 N are 10 mm
    assert end[2] - start[2] == pytest.approx(1e-3 * weight, rel=0.05)
    np.testing.assert_allclose((end - start)[:2], 0.0, atol=0.05 * (end[2] - start[2]))


@pytest.mark.parametrize("engine", ["drake", "exact"])
def test_the_demonstrated_peg_is_drawn_where_it_is(quick_scenario, engine):
    quick_scenario.contact.engine = engine
    scenario = resolve_scenario(quick_scenario, seed=1, stream=DEMONSTRATION_STREAM)
    canvas = Canvas()
    environment = MakeVirtualEnvironment(scenario, meshcat=canvas)
    simulator = Simulator(environment.diagram)
    environment.set_start(simulator.get_mutable_context())
    simulator.AdvanceTo(0.25)
    X_HP = environment.plant.peg_pose(simulator.get_context())
    assert canvas.transforms_at["plant/peg/peg", 0.25].IsNearlyEqualTo(X_HP, 1e-9)
    assert canvas.transforms_at["plant/hole/block", 0.25].IsExactlyIdentity()


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["drake", "exact"])
def test_recording_and_replay_show_the_force_of_one_moment_in_the_same_direction(quick_scenario, skill, engine):
    """The recording publishes what the mount holds, the replay shows what the sensor has measured.

    The trial is one in which the peg does not bounce between the walls: the contact of a moment would say nothing.
    """
    quick_scenario.contact.engine = engine
    scenario = trial_scenario(quick_scenario, number=2)
    scenario.trial.time_limit = 1.2
    canvas = Canvas()
    rig = MakeRig(scenario, skill, meshcat=canvas)
    run = TrialRun(rig, scenario, number=2)
    run.advance(scenario.trial.time_limit)
    motion = motion_of_run(run.ended().record(skill))
    replayed = drawn_arrows(decoded(motion), "force")
    compared = 0
    for (path, time), X in canvas.transforms_at.items():
        k = int(np.argmin(np.abs(motion.time - time)))
        if path != ARROW or np.linalg.norm(motion.force[k]) < 3.0:
            continue
        recorded = X.rotation().matrix()[:, 2]
        compared += 1
        assert recorded @ replayed[k] > 0.8 * np.linalg.norm(replayed[k])
        assert recorded @ motion.contact_forces[k].sum(axis=0) > 0.0
    assert compared > 5


def test_the_colour_is_that_of_the_replay():
    assert f"#{replay_scene.FORCE_COLOUR:06X}" == FORCE_COLOUR
