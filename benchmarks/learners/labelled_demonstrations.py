"""Samples of recorded demonstrations as features of the learners, labelled with the exact contact state."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from benchmarks.learners.state_learners import Samples
from experiments.exact_states import exact_bodies
from models.exact_geometry import rotations_of_vectors
from skill.arrays import Array
from skill.data.demonstration import Demonstration
from skill.data.refinement import refine_demonstration, with_following_actions
from skill.features.contact_features import ContactFeatures
from skill.features.measurement import MEASURED
from skill.features.wrench_features import CanonicalFeatures

WRENCH_NOISE = np.repeat([0.06, 5e-3], 3)  # N, N m; standard deviations of the rig's sensor
STILL, ROUGH = 2e-5, 4e-4  # m; settings of `refine_demonstration`
TOUCHING_FORCE = 0.01  # N; a larger recorded force counts as contact


@dataclass(frozen=True, kw_only=True)
class LabelledDemonstrations(Samples):
    """All refined samples of a set of demonstrations; labels are `ContactLabel`, and measured features come first.

    Attributes:
        regressor_Z: (N, e), standardised features that the regressor sees (`CanonicalFeatures`).
        measured: number of measured features in ``Z``.
        contact_agreement: share of samples on which geometry and recorded force agree about contact.
        deepest_overlap: of the bodies at any sample, m.
    """

    regressor_Z: Array
    measured: int
    contact_agreement: float
    deepest_overlap: float

    def as_the_regressor_sees_it(self) -> LabelledDemonstrations:
        """The same samples with the features of the regressor."""
        return replace(self, Z=self.regressor_Z, measured=len(CanonicalFeatures().get_feature_names_out()))


def poses(samples: pd.DataFrame) -> tuple[Array, Array]:
    """Returns the positions p_HP (n, 3), m, and orientations R_HP (n, 3, 3) of the peg in the hole."""
    R_HP = rotations_of_vectors(samples[["ax", "ay", "az"]].to_numpy() * samples[["angle"]].to_numpy())
    return samples[["x", "y", "z"]].to_numpy(), R_HP


def label_demonstrations(demonstrations: list[Demonstration], seed: int) -> LabelledDemonstrations:
    """Refines the demonstrations, adds sensor noise of the given seed, and labels every sample from its true pose.

    Raises:
        ValueError: if a demonstration does not state its geometry.
    """
    rng = np.random.default_rng(seed)
    contact_features: list[Array] = []
    regressor_features: list[Array] = []
    labels, lengths, phase, times, agrees, gaps = [], [], [], [], [], []
    for demonstration in demonstrations:
        refined = refine_demonstration(with_following_actions(demonstration.samples), still=STILL, rough=ROUGH)
        bodies = exact_bodies(demonstration)
        p_HP, R_HP = poses(refined)
        labels.append(bodies.label(p_HP, R_HP))
        gaps.append(bodies.gap(p_HP, R_HP))
        force = np.linalg.norm(refined[["fx", "fy", "fz"]], axis=1)
        agrees.append((force > TOUCHING_FORCE) == (labels[-1] > 0))
        refined[list(MEASURED[:6])] += WRENCH_NOISE * rng.standard_normal((len(refined), 6))
        contact_features.append(ContactFeatures().transform_demonstration(refined))
        regressor_features.append(CanonicalFeatures().transform_demonstration(refined))
        lengths.append(len(refined))
        phase.append(np.linspace(0.0, 1.0, len(refined), endpoint=False))
        times.append(refined["time"].to_numpy())
    return LabelledDemonstrations(
        Z=_standardised(contact_features),
        regressor_Z=_standardised(regressor_features),
        labels=np.concatenate(labels),
        groups=np.repeat(np.arange(len(lengths)), lengths),
        phase=np.concatenate(phase),
        times=np.concatenate(times),
        measured=len(ContactFeatures().get_feature_names_out()),
        contact_agreement=float(np.concatenate(agrees).mean()),
        deepest_overlap=float(-np.concatenate(gaps).min()),
    )


def _standardised(features: list[Array]) -> Array:
    stacked = np.vstack(features)
    standardised: Array = (stacked - stacked.mean(axis=0)) / stacked.std(axis=0)
    return standardised
