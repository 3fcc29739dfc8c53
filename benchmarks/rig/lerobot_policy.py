"""Imitation policies of LeRobot, trained on demonstrations and run on the rig: ACT and Diffusion Policy.

They are given what the rig measures: height of the tip and own turns as ``observation.state``, the wrench as
``observation.environment_state``. They predict the recorded motion of the hand at every sample: the turn of the peg
about x and y of P, and the feed. Everything is in P, as it was recorded; `turned` shows them the symmetry of the task,
which the skill has in its canonical frame: copies of each demonstration, turned about the axis of the peg, with the
noise of the sensor. `imitation` is for sweeps. Training and decisions use one thread.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from lerobot.configs.types import FeatureType, NormalizationMode
from lerobot.datasets.factory import resolve_delta_timestamps
from lerobot.datasets.lerobot_dataset import LeRobotDataset
from lerobot.datasets.utils import dataset_to_policy_features
from lerobot.policies.act.configuration_act import ACTConfig
from lerobot.policies.diffusion.configuration_diffusion import DiffusionConfig
from lerobot.policies.factory import get_policy_class, make_pre_post_processors
from numpy.typing import ArrayLike
from torch.utils.data import DataLoader, default_collate

from experiments.sweep.policies import TrainingContext
from interfaces.exports.episodes import WRENCH, WRENCH_UNITS, Episode, Feature, frame_rate
from interfaces.exports.lerobot import LeRobotWriter
from skill.arrays import Array
from skill.data.demonstration import Demonstration
from skill.data.refinement import with_following_actions
from skill.features.training_samples import observed_series
from skill.policy import Action
from skill.states.estimate import Estimate
from systems.control.control_law import ControlLaw

FEATURES = {
    "observation.state": Feature("float32", ("z", "turned_x", "turned_y"), ("m", "rad", "rad"), "in H and P"),
    "observation.environment_state": Feature("float32", WRENCH, WRENCH_UNITS, "on the peg about its tip, in P"),
    "action": Feature("float32", ("turn_x", "turn_y", "feed"), ("rad", "rad", "m"), "until the next frame, in P"),
}

NORMALIZED = {kind.value: NormalizationMode.MEAN_STD for kind in (FeatureType.STATE, FeatureType.ENV)}
"""Both kinds of observations are normalised; by default LeRobot leaves the environment state as it is."""

FORCE_NOISE, MOMENT_NOISE = 0.06, 5e-3
"""Standard deviations of the noise that is added, N and N m, as for `ManipulationSkill`."""

BATCH = 64
RATE = 5e-4
"""Learning rate; it falls to zero over the training. Those of LeRobot are for networks with images."""


torch.set_num_threads(1)  # here, because a worker that unpickles a policy imports this module and trains nothing


def imitation(
    training_context: TrainingContext, policy: str = "act", minutes: float = 10.0, copies: int = 8, seed: int = 0
) -> LeRobotLaw:
    """A policy of LeRobot that imitates the good demonstrations of a training context; see `train`."""
    good = [demonstration for demonstration in training_context.demonstrations if demonstration.good]
    with tempfile.TemporaryDirectory() as folder:
        write_training_set(good, Path(folder), copies=copies, seed=seed)
        return train(policy, Path(folder), seconds=60.0 * minutes, seed=seed)


def policy_config(name: str) -> Any:
    """Returns the configuration of "act" or "diffusion": that of LeRobot, with small networks.

    Raises:
        ValueError: if there is no such policy.
    """
    size: dict[str, Any]
    if name == "act":
        layers = {"n_encoder_layers": 2, "n_vae_encoder_layers": 2}
        small = {"dim_model": 64, "n_heads": 4, "dim_feedforward": 256, "latent_dim": 8, **layers}
        size = {"chunk_size": 16, "n_action_steps": 1, "temporal_ensemble_coeff": 0.01}
        mapping = {**NORMALIZED, "ACTION": NormalizationMode.MEAN_STD}
        return ACTConfig(device="cpu", push_to_hub=False, normalization_mapping=mapping, **small, **size)
    if name == "diffusion":
        size = {"horizon": 16, "n_obs_steps": 2, "n_action_steps": 4, "down_dims": (32, 64, 128)}
        sampler = {"noise_scheduler_type": "DDIM", "num_inference_steps": 10}
        mapping = dict.fromkeys([*NORMALIZED, "ACTION"], NormalizationMode.MIN_MAX)
        return DiffusionConfig(device="cpu", push_to_hub=False, normalization_mapping=mapping, **size, **sampler)
    raise ValueError(f"policy {name!r}, expected 'act' or 'diffusion'")


def turned(vectors: Array, angle: float) -> Array:
    """Returns vectors (n, 2) or (n, 3), turned about z by an angle, rad."""
    c, s = np.cos(angle), np.sin(angle)
    found = vectors.copy()
    found[:, 0], found[:, 1] = c * vectors[:, 0] - s * vectors[:, 1], s * vectors[:, 0] + c * vectors[:, 1]
    return found


def write_training_set(demonstrations: Sequence[Demonstration], folder: Path, *, copies: int, seed: int) -> None:
    """Writes the data set of LeRobot from which policies are trained.

    Args:
        demonstrations: to imitate.
        folder: an empty folder.
        copies: of each demonstration, the first unturned; all have noise of their own.
        seed: of angles and noise.
    """
    rng = np.random.default_rng(seed)
    fps = frame_rate(demonstrations[0].samples["time"].to_numpy(), "the first demonstration")
    writer = LeRobotWriter(folder, fps=fps, features=FEATURES, robot="3-DOF rig")
    for number, demonstration in enumerate(demonstrations):
        series = observed_series(demonstration.samples)
        action = with_following_actions(demonstration.samples)[["rx", "ry", "uz"]].to_numpy()
        for copy in range(copies):
            angle = rng.uniform(-np.pi, np.pi) if copy else 0.0
            noise = rng.standard_normal((len(series), 6)) * np.repeat([FORCE_NOISE, MOMENT_NOISE], 3)
            force, moment = (turned(part, angle) for part in (series[:, :3], series[:, 3:6]))
            columns = {
                "observation.state": np.column_stack([series[:, 6], turned(series[:, 7:9], angle)]),
                "observation.environment_state": np.hstack([force, moment]) + noise,
                "action": np.column_stack([turned(action[:, :2], angle), action[:, 2]]),
            }
            columns = {key: values.astype(np.float32) for key, values in columns.items()}
            writer.add(Episode(f"{number}_{copy}", str(demonstration.outcome), columns, {}))
    writer.finish({"kind": "training set"})


def train(name: str, folder: Path, *, seconds: float, seed: int) -> LeRobotLaw:
    """Trains a policy on a data set for a time, and returns it as a control law.

    Args:
        name: "act" or "diffusion".
        folder: of the data set.
        seconds: of CPU time of the training, without the reading of the data.
        seed: of the weights and the batches.
    """
    torch.manual_seed(seed)
    config = policy_config(name)
    data = LeRobotDataset("local/demonstrations", root=folder)
    features = dataset_to_policy_features(data.meta.features)
    config.output_features = {key: f for key, f in features.items() if f.type is FeatureType.ACTION}
    config.input_features = {key: f for key, f in features.items() if key not in config.output_features}
    data = LeRobotDataset(
        "local/demonstrations", root=folder, delta_timestamps=resolve_delta_timestamps(config, data.meta)
    )
    policy = get_policy_class(name)(config)
    before, after = make_pre_post_processors(config, dataset_stats=data.meta.stats)
    frames = _in_memory(data, [*features, "action_is_pad"])
    optimizer = torch.optim.AdamW(policy.parameters(), lr=RATE, weight_decay=1e-4)
    policy.train()
    count = len(data)
    cpu = time.process_time()
    while (spent := time.process_time() - cpu) < seconds:
        for group in optimizer.param_groups:
            group["lr"] = RATE * (1.0 - spent / seconds)
        rows = torch.randint(count, (BATCH,))
        loss, _ = policy.forward(before({key: values[rows] for key, values in frames.items()}))
        optimizer.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(policy.parameters(), 10.0)
        optimizer.step()
    return LeRobotLaw(policy, before, after)


def _in_memory(data: LeRobotDataset, keys: Sequence[str]) -> dict[str, torch.Tensor]:
    """All frames of a data set with their windows, which LeRobot reads one by one."""
    rows = DataLoader(
        data, batch_size=512, collate_fn=lambda items: default_collate([{k: i[k] for k in keys} for i in items])
    )
    parts = list(rows)
    return {key: torch.cat([part[key] for part in parts]) for key in keys}


class LeRobotLaw(ControlLaw):
    """A policy of LeRobot as a control law. It remembers actions and observations, so it serves one trial at a time.

    Args:
        policy: trained.
        before: normalises its observations.
        after: gives its actions in SI units.
    """

    def __init__(self, policy: Any, before: Any, after: Any) -> None:
        self._policy, self._before, self._after = policy.eval(), before, after
        self._last = np.inf  # number of the sample of the last action

    def estimator(self) -> OwnTurns:
        """Returns what tells this law its own turns."""
        return OwnTurns()

    def act(self, measured: ArrayLike, estimate: Estimate) -> Action:
        """See `ControlLaw`. A sample that is no later than the last one begins another trial."""
        if estimate.memory[2] <= self._last:
            self._policy.reset()
        self._last = estimate.memory[2]
        row = np.asarray(measured, dtype=np.float32)
        state = np.concatenate([row[6:7], estimate.memory[:2]]).astype(np.float32)
        observation = {
            "observation.state": torch.from_numpy(state),
            "observation.environment_state": torch.from_numpy(row[:6].copy()),
        }
        with torch.inference_mode():
            action = self._after(self._policy.select_action(self._before(observation)))
        turn_x, turn_y, feed = (float(number) for number in action.reshape(-1))
        return Action(turn=np.array([turn_x, turn_y]), feed=feed)


class OwnTurns:
    """An `Estimator` whose memory (3,) is the own turn since the start, rad, and the number of samples."""

    def initial(self) -> Estimate:
        """No turn, no sample."""
        return Estimate(memory=np.zeros(3))

    def step(self, memory: Array, observation: Array) -> Estimate:
        """The turn of the observation."""
        return Estimate(memory=np.append(observation[7:9], memory[2] + 1.0))
