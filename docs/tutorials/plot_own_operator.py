"""
Your own operator or device
===========================

Demonstrate with an operator of your own: a LeafSystem that moves the probe of the haptic device.
"""

# %%
# An operator has an output ``hand_pose``, the pose to which it moves the probe, in the frame of the hole. The inputs
# ``peg_pose`` and ``rendered_wrench`` are optional: what it sees and what it feels. This one approaches, takes half a
# second to align with what it sees, and pushes.

import matplotlib.pyplot as plt
import numpy as np
from pydrake.common.value import Value
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.framework import LeafSystem

from experiments.demonstration_run import DemonstrationRun
from models.scenario import DEMONSTRATION_STREAM, load_scenario, resolve_scenario
from skill.data.outcome import Ending, Outcome
from systems.virtual_environment import MakeVirtualEnvironment, start_pose


class AlignThenPush(LeafSystem):
    """
    .. pydrake_system::

        name: AlignThenPush
        output_ports:
        - hand_pose

    Waits at the start, aligns the axes within half a second, and pushes along the axis of the hole.
    """

    def __init__(self, X_HP_start: RigidTransform, *, speed: float) -> None:
        LeafSystem.__init__(self)
        self._X_HP_start, self._speed = X_HP_start, speed
        self._axis = X_HP_start.rotation().ToAngleAxis()
        self.DeclareAbstractOutputPort(
            "hand_pose", lambda: Value(RigidTransform()), self._calc, prerequisites_of_calc={self.time_ticket()}
        )

    def _calc(self, context, output) -> None:
        time = context.get_time()
        tilted = 1.0 - np.clip((time - 0.2) / 0.5, 0.0, 1.0)
        turned = RotationMatrix(type(self._axis)(tilted * self._axis.angle(), self._axis.axis()))
        down = self._speed * max(0.0, time - 0.7)
        position = self._X_HP_start.translation() * [tilted, tilted, 1.0] - [0.0, 0.0, down]
        output.set_value(RigidTransform(turned, position))


# %%
# The virtual environment connects the operator to the device, the proxy and the contact. Its log has the fourteen
# channels that the skill learns from.

scenario = resolve_scenario(load_scenario("nominal"), seed=0, stream=DEMONSTRATION_STREAM)
operator = AlignThenPush(start_pose(scenario), speed=0.02)
run = DemonstrationRun(scenario, MakeVirtualEnvironment(scenario, operator=operator))
ending = run.advance(scenario.recorder.time_limit) or Ending(Outcome.TIME_OVER)
demonstration = run.demonstration(ending)
print(f"{demonstration.reason} after {demonstration.duration:.1f} s, {len(demonstration.samples)} samples")

# %%
# An operator that does not feel the forces slides in when it is aligned well. The rendered forces:

samples = demonstration.samples
figure, (above, below) = plt.subplots(2, 1, sharex=True, layout="constrained")
above.plot(samples["time"], -1e3 * samples["z"])
above.set_ylabel("depth [mm]")
for name in ("fx", "fy", "fz"):
    below.plot(samples["time"], samples[name], label=name)
below.set(xlabel="time [s]", ylabel="force on the peg [N]")
below.legend()
figure.align_labels()

# %%
# A device of your own
# --------------------
#
# A driver of a haptic device is a class with three methods, which are called each millisecond:
#
# .. code-block:: python
#
#     class MyDevice:
#         def read_pose(self) -> RigidTransform: ...            # motion of the handle since it was opened, in H
#         def write_wrench(self, wrench) -> None: ...           # [torque; force], N m and N, in H
#         def close(self) -> None: ...                          # motors off
#
# A package provides it under a name, in its ``pyproject.toml``:
#
# .. code-block:: toml
#
#     [project.entry-points."haptic_skill.devices"]
#     mydevice = "my_package:MyDevice"
#
# ``haptic-skill record --live --driver mydevice`` then uses it. :doc:`/haptics` says what happens when it is
# disconnected.
