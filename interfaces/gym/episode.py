"""A rig trial that is simulated period by period."""

from __future__ import annotations

import math

import numpy as np
from pydrake.math import RigidTransform

from experiments.trial.diagram_trial import TrialRun
from experiments.trial.penetration import MIN_UPRIGHT
from experiments.trial.trial_result import TrialResult
from models.exact_geometry import ContactLabel
from models.scenario import Scenario
from skill.arrays import Array
from skill.data.outcome import UNPHYSICAL, Outcome
from skill.replaced_wrench import ReplacedEstimate
from skill.states.estimate import Estimate
from systems.plant.rig_plant import stepper_axes
from systems.rig_diagram import RigDiagram

Observation = dict[str, Array]


class Episode:
    """A trial that stops before each decision of the policy.

    It is the simulation of `run_rig`, with the same monitor and the same result, in steps of one controller period. The
    policy is called at the start of a step, with what `observation` returns before the step.

    Args:
        rig: built from the same scenario, resolved with any seed.
        scenario: resolved with the seed of the trial.
        number: number of the trial.
    """

    def __init__(self, rig: RigDiagram, scenario: Scenario, number: int) -> None:
        self._rig, self._scenario = rig, scenario
        self._bodies = scenario.geometry.assembly
        self._run = TrialRun(rig, scenario, number=number)
        self._context = self._run.context
        self._run.simulator.Initialize()
        self._steps = 0

    @property
    def time(self) -> float:
        """Simulated time, s."""
        return float(self._context.get_time())

    @property
    def outcome(self) -> Outcome:
        """How the trial has ended; ``TIME_OVER`` as long as nothing else has ended it."""
        return self._run.monitor.outcome

    @property
    def time_is_over(self) -> bool:
        """Whether the time limit is reached."""
        return self.time >= self._scenario.trial.time_limit

    def advance(self) -> None:
        """Simulates one controller period, or less if the trial ends; errors become outcomes as in `run_rig`."""
        self._steps += 1
        self._run.advance(min(self._steps * self._scenario.controller.period, self._scenario.trial.time_limit))

    def observation(self) -> Observation:
        """Returns what the rig measures, estimates and commands now.

        `observation_space` has the parts and their units; here are always ``probabilities`` too.
        """
        rig = self._rig
        context = rig.law.controller.GetMyContextFromRoot(self._context)
        found = {name: np.array(rig.law.controller.GetInputPort(name).Eval(context)) for name in ("wrench", "depth")}
        estimate: Estimate = rig.law.controller.GetInputPort("estimate").Eval(context)
        if isinstance(estimate, ReplacedEstimate):
            found["wrench"] = estimate.measured[:6].copy()
        found["probabilities"] = estimate.states
        modes = [rig.law.controller.GetOutputPort(name).Eval(context)[0] for name in ("turning", "back_off")]
        guard = rig.law.force_guard.GetMyContextFromRoot(self._context)
        commands = [f"target_{axis}" for axis in stepper_axes(self._scenario)]
        *targets, feed = (rig.law.force_guard.GetOutputPort(name).Eval(guard)[0] for name in (*commands, "feed_speed"))
        return {**found, "angles": np.array(targets), "feed": np.array([feed]), "control": np.array(modes)}

    def measured_wrench(self) -> Array:
        """Returns the wrench (6,) that the rig measures, N and N m, whatever its policy receives."""
        own = self._rig.law.controller.GetMyContextFromRoot(self._context)
        return np.array(self._rig.law.controller.GetInputPort("wrench").Eval(own))

    def contact_label(self) -> ContactLabel | None:
        """Returns the exact contact state of the true pose, or None where it is not defined.

        That is in a simulation that has diverged, and for a tilt above 44.9 degrees.
        """
        X_HP = self._rig.plant.peg_in_hole(self._context)
        p_HP, R_HP = X_HP.translation(), X_HP.rotation().matrix()
        if self.outcome in UNPHYSICAL or not (np.isfinite(p_HP).all() and R_HP[2, 2] > MIN_UPRIGHT):
            return None
        return ContactLabel(int(self._bodies.label(p_HP[None], R_HP[None])[0]))

    def poses(self) -> tuple[RigidTransform, RigidTransform]:
        """Returns the poses X_WP of the peg and X_WH of the block for a picture; see `RigDiagram.poses`."""
        return self._rig.poses(self._context)

    def true_load(self) -> float:
        """Returns the load sqrt(|f|^2 + |m/r|^2) of the true wrench on the peg about its tip, N.

        It is NaN after the simulation has diverged or failed.
        """
        if self.outcome in UNPHYSICAL:
            return math.nan
        fx, fy, fz, mx, my, mz = self._rig.contact_wrench(self._context).tolist()
        r = self._scenario.geometry.peg_radius
        return math.hypot(fx, fy, fz, mx / r, my / r, mz / r)

    def result(self) -> TrialResult:
        """Returns the result of the trial up to now."""
        return self._run.ended().result
