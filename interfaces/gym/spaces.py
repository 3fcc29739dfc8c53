"""The spaces of the environment: what the rig measures, and what an agent commands."""

from __future__ import annotations

import numpy as np
from gymnasium import spaces
from pydrake.systems.framework import Context

from models.scenario import Scenario
from skill.arrays import Array
from skill.policy.rig_policy import RigPolicy
from skill.replaced_wrench import ReplacedEstimate
from skill.states.estimate import Estimate
from systems.plant.rig_plant import stepper_axes
from systems.rig_diagram import RigDiagram

Observation = dict[str, Array]

DEPTH_MARGIN = 0.05
"""Distance (m) from the travel limits of the feed to the bounds of the depth: no sound trial gets there."""


ROUNDING = 1e-9
"""A probability may exceed 1 by rounding."""


def observation_space(scenario: Scenario, policy: RigPolicy | None) -> spaces.Dict:
    """Returns the space of the observations.

    * ``wrench`` (6,): measured force (N), then moment (N m), on the peg about its tip, in P;
    * ``depth`` (1,): measured depth of the tip below the mouth, m;
    * ``angles`` (n,): commanded angles of the n axes of the hole, relative to the start, as the force guard permits,
      rad: pitch and yaw, and clocking if the rig has that stage;
    * ``feed`` (1,): commanded feed speed, as the force guard permits, m/s, negative into the hole;
    * ``control`` (2,): 1 where the controller applies the agent's turns, -1 where it reverses them, 0 where it does not
      apply them; then 1 while it backs the peg off, else 0;

    and with a policy, what its estimators on the rig find,

    * ``probabilities`` (K,) of its contact states;

    The bounds follow from the range of the sensor and from the limits of the controller.
    """
    sensor, controller, start = scenario.sensor, scenario.controller, scenario.start
    force = np.array(sensor.force_range) + sensor.force_quantum
    moment = np.array(sensor.torque_range) + sensor.torque_quantum
    moment = moment + sensor.height * np.array([force[1], force[0], 0.0])  # about the tip instead of the sensor
    deepest = scenario.geometry.hole_depth + controller.drive_monitor.travel_below + DEPTH_MARGIN
    highest = start.height + controller.drive_monitor.travel_above + DEPTH_MARGIN
    fastest = controller.max_feed_speed + controller.back_off.retract_speed
    estimator = None if policy is None else policy.estimator()
    estimate = Estimate() if estimator is None else estimator.initial()
    parts = {} if policy is None else {"probabilities": _shares(estimate.states)}
    return spaces.Dict(
        {
            **parts,
            "wrench": symmetric(np.concatenate([force, moment])),
            "depth": spaces.Box(np.array([-highest]), np.array([deepest]), dtype=np.float64),
            "angles": symmetric(np.full(len(stepper_axes(scenario)), controller.max_turn)),
            "feed": symmetric(np.array([fastest])),
            "control": spaces.Box(np.array([-1.0, 0.0]), np.ones(2), dtype=np.float64),
        }
    )


def action_space(scenario: Scenario, *, supported: bool) -> spaces.Box:
    """Returns the space of the actions (3,) to (5,).

    Turn rates of the peg relative to the hole about x and y of P, and about z if the rig has a clocking stage, rad/s;
    feed speed, m/s, negative into the hole; and the support of the action, 0 to 1, if ``supported``. The bounds are the
    limits of the controller.
    """
    p = scenario.controller
    largest = np.array([*[p.max_turn_rate] * len(stepper_axes(scenario)), p.max_feed_speed])
    if not supported:
        return symmetric(largest)
    return spaces.Box(np.append(-largest, 0.0), np.append(largest, 1.0), dtype=np.float64)


def symmetric(largest: Array) -> spaces.Box:
    """Returns the box from -``largest`` to ``largest``."""
    return spaces.Box(-largest, largest, dtype=np.float64)


def _shares(probabilities: Array) -> spaces.Box:
    """Returns the box of such probabilities."""
    return spaces.Box(np.zeros_like(probabilities), np.full_like(probabilities, 1.0 + ROUNDING), dtype=np.float64)


def command(action: object, size: int, axes: int) -> Array:
    """Returns an action as the command (5,) of a `CommandedPolicy`; the support is 1 if the action has none.

    A finite action outside the space is permitted: the controller limits it, as that of every policy.

    Args:
        action: numbers of the space of actions.
        size: how many there are.
        axes: number of the axes of the hole.

    Raises:
        ValueError: if the shape is wrong, or a number is NaN or infinite.
    """
    values = np.asarray(action, dtype=float)
    if values.shape != (size,) or not np.isfinite(values).all():
        raise ValueError(f"action {action}: expected {size} finite numbers (turn rates, feed speed), shape ({size},)")
    turns, others = np.zeros(3), np.array([0.0, 1.0])
    turns[:axes], others[: size - axes] = values[:axes], values[axes:]
    return np.concatenate([turns, others])


def observe(rig: RigDiagram, context: Context) -> tuple[Observation, Array]:
    """Returns what the rig measures, estimates and commands now, with or without a policy; and the measured wrench.

    The wrench (6,), N and N m, is that of the sensor, whatever the policy receives of it.
    """
    controller, guard = rig.law.controller, rig.law.force_guard
    own, guards = controller.GetMyContextFromRoot(context), guard.GetMyContextFromRoot(context)
    wrench, depth = (np.array(controller.GetInputPort(name).Eval(own)) for name in ("wrench", "depth"))
    estimate: Estimate = controller.GetInputPort("estimate").Eval(own)
    received = estimate.measured[:6].copy() if isinstance(estimate, ReplacedEstimate) else wrench
    modes = [controller.GetOutputPort(name).Eval(own)[0] for name in ("turning", "back_off")]
    commands = (*(f"target_{axis}" for axis in stepper_axes(rig.scenario)), "feed_speed")
    *targets, feed = (guard.GetOutputPort(name).Eval(guards)[0] for name in commands)
    found = {
        "probabilities": estimate.states,
        "wrench": received,
        "depth": depth,
        "angles": np.array(targets),
        "feed": np.array([feed]),
        "control": np.array(modes),
    }
    return found, wrench
