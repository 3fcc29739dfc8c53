"""How discovered states agree with known phases of the recordings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from sklearn.metrics import adjusted_rand_score

from skill.states.state_summary import LabelledRecording


@dataclass(frozen=True)
class PhaseAgreement:
    """Phases and states of the same samples.

    Attributes:
        phases: names of the P phases; numbers in their order, texts as they first occur.
        counts: (P, K) number of samples in each phase and state.
        ari: adjusted Rand index: 1 for the same partition, 0 on average for independent ones.
    """

    phases: tuple[str, ...]
    counts: NDArray[np.intp]
    ari: float


def compare_with_phases(labelled: Sequence[LabelledRecording], n_states: int) -> PhaseAgreement | None:
    """Compares states and phases in the recordings that have phases; None if there is none."""
    known = [item for item in labelled if item.recording.phases is not None]
    if not known:
        return None
    codes, names = phase_codes(known)
    phase, state = np.concatenate(codes), np.concatenate([item.states for item in known])
    counts = np.zeros((len(names), n_states), dtype=np.intp)
    np.add.at(counts, (phase, state), 1)
    return PhaseAgreement(names, counts, float(adjusted_rand_score(phase, state)))


def phase_codes(labelled: Sequence[LabelledRecording]) -> tuple[list[NDArray[np.intp]], tuple[str, ...]]:
    """Returns the number of the phase of each sample of some recordings with phases, and the names of the phases."""
    phases = [np.asarray(item.recording.phases) for item in labelled]
    if all(phase.dtype.kind in "iu" for phase in phases):
        found = [str(number) for number in np.unique(np.concatenate(phases))]
    else:
        found = list(dict.fromkeys(str(name) for phase in phases for name in phase))
    place = {name: k for k, name in enumerate(found)}
    return [np.array([place[str(name)] for name in phase], dtype=np.intp) for phase in phases], tuple(found)
