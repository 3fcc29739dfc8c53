"""Draws docs/pictures/gymnasium.png, the environment as `render()` returns it: a skill has inserted half of the peg.

It is the skill of the checkout, in the first trial: ``python -m docs._tools.rendered_picture``.
"""

from __future__ import annotations

import gymnasium
from PIL import Image

from docs._tools.moving_picture import PICTURES, ROOT
from interfaces.gym.agents import PolicyAgent
from skill.manipulation_skill import ManipulationSkill

DEPTH = 0.012  # m


def main() -> None:
    """Performs the first trial until the tip is deep enough, and draws it."""
    policy = ManipulationSkill.load(ROOT / "skill" / "default_skill.npz")
    env = gymnasium.make("interfaces.gym:PegInHole-v0", engine="exact", policy=policy, render_mode="rgb_array")
    agent, (observation, _) = PolicyAgent(policy), env.reset(options={"trial": 0})
    while observation["depth"][0] < DEPTH:
        observation, *_ = env.step(agent.act(observation))
    Image.fromarray(env.render()).save(PICTURES / "gymnasium.png")


if __name__ == "__main__":
    main()
