"""Skills learnt from demonstrations: contact states, regressors of the actions, and state graphs; without Drake.

The names below are imported on first use, so that `import skill` is fast.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from skill.clustering.competitive_agglomeration import CompetitiveAgglomeration
    from skill.data.demonstration import Demonstration, read_demonstration, read_demonstrations, write_demonstration
    from skill.data.refinement import refine_demonstration
    from skill.features.contact_features import ContactFeatures
    from skill.features.wrench_features import CanonicalFeatures, NormalisedFeatures, RawFeatures
    from skill.manipulation_skill import ManipulationSkill
    from skill.recordings.reading import read_recordings
    from skill.recordings.recording import Recording
    from skill.regression.locally_weighted_regression import LWRegressor
    from skill.states.contact_state_filter import ContactStateFilter
    from skill.states.contact_states import ContactStates
    from skill.states.state_graph import StateGraph

_HOMES = {
    "CanonicalFeatures": "features.wrench_features",
    "CompetitiveAgglomeration": "clustering.competitive_agglomeration",
    "ContactFeatures": "features.contact_features",
    "ContactStateFilter": "states.contact_state_filter",
    "ContactStates": "states.contact_states",
    "Demonstration": "data.demonstration",
    "LWRegressor": "regression.locally_weighted_regression",
    "ManipulationSkill": "manipulation_skill",
    "NormalisedFeatures": "features.wrench_features",
    "RawFeatures": "features.wrench_features",
    "Recording": "recordings.recording",
    "StateGraph": "states.state_graph",
    "read_demonstration": "data.demonstration",
    "read_demonstrations": "data.demonstration",
    "read_recordings": "recordings.reading",
    "refine_demonstration": "data.refinement",
    "write_demonstration": "data.demonstration",
}

__all__ = [
    "CanonicalFeatures",
    "CompetitiveAgglomeration",
    "ContactFeatures",
    "ContactStateFilter",
    "ContactStates",
    "Demonstration",
    "LWRegressor",
    "ManipulationSkill",
    "NormalisedFeatures",
    "RawFeatures",
    "Recording",
    "StateGraph",
    "read_demonstration",
    "read_demonstrations",
    "read_recordings",
    "refine_demonstration",
    "write_demonstration",
]


def __getattr__(name: str) -> Any:
    """Imports an exported name on first use (PEP 562)."""
    if name not in _HOMES:
        raise AttributeError(f"module 'skill' has no attribute {name!r}")
    value = getattr(import_module(f"skill.{_HOMES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
