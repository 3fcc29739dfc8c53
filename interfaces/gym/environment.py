"""The environment: one episode is one rig trial."""

from __future__ import annotations

import copy
import math
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from experiments.trial.diagram_trial import TrialRun
from experiments.trial.penetration import MIN_UPRIGHT
from experiments.trial.trial_set import TrialSet, trial_scenario
from interfaces.gym.commanded_policy import CommandedPolicy
from interfaces.gym.picture import Picture
from interfaces.gym.spaces import Observation, action_space, command, observation_space, observe
from models.contact_bodies import ContactLabel
from models.scenario import Scenario, load_scenario, validate_scenario
from skill.arrays import Array
from skill.data.outcome import UNPHYSICAL, Outcome
from skill.features.measurement import contact_load
from skill.policy.rig_policy import RigPolicy
from systems.plant.rig_plant import stepper_axes
from systems.rig import MakeRig
from systems.rig_diagram import RigDiagram

FIRST_DRAWN, LAST_DRAWN = 10_000_000, 2**31 - 1
"""Range of the numbers of trials that a reset without a seed draws. All numbers below are free for evaluations."""

TIME_COST = 0.02  # of the dense reward, in units of 1/s
LOAD_COST = 0.01  # of the dense reward, in units of 1/(N s)
REWARDS = ("dense", "sparse")
RGB_ARRAY = "rgb_array"


class InsertionEnv(gymnasium.Env[Any, Any]):
    """Insertion of a peg on the 3-DOF rig. An episode is a trial, and a step is a period of the controller (20 ms).

    Between the action and the motors are all systems that stand between a policy and the motors in a trial: the
    `PolicyController` with its limits, its back-off and its reversal of turns, the watchdog with all monitors of
    faults, and the force guard. `TrialMonitor` ends and measures the episode, as it does in `run_rig`.

    *Trials.* ``reset(seed=n)`` and ``reset(options={"trial": n})`` start trial n of the set, as `trial_scenario` draws
    it; the option prevails. A reset without either draws a number from `FIRST_DRAWN` on with the generator that the
    last seed has started. The first reset builds the diagram; the others replace its Context.

    *Spaces.* `observation_space` and `action_space` of `interfaces.gym.spaces` have their units and frames.

    *Reward.* Sparse: 1 for the step in which the peg is inserted, else 0. Dense: progress, less time and load, and what
    the end is worth; with the measured depth d (m), the measured load F (N) and the duration T (s) of the step,

        r = (d' - d)/D - TIME_COST T - LOAD_COST T max(0, F' - F_soft)
            + 1                    if the peg is inserted,
            - 1                    at a fault, and if the simulation diverges or fails,
            - TIME_COST (time left)  at any end but insertion.

    D is the way from the start to full depth, so that the progress of an insertion adds up to 1. F_soft is
    `ForceGuardParameters.soft_force`. The last term makes it useless to end an episode early. The progress is the
    difference of a potential, which does not change what is best in the long run (Ng, Harada and Russell 1999, without
    discount).

    *End.* ``terminated``: the peg is inserted, jammed (the controller has nothing new to try), or the rig has stopped
    after a fault; or the simulation diverges or fails, and the last observation is repeated. ``truncated``: the time
    limit of the trial is reached.

    *Info.* At each reset and step: ``trial_number``; ``time``, s; ``contact_label`` and ``contact``, number and name of
    the exact `ContactLabel` of the true pose, -1 and "" where there is none; ``load``, the true load on the peg, N (NaN
    if the simulation has broken down).
    After the last step also ``is_success``, and ``trial``, the record of the `TrialResult`.

    Args:
        scenario: name or file of a scenario, or a scenario.
        engine: of `models.scenario.ENGINES`, in place of the scenario's; "exact" is the fastest.
        trial_set: which trials, "usual" or "hard" (`TrialSet`).
        reward: "dense" or "sparse".
        policy: whose contact states the estimators on the rig follow, as in a trial of this policy. The back-off uses
            them, and the observation has them. The action then has a fourth number, the support. None is one state that
            is always known, and a support of 1.
        labels: whether ``info`` has the contact label, which adds half to the time of a step.
        render_mode: "rgb_array" lets `render` return a picture; `gymnasium.wrappers.HumanRendering` shows it.

    Raises:
        ValueError: for an unknown scenario, set of trials, reward or render mode.
        TypeError: for a policy that is none.
    """

    metadata: dict[str, Any] = {"render_modes": [RGB_ARRAY], "render_fps": 50}

    def __init__(
        self,
        scenario: str | Path | Scenario = "nominal",
        engine: str | None = None,
        *,
        trial_set: str = TrialSet.USUAL,
        reward: str = "dense",
        policy: RigPolicy | None = None,
        labels: bool = True,
        render_mode: str | None = None,
    ) -> None:
        if reward not in REWARDS or render_mode not in (None, RGB_ARRAY):
            raise ValueError(f"reward is {reward!r}, expected one of {REWARDS}; render_mode is {render_mode!r}")
        if policy is not None and not hasattr(policy, "estimator"):
            raise TypeError(f"policy is {policy!r}, expected a policy such as a ManipulationSkill, or None")
        self._scenario = copy.deepcopy(scenario) if isinstance(scenario, Scenario) else load_scenario(scenario)
        self._scenario.contact.engine = engine or self._scenario.contact.engine
        validate_scenario(self._scenario)
        self._bodies, self._lever = self._scenario.geometry.assembly, self._scenario.geometry.reach
        self._trial_set, self._labels, self._is_sparse = TrialSet(trial_set), labels, reward == "sparse"
        self._policy = CommandedPolicy(policy)
        self.metadata = {**self.metadata, "render_fps": round(1.0 / self._scenario.controller.period)}
        self.render_mode = render_mode
        self.observation_space = observation_space(self._scenario, policy)
        self.action_space = action_space(self._scenario, supported=policy is not None)
        self._axes = len(stepper_axes(self._scenario))
        self._picture: Picture | None = None
        self._rig: RigDiagram | None = None
        self._run: TrialRun | None = None
        self._number = self._steps = 0
        self._last: Observation = {}
        self._wrench = np.zeros(6)  # measured with the last observation, N and N m

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Starts a trial; see the class.

        Raises:
            ValueError: if the number of the trial is negative, if the scenario has no trial of the set, or if the
                policy was trained for another peg or hole.
        """
        super().reset(seed=seed)
        number = (options or {}).get("trial", seed)
        self._number = int(self.np_random.integers(FIRST_DRAWN, LAST_DRAWN)) if number is None else number
        scenario = trial_scenario(self._scenario, number=self._number, trial_set=self._trial_set)
        self._rig = self._rig or MakeRig(scenario, self._policy)
        self._run, self._steps = TrialRun(self._rig, scenario, number=self._number), 0
        self._run.simulator.Initialize()
        self._look(self._rig, self._run)
        return copy.deepcopy(self._last), self._info(self._rig, self._run)

    def step(self, action: Array) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Simulates one period of the controller with an action, or less if the trial ends; see the class.

        Raises:
            ValueError: if the action has the wrong shape, or is NaN or infinite.
            gymnasium.error.ResetNeeded: if there is no episode, or it is over.
        """
        rig, run = self._rig, self._run
        if rig is None or run is None or run.has_ended:
            raise gymnasium.error.ResetNeeded("the episode is over, or none has begun: call reset() before step()")
        self._policy.command[:] = command(action, spaces.flatdim(self.action_space), self._axes)
        before, began = self._last, run.context.get_time()
        self._steps += 1
        run.advance(min(self._steps * self._scenario.controller.period, self._scenario.trial.time_limit))
        outcome = run.monitor.outcome
        if outcome not in UNPHYSICAL:  # a broken simulation shows nothing more
            self._look(rig, run)
        terminated = outcome is not Outcome.TIME_OVER
        info = self._info(rig, run)
        if run.has_ended:
            result = run.ended().result
            info |= {"is_success": result.inserted, "trial": result.record()}
        reward = self._reward(
            outcome,
            progress=float(self._last["depth"][0]) - float(before["depth"][0]),
            duration=run.context.get_time() - began,
            remaining=max(0.0, self._scenario.trial.time_limit - run.context.get_time()),
        )
        return copy.deepcopy(self._last), reward, terminated, run.has_ended and not terminated, info

    def render(self) -> NDArray[np.uint8] | None:  # type: ignore[override]
        """Returns the picture (480, 480, 3) for "rgb_array", else None.

        Raises:
            gymnasium.error.ResetNeeded: if no episode has begun.
        """
        if self.render_mode is None:
            return None
        if self._rig is None or self._run is None:
            raise gymnasium.error.ResetNeeded("there is nothing to draw: call reset() before render()")
        self._picture = self._picture or Picture(self._scenario.geometry)
        return self._picture.draw(*self._rig.poses(self._run.context))

    def close(self) -> None:
        """Ends the episode."""
        self._rig = self._run = self._picture = None

    def _look(self, rig: RigDiagram, run: TrialRun) -> None:
        """Keeps the present observation, within the bounds that a sound trial does not leave, and the wrench."""
        found, self._wrench = observe(rig, run.context)
        boxes = self.observation_space.items()  # type: ignore[attr-defined]
        self._last = {name: np.clip(found[name], box.low, box.high) for name, box in boxes}

    def _reward(self, outcome: Outcome, *, progress: float, duration: float, remaining: float) -> float:
        """Returns the reward of a step that has made progress (m) in a duration (s) and leaves a time (s)."""
        if self._is_sparse:
            return float(outcome is Outcome.INSERTED)
        way = self._scenario.full_depth + self._scenario.start.height
        excess = max(0.0, contact_load(self._wrench, self._lever) - self._scenario.controller.guard.soft_force)
        reward = progress / way - duration * (TIME_COST + LOAD_COST * excess)
        if outcome is Outcome.INSERTED:
            return reward + 1.0
        if outcome is not Outcome.TIME_OVER:
            is_broken = outcome is Outcome.FAULT or outcome in UNPHYSICAL
            reward -= TIME_COST * remaining + float(is_broken)
        return reward

    def _info(self, rig: RigDiagram, run: TrialRun) -> dict[str, Any]:
        is_sound = run.monitor.outcome not in UNPHYSICAL
        fx, fy, fz, mx, my, mz = rig.contact_wrench(run.context).tolist() if is_sound else [math.nan] * 6
        r = self._scenario.geometry.peg_radius
        load = math.hypot(fx, fy, fz, mx / r, my / r, mz / r)
        info: dict[str, Any] = {"trial_number": self._number, "time": run.context.get_time(), "load": load}
        if self._labels:
            label = self._contact_label(rig, run) if is_sound else None
            info["contact_label"] = -1 if label is None else int(label)
            info["contact"] = "" if label is None else label.label
        return info

    def _contact_label(self, rig: RigDiagram, run: TrialRun) -> ContactLabel | None:
        """Returns the exact contact state of the true pose; None for a tilt above 44.9 degrees, which has none."""
        X_HP = rig.plant.peg_in_hole(run.context)
        p_HP, R_HP = X_HP.translation(), X_HP.rotation().matrix()
        if not (np.isfinite(p_HP).all() and R_HP[2, 2] > MIN_UPRIGHT):
            return None
        return ContactLabel(int(self._bodies.label(p_HP[None], R_HP[None])[0]))
