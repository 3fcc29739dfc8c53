"""Environments for the tests of this folder."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import gymnasium
import pytest

from models.scenario import Scenario

MakeEnvironment = Callable[..., gymnasium.Env[Any, Any]]


@pytest.fixture
def make(quick_scenario: Scenario) -> Iterator[MakeEnvironment]:
    """Makes environments, by default in the quick scenario with the wide pivots of the hard set, and closes them."""
    quick_scenario.rig.pivot_range = 0.003
    made = []

    def make_environment(name: str = "PegInHole-v0", **arguments: Any) -> gymnasium.Env[Any, Any]:
        env = gymnasium.make(f"interfaces.gym:{name}", **{"scenario": quick_scenario, **arguments})
        made.append(env)
        return env

    yield make_environment
    for env in made:
        env.close()
