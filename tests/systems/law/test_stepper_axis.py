"""Compares the stepper on the pitch axis of the rig's plant, without contact, with closed forms."""

import math

import numpy as np
import pytest
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder, EventStatus
from pydrake.systems.primitives import ConstantVectorSource, Demultiplexer, Multiplexer

from models.scenario import Scenario, resolve_scenario
from systems.law.stepper_motor import StepperMotor
from systems.plant.contact_plant import AddRigPlant


class PitchAxis:
    """The pitch axis at angle ``start`` (rad), its driver commanded to ``target`` (rad), under a ``load`` (N m)."""

    def __init__(self, *, target=0.0, load=0.0, time_step=1e-3, start=0.0):
        scenario = resolve_scenario(Scenario(), seed=0, stream=2)
        scenario.contact.time_step = time_step
        scenario.rig.pivot_height = 0.0
        self.parameters = p = scenario.stepper
        builder = DiagramBuilder()
        rig = AddRigPlant(builder, scenario)
        self.plant = plant = rig.plant
        self.motor = builder.AddSystem(StepperMotor(parameters=p, period=time_step, start_angle=0.0))
        order = builder.AddSystem(Multiplexer([1, 3]))
        pitch = builder.AddSystem(Demultiplexer(4))

        def constant(value):
            return builder.AddSystem(ConstantVectorSource(np.atleast_1d(value))).get_output_port()

        builder.Connect(constant(target), self.motor.GetInputPort("target_angle"))
        builder.Connect(rig.gimbal_state, pitch.get_input_port())
        builder.Connect(pitch.get_output_port(0), self.motor.GetInputPort("measured_angle"))
        builder.Connect(self.motor.GetOutputPort("equilibrium_angle"), order.get_input_port(0))
        builder.Connect(constant(np.zeros(3)), order.get_input_port(1))
        builder.Connect(order.get_output_port(), rig.gimbal_equilibrium)
        builder.Connect(constant(0.0), rig.carriage_force)
        self.diagram = builder.Build()
        self.simulator = Simulator(self.diagram)
        root = self.simulator.get_mutable_context()
        self.own = plant.GetMyMutableContextFromRoot(root)
        rig.set_start(root, carriage=0.5, angles=(start, 0.0))
        self.joint = plant.GetJointByName("pitch")
        self.push(load)
        mass = plant.CalcMassMatrix(self.own)  # includes the rotor's inertia
        index = self.joint.velocity_start()
        self.inertia = mass[index, index]
        plant.GetJointByName("feed").Lock(self.own)

    def push(self, load):
        forces = np.zeros(self.plant.num_velocities())
        forces[self.joint.velocity_start()] = load
        self.plant.get_applied_generalized_force_input_port().FixValue(self.own, forces)

    @property
    def angle(self):
        return self.joint.get_angle(self.own)

    @property
    def lost(self):
        own = self.motor.GetMyContextFromRoot(self.simulator.get_context())
        return self.motor.GetOutputPort("step_counts").Eval(own)[1]


def test_a_released_axis_vibrates_at_its_frequency_and_decays_with_its_damping():
    """J theta'' + b theta' + K theta = 0: exp(-zeta w t) (cos w_d t + zeta / sqrt(1 - zeta^2) sin w_d t)."""
    start = 0.3 * Scenario().stepper.step_angle
    axis = PitchAxis(start=start, time_step=2e-5)
    p = axis.parameters
    w = math.sqrt(p.stiffness / axis.inertia)
    zeta = p.damping / (2.0 * math.sqrt(p.stiffness * axis.inertia))
    assert 0.2 < zeta < 0.8  # it does vibrate
    damped = w * math.sqrt(1 - zeta**2)
    samples = []
    axis.simulator.set_monitor(
        lambda context: samples.append((context.get_time(), axis.angle)) or EventStatus.DidNothing()
    )
    axis.simulator.AdvanceTo(2.0 * math.pi / damped)
    t, theta = np.array(samples).T
    expected = np.exp(-zeta * w * t) * (np.cos(damped * t) + zeta / math.sqrt(1 - zeta**2) * np.sin(damped * t))
    # The weight of the block below the pivot increases the stiffness by less than 0.1 %.
    np.testing.assert_allclose(theta / start, expected, atol=0.015)
    assert theta.min() < -0.05 * start


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_load_above_the_holding_torque_makes_the_axis_slip_by_one_electrical_period(sign):
    p = Scenario().stepper
    axis = PitchAxis(load=1.05 * sign * p.holding_torque)
    axis.simulator.set_monitor(
        lambda _: EventStatus.ReachedTermination(axis.motor, "slipped") if axis.lost else EventStatus.DidNothing()
    )
    axis.simulator.AdvanceTo(0.5)
    assert axis.lost == 4 * p.microsteps
    axis.push(0.0)
    axis.simulator.clear_monitor()
    axis.simulator.AdvanceTo(axis.simulator.get_context().get_time() + 0.2)
    assert axis.angle == pytest.approx(4 * sign * p.step_angle, rel=2e-3)
    assert axis.lost == 4 * p.microsteps


@pytest.mark.parametrize("time_step", [1e-3, 2e-3])
@pytest.mark.parametrize("share", [0.0, -0.8])
def test_no_step_is_lost_at_the_maximum_rate_and_acceleration(share, time_step):
    p = Scenario().stepper
    axis = PitchAxis(target=60 * p.step_angle, load=share * p.holding_torque, time_step=time_step)
    axis.simulator.AdvanceTo(60 / p.max_step_rate + p.max_step_rate / p.max_step_acceleration + 0.1)
    assert axis.lost == 0
    weight = 0.06 * 60 * p.step_angle / p.stiffness  # N m/rad of the block below its pivot
    assert axis.angle == pytest.approx(60 * p.step_angle + share * p.holding_torque / p.stiffness, abs=weight + 1e-6)
