"""The rig trial as an environment of Gymnasium: ``gymnasium.make("interfaces.gym:PegInHole-v0")``."""

from __future__ import annotations

import gymnasium

ENTRY_POINT = "interfaces.gym.environment:InsertionEnv"

gymnasium.register(id="PegInHole-v0", entry_point=ENTRY_POINT, kwargs={"trial_set": "usual"})
gymnasium.register(id="PegInHole-Hard-v0", entry_point=ENTRY_POINT, kwargs={"trial_set": "hard"})
