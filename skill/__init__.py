"""What is learnt: contact states, local regressors and their graph. Never imports Drake."""

from skill.competitive_agglomeration import CompetitiveAgglomeration
from skill.contact_features import ContactFeatures
from skill.contact_state_filter import ContactStateFilter, StateEstimator
from skill.demonstration import Demonstration, read_demonstration, read_demonstrations, write_demonstration
from skill.features import CanonicalFeatures, NormalisedFeatures, RawFeatures
from skill.gaussian_mixture_regression import gmr_predict
from skill.locally_weighted_regression import LWRegressor
from skill.manipulation_skill import ManipulationSkill
from skill.refinement import refine_demonstration
from skill.state_graph import StateGraph

__all__ = [
    "CanonicalFeatures",
    "CompetitiveAgglomeration",
    "ContactFeatures",
    "ContactStateFilter",
    "Demonstration",
    "LWRegressor",
    "ManipulationSkill",
    "NormalisedFeatures",
    "RawFeatures",
    "StateEstimator",
    "StateGraph",
    "gmr_predict",
    "read_demonstration",
    "read_demonstrations",
    "refine_demonstration",
    "write_demonstration",
]
