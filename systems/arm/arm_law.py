"""The law of control over an arm that is not in the diagram: measurements come in, commands go out."""

from __future__ import annotations

import numpy as np
import pandas as pd
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import PassThrough

from models.scenario import Scenario
from skill.arrays import Array
from skill.data.axes import AXES
from skill.policy.rig_policy import RigPolicy
from systems.arm.arm_bodies import PERIOD
from systems.law.force_guard import StoppingModel
from systems.law.wiring import AddLaw, ConnectMonitors, check_geometry, check_start
from systems.recording.run_recorder import AddRunRecorder


class ArmLaw:
    """The same systems as in the rig and in the simulated arm, on the clock of a real one.

    Attributes:
        law: the systems.
        context: of the diagram.

    Args:
        scenario: resolved, of an arm.
        policy: that acts.
        stopping: how the arm stops.

    Raises:
        ValueError: as `MakeRig` does.
    """

    def __init__(self, scenario: Scenario, policy: RigPolicy, stopping: StoppingModel) -> None:
        check_start(scenario)
        check_geometry(scenario, policy)
        builder = DiagramBuilder()
        self.law = law = AddLaw(builder, scenario, policy, stopping=stopping, steppers=())
        ConnectMonitors(builder, law, None)
        builder.ExportInput(law.monitor.GetInputPort("raw_wrench"), "wrench")
        builder.ExportInput(law.monitor.GetInputPort("raw_depth"), "depth")
        as_on_rig = builder.AddNamedSystem("as_on_rig", PassThrough(4))
        builder.ExportInput(as_on_rig.get_input_port(), "as_on_rig")
        self._recorder = AddRunRecorder(
            builder=builder,
            ports={**law.recorded(AXES), ("carriage", *AXES): as_on_rig.get_output_port()},
            period=scenario.controller.period,
            home=0.0,
        )
        diagram = builder.Build()
        diagram.set_name("law of an arm")
        self._simulator = Simulator(diagram)
        self.context = self._simulator.get_mutable_context()
        self._steps = 0  # of `PERIOD`; sums of seconds would drift from the times of the updates
        self._depth = -scenario.start.height
        self._inputs = {name: diagram.GetInputPort(name) for name in ("wrench", "depth", "as_on_rig")}

    @property
    def time(self) -> float:
        """Time since the start, s."""
        return self._steps * PERIOD

    def advance(self, seconds: float, wrench: Array, depth: float, as_on_rig: Array) -> None:
        """Lets the law act for some seconds on measurements.

        The depth goes evenly from its last value: where a program is held up, the peg moves on, and the monitor would
        take all of its motion for one jump of the encoder.

        Args:
            seconds: a multiple of `PERIOD`.
            wrench: (6,), of the contact on the peg about its tip, in P, N and N m.
            depth: of the tip at the end, m.
            as_on_rig: (4,), height of the tip (m) and the angles (rad) of a rig's axes, for the record.
        """
        for name, value in (("wrench", wrench), ("as_on_rig", as_on_rig)):
            self._inputs[name].FixValue(self.context, value)
        for reached in np.linspace(self._depth, depth, round(seconds / PERIOD) + 1)[1:]:
            self._inputs["depth"].FixValue(self.context, [reached])
            self._steps += 1
            self._simulator.AdvanceTo(self.time)
        self._depth = depth

    def commands(self) -> tuple[Array, float]:
        """Returns the angles (3,) of the hole relative to the start, rad, and the feed speed, m/s."""
        own = self.law.force_guard.GetMyContextFromRoot(self.context)
        angles = [self.law.force_guard.GetOutputPort(f"target_{name}").Eval(own)[0] for name in AXES]
        return np.array(angles), float(self.law.force_guard.GetOutputPort("feed_speed").Eval(own)[0])

    def wrench(self) -> Array:
        """Returns the wrench (6,) that the law takes for sound."""
        own = self.law.monitor.GetMyContextFromRoot(self.context)
        return np.array(self.law.monitor.GetOutputPort("wrench").Eval(own))

    def samples(self) -> pd.DataFrame:
        """Returns what was recorded, `LOGGED_COLUMNS`."""
        return self._recorder.samples(self.context)
