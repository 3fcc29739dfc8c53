"""The plant of an engine alone, with constant inputs."""

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantVectorSource

from systems.plant.contact_plant import NominalBodies
from systems.rig import AddEngine

G = 9.81


class Bench:
    """The plant of the scenario's engine, with constant force on the carriage and equilibrium of the gimbal."""

    def __init__(self, scenario, *, force=0.0, equilibrium=(0.0, 0.0)):
        builder = DiagramBuilder()
        self.scenario = scenario
        self.plant = AddEngine(builder, scenario)
        for value, port in (
            ([force], self.plant.carriage_force),
            ([*equilibrium, *np.zeros(len(equilibrium))], self.plant.gimbal_equilibrium),
        ):
            builder.Connect(builder.AddSystem(ConstantVectorSource(value)).get_output_port(), port)
        self.simulator = Simulator(builder.Build())

    def start(self, *, tip_z, pitch=0.0, yaw=0.0):
        carriage = self.scenario.sensor.height + tip_z
        self.plant.set_start(self.simulator.get_mutable_context(), carriage=carriage, angles=(pitch, yaw))
        return self

    def advance(self, seconds):
        self.simulator.AdvanceTo(self.simulator.get_context().get_time() + seconds)
        return self

    def held(self):
        force = self._eval(self.plant.reaction_forces)[self.plant.sensor]
        return np.concatenate([force.translational(), force.rotational()])

    def gimbal(self):
        return self._eval(self.plant.gimbal_state)

    def _eval(self, port):
        return port.Eval(port.get_system().GetMyContextFromRoot(self.simulator.get_context()))


def hanging_weight(scenario):
    """Weight of the bodies on the feed drive, N."""
    return G * NominalBodies.of(scenario).mass
