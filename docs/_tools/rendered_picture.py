"""Draws docs/pictures/gymnasium.png, the environment as `render()` returns it: a skill has inserted half of the peg.

    python -m docs._tools.rendered_picture [SKILL] [PICTURE]

The paths are those of a file of a skill, and of the picture.
"""

from __future__ import annotations

import sys
from pathlib import Path

import gymnasium
from PIL import Image

from docs._tools.moving_picture import PICTURES, ROOT
from interfaces.gym.agents import PolicyAgent
from skill.manipulation_skill import ManipulationSkill

DEPTH = 0.012  # m


def main(
    skill: str = str(ROOT / "skill" / "default_skill.npz"), picture: str = str(PICTURES / "gymnasium.png")
) -> None:
    """Performs the first trial until the tip is deep enough, and draws it."""
    policy = ManipulationSkill.load(Path(skill))
    env = gymnasium.make("interfaces.gym:PegInHole-v0", engine="exact", policy=policy, render_mode="rgb_array")
    agent, (observation, _) = PolicyAgent(policy), env.reset(options={"trial": 0})
    while observation["depth"][0] < DEPTH:
        observation, *_ = env.step(agent.act(observation))
    Image.fromarray(env.render()).save(picture)


if __name__ == "__main__":
    main(*sys.argv[1:])
