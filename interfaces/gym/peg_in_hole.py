"""The environment: one episode is one rig trial."""

from __future__ import annotations

import copy
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from experiments.trial.trial_set import TrialSet, trial_scenario
from interfaces.gym.commanded_policy import CommandedPolicy
from interfaces.gym.episode import Episode, Observation
from interfaces.gym.picture import Picture
from interfaces.gym.rewards import REWARDS, Reward, Transition
from interfaces.gym.spaces import action_space, checked_action, observation_space
from models.scenario import Scenario, load_scenario, validate_scenario
from skill.arrays import Array
from skill.data.outcome import UNPHYSICAL, Outcome
from skill.features.measurement import contact_load
from skill.policy import RigPolicy
from systems.plant.rig_plant import stepper_axes
from systems.rig import MakeRig
from systems.rig_diagram import RigDiagram

FIRST_DRAWN, LAST_DRAWN = 10_000_000, 2**31 - 1
"""Range of the numbers of trials that a reset without a seed draws. All numbers below are free for evaluations."""

OBSERVATIONS = ("dict", "flat")
RGB_ARRAY = "rgb_array"


class PegInHole(gymnasium.Env[Any, Any]):
    """Insertion of a peg on the 3-DOF rig. An episode is a trial, and a step is a period of the controller (20 ms).

    Between the action and the motors are all systems that stand between a policy and the motors in a trial: the
    `PolicyController` with its limits, its back-off and its reversal of turns, the watchdog with all monitors of
    faults, and the force guard. `TrialMonitor` ends and measures the episode.

    *Trials.* ``reset(seed=n)`` and ``reset(options={"trial": n})`` start trial n of the set, as `trial_scenario` draws
    it; the option prevails. A reset without either draws a number from `FIRST_DRAWN` on with the generator that the
    last seed has started. The first reset builds the diagram; the others replace its Context.

    *Spaces.* `observation_space` and `action_space` of `interfaces.gym.spaces` have their units and frames. The flat
    observation is that of `gymnasium.spaces.flatten`.

    *Reward.* `DenseReward` or `sparse_reward` of `interfaces.gym.rewards`.

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
        observation: "dict" or "flat".
        reward: "dense" or "sparse".
        policy: whose contact states the estimator on the rig follows, as in a trial of this policy. The
            back-off uses them, and the observation has them. The action then has a fourth number, the support. None is
            one state that is always known, and a support of 1.
        labels: whether ``info`` has the contact label, which adds half to the time of a step.
        render_mode: "rgb_array" lets `render` return a picture; `gymnasium.wrappers.HumanRendering` shows it.

    Raises:
        ValueError: for an unknown scenario, set of trials, observation, reward or render mode.
    """

    metadata: dict[str, Any] = {"render_modes": [RGB_ARRAY], "render_fps": 50}

    def __init__(
        self,
        scenario: str | Path | Scenario = "nominal",
        engine: str | None = None,
        *,
        trial_set: str = TrialSet.USUAL,
        observation: str = "dict",
        reward: str = "dense",
        policy: RigPolicy | None = None,
        labels: bool = True,
        render_mode: str | None = None,
    ) -> None:
        _check_choice("trial_set", trial_set, [choice.value for choice in TrialSet])
        _check_choice("observation", observation, list(OBSERVATIONS))
        _check_choice("reward", reward, list(REWARDS))
        _check_choice("render_mode", render_mode, [None, RGB_ARRAY])
        self._scenario = copy.deepcopy(scenario) if isinstance(scenario, Scenario) else load_scenario(scenario)
        self._lever = self._scenario.geometry.reach  # which every step needs
        self._scenario.contact.engine = engine or self._scenario.contact.engine
        validate_scenario(self._scenario)
        self._trial_set, self._labels = TrialSet(trial_set), labels
        self._reward: Reward = REWARDS[reward](self._scenario)
        self._policy = CommandedPolicy(policy)
        self.metadata = {**self.metadata, "render_fps": round(1.0 / self._scenario.controller.period)}
        self.render_mode = render_mode
        self._parts = observation_space(self._scenario, policy)
        self._boxes = {name: box for name, box in self._parts.items() if isinstance(box, spaces.Box)}
        self._flat = observation == "flat"
        self.observation_space = spaces.flatten_space(self._parts) if self._flat else self._parts
        self.action_space = action_space(self._scenario, supported=policy is not None)
        self._action_size, self._axes = spaces.flatdim(self.action_space), len(stepper_axes(self._scenario))
        self._picture: Picture | None = None
        self._rig: RigDiagram | None = None
        self._episode: Episode | None = None
        self._number = 0
        self._last: Observation = {}
        self._wrench = np.zeros(6)  # measured with the last observation, N and N m
        self._over = True

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation | Array, dict[str, Any]]:
        """Starts a trial; see the class.

        Raises:
            ValueError: if an option is unknown or no number of a trial, if the scenario has no such trial, or if
                the policy was trained for another peg or hole.
        """
        super().reset(seed=seed)
        number = _trial_option(options)
        if number is None:
            number = seed if seed is not None else int(self.np_random.integers(FIRST_DRAWN, LAST_DRAWN))
        scenario = trial_scenario(self._scenario, number=number, trial_set=self._trial_set)
        self._rig = self._rig or MakeRig(scenario, self._policy)
        self._episode = Episode(self._rig, scenario, number)
        self._number, self._over = number, False
        self._last, self._wrench = self._observe(self._episode), self._episode.measured_wrench()
        return self._shown(self._last), self._info(self._episode)

    def step(self, action: Array) -> tuple[Observation | Array, float, bool, bool, dict[str, Any]]:
        """Simulates one period of the controller with an action; see the class.

        Raises:
            ValueError: if the action has the wrong shape, or is NaN or infinite.
            gymnasium.error.ResetNeeded: if there is no episode, or it is over.
        """
        episode = self._episode
        if episode is None or self._over:
            raise gymnasium.error.ResetNeeded("the episode is over, or none has begun: call reset() before step()")
        self._policy.command[:] = checked_action(action, self._action_size, self._axes)
        before, began = self._last, episode.time
        episode.advance()
        terminated = episode.outcome is not Outcome.TIME_OVER
        truncated = not terminated and episode.time_is_over
        self._over = terminated or truncated
        if episode.outcome not in UNPHYSICAL:  # a broken simulation shows nothing more
            self._last, self._wrench = self._observe(episode), episode.measured_wrench()
        reward = self._reward(
            Transition(
                depth_before=float(before["depth"][0]),
                depth=float(self._last["depth"][0]),
                load=contact_load(self._wrench, self._lever),
                duration=episode.time - began,
                remaining=max(0.0, self._scenario.trial.time_limit - episode.time),
                outcome=episode.outcome if terminated else None,
            )
        )
        info = self._info(episode)
        if self._over:
            result = episode.result()
            info |= {"is_success": result.inserted, "trial": result.record()}
        return self._shown(self._last), reward, terminated, truncated, info

    def render(self) -> NDArray[np.uint8] | None:  # type: ignore[override]
        """Returns the picture (480, 480, 3) for "rgb_array", else None.

        Raises:
            gymnasium.error.ResetNeeded: if no episode has begun.
        """
        if self.render_mode != RGB_ARRAY:
            return None
        if self._episode is None:
            raise gymnasium.error.ResetNeeded("there is nothing to draw: call reset() before render()")
        self._picture = self._picture or Picture(self._scenario.geometry)
        return self._picture.draw(*self._episode.poses())

    def close(self) -> None:
        """Ends the episode."""
        self._rig = self._episode = self._picture = None
        self._over = True

    def __getstate__(self) -> dict[str, Any]:
        """Leaves out the episode, which a copy begins with `reset`: a diagram of Drake cannot be pickled."""
        return {**vars(self), "_rig": None, "_episode": None, "_picture": None, "_over": True}

    def _observe(self, episode: Episode) -> Observation:
        """Returns the present observation within the bounds, which a sound trial does not leave."""
        found = episode.observation()
        return {name: np.clip(found[name], box.low, box.high) for name, box in self._boxes.items()}

    def _shown(self, parts: Observation) -> Observation | Array:
        """Returns a copy of an observation in the form that was asked for."""
        if self._flat:
            return np.asarray(spaces.flatten(self._parts, parts))
        return {name: value.copy() for name, value in parts.items()}

    def _info(self, episode: Episode) -> dict[str, Any]:
        info: dict[str, Any] = {"trial_number": self._number, "time": episode.time, "load": episode.true_load()}
        if self._labels:
            label = episode.contact_label()
            info["contact_label"] = -1 if label is None else int(label)
            info["contact"] = "" if label is None else label.label
        return info


def _check_choice(name: str, found: object, expected: list[Any]) -> None:
    if found not in expected:
        raise ValueError(f"{name} is {found!r}; expected one of {expected}")


def _trial_option(options: dict[str, Any] | None) -> int | None:
    """Returns the number of a trial in the options of a reset, or None.

    Raises:
        ValueError: if there is another option, or the number is not a whole number of at least 0.
    """
    options = options or {}
    if unknown := sorted(set(options) - {"trial"}):
        raise ValueError(f"options of reset: {unknown}; expected 'trial' only")
    number = options.get("trial")
    if number is None:
        return None
    if isinstance(number, bool) or not isinstance(number, int | np.integer) or number < 0:
        raise ValueError(f"options of reset: trial is {number!r}; expected a whole number of at least 0")
    return int(number)
