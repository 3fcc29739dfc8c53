"""Agreement of the discovered contact states with exact geometry, for the skill's learner and others.

    python -m benchmarks.learners.contact_states [--demonstrations FOLDER] [--seed 0] [--json FILE]

Each recorded sample is labelled from its pose by `models.exact_geometry`; no learner sees a label. All learners get
the same features of the same refined samples, with sensor noise: those by which the skill distinguishes states
(`ContactFeatures`, measured and hidden). Where a learner has a floor under the variances, it is the skill's. Two rows
undo these choices: "no floor", and "... and regressor's features" (`CanonicalFeatures`). "ContactStates" is the learner
of recordings of other sensors, which smooths over a whole demonstration. k-means gets the number of states that the
competition found.

The bodies touch where the gap of the simulated bodies is at most zero. The first lines of the output say how often this
agrees with a recorded force of more than 10 mN, and the deepest overlap.

Columns, one row per learner:

- states: number of states;
- ARI, NMI: adjusted Rand index and normalised mutual information between states and labels;
- purity: share of samples that have the dominant label of their state;
- on line: right: share of samples for which a hidden Markov filter over the measured features alone is in a state whose
  dominant label is the true one;
- delay: time from a change of the true label to the first sample at which the filter has the new label, s; mean and
  90 % quantile over the recognised changes;
- recognised: share of the changes that the filter follows before the next change. Labels that last less than 60 ms do
  not count;
- fit s: CPU time of the fit.

The last table has the samples of each true label in each state of CA-FMLE.
"""

from __future__ import annotations

import time
import warnings
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from threadpoolctl import threadpool_limits

from benchmarks.command_line import Demonstrations, JsonFile, finish, run
from benchmarks.learners.labelled_demonstrations import LabelledDemonstrations, label_demonstrations
from benchmarks.learners.state_learners import (
    MAX_STATES,
    Found,
    Learner,
    Samples,
    States,
    agreement,
    bayesian_mixture,
    competition,
    hidden_markov,
    k_means,
    mixture,
    recurring_sets,
)
from benchmarks.state_scores import recognition
from interfaces.terminal import progress
from models.exact_geometry import ContactLabel
from skill.arrays import Array
from skill.clustering.competitive_agglomeration import CompetitiveAgglomeration
from skill.clustering.expectation_maximization import CovariancePrior, components_of_partition
from skill.data.demonstration import read_demonstrations
from skill.manipulation_skill import STATE_FLOOR
from skill.states.contact_state_filter import ContactStateFilter
from skill.states.state_graph import StateGraph
from skill.states.state_naming import name_states

LABEL_NAMES = tuple(label.label for label in ContactLabel)
SKILL = "CA-FMLE"  # the learner of the skill
REGRESSOR = "... and regressor's features"


def as_many_means(train: Samples, test: Samples, seed: int, _: int | None) -> Found:
    """k-means with the number of states of the competition."""
    return k_means(train, test, seed, competition(train, test, seed, floor=STATE_FLOOR).number)


def true_gaussians(train: Samples, test: Samples, *_: int | None) -> Found:
    """Gaussians fitted to the true labels: an upper bound for learners with one Gaussian per state."""
    known, dense = np.unique(train.labels, return_inverse=True)
    return Found(len(known), gaussian_states(train.Z, dense).predict(test.Z))


LEARNERS: dict[str, Learner] = {
    SKILL: partial(competition, floor=STATE_FLOOR),
    "CA-FMLE, no floor": competition,
    REGRESSOR: competition,
    "ContactStates": recurring_sets,
    "GMM-BIC": partial(mixture, floor=STATE_FLOOR),
    "BayesianGaussianMixture": partial(bayesian_mixture, floor=STATE_FLOOR),
    "k-means": as_many_means,
    "HMM": partial(hidden_markov, floor=STATE_FLOOR, numbers=range(1, MAX_STATES + 1, 2)),
    "Gaussians of true labels": true_gaussians,
}


def gaussian_states(Z: Array, states: States) -> CompetitiveAgglomeration:
    """A classifier with one Gaussian per state, from samples (N, d) and their states (N,)."""
    d = Z.shape[1]
    prior = CovariancePrior(count=d + 1.0, variance=1.0, floor=np.full(d, STATE_FLOOR))
    components = components_of_partition(Z, states, prior)
    factors = np.stack([np.linalg.inv(np.linalg.cholesky(F)).T for F in components.covariances])
    return CompetitiveAgglomeration.from_arrays(
        {
            "weights": components.weights,
            "means": components.means,
            "covariances": components.covariances,
            "precision_factors": factors,
            "design_effect": np.array(1.0),
        }
    )


def filtered_states(data: LabelledDemonstrations, states: States, transitions: Array | None) -> States:
    """The states (N,) that the filter estimates, sample by sample, from the measured features.

    Args:
        data: the samples.
        states: (N,), state of each sample by the learner; one Gaussian is fitted to each.
        transitions: (M, M), unnormalised; counted from ``states`` if None.
    """
    if transitions is None:
        parts = [data.groups == group for group in np.unique(data.groups)]
        graph = StateGraph(n_states=int(states.max()) + 1)
        graph.fit([states[p] for p in parts], ["ended"] * len(parts), times=[data.times[p] for p in parts])
        transitions = graph.transition_matrix()
    transitions = transitions / transitions.sum(axis=1, keepdims=True)
    state_filter = ContactStateFilter(
        gaussian_states(data.Z, states), transitions, gate=None, channels=np.arange(data.measured)
    )
    estimates = []
    for group in np.unique(data.groups):
        log_belief = state_filter.initial_log_belief()
        for x in data.Z[data.groups == group, : data.measured]:
            estimate = state_filter.step(log_belief, x)
            log_belief = estimate.log_belief
            estimates.append(int(estimate.probabilities.argmax()))
    return np.array(estimates)


def evaluate(data: LabelledDemonstrations, name: str, seed: int) -> dict[str, Any]:
    """The row of one learner."""
    start = time.process_time()
    seen = data.as_the_regressor_sees_it() if name == REGRESSOR else data
    _, states, transitions = LEARNERS[name](seen, seen, seed, None)
    used, dense = np.unique(states, return_inverse=True)  # a mixture may have components without a sample
    seconds = time.process_time() - start
    transitions = None if transitions is None else transitions[np.ix_(used, used)] + 1e-9
    names = name_states(dense, data.labels, LABEL_NAMES, n_states=len(used))
    labels = names.labels[filtered_states(seen, dense, transitions)]
    delays, recognised = recognition(data.labels, labels, data.times, data.groups)
    return {
        "learner": name,
        "states": len(used),
        **agreement(data.labels, dense),
        "purity": float(names.counts.max(axis=1).sum() / names.counts.sum()),
        "on_line_accuracy": float((labels == data.labels).mean()),
        "on_line_delay_p90_s": float(np.quantile(delays, 0.9)),
        "on_line_delay_mean_s": float(delays.mean()),
        "recognised": recognised,
        "fit_cpu_s": seconds,
        "names": names.names,
        "confusion": names.counts.tolist(),
    }


def compare(data: LabelledDemonstrations, seed: int) -> list[dict[str, Any]]:
    """Evaluates all learners, and prints a row for each."""
    rows = []
    print(f"\n{'':26} states   ARI   NMI purity | on line: right  delay s: mean  90 %  recognised | fit s")
    with progress("contact states", len(LEARNERS)) as advance:
        for name in LEARNERS:
            row = evaluate(data, name, seed)
            rows.append(row)
            print(
                f"{name:26} {row['states']:6} {row['ari']:5.3f} {row['nmi']:5.3f} {row['purity']:6.3f} |"
                f" {row['on_line_accuracy']:14.3f} {row['on_line_delay_mean_s']:13.3f}"
                f" {row['on_line_delay_p90_s']:5.2f} {row['recognised']:11.3f} | {row['fit_cpu_s']:5.1f}",
                flush=True,
            )
            advance(name)
    return rows


def main(
    demonstrations: Demonstrations = [Path("out/demonstrations")],  # noqa: B006
    seed: Annotated[int, typer.Option(min=0, help="Seed of the noise and of the learners.")] = 0,
    json: JsonFile = None,
) -> None:
    warnings.simplefilter("ignore")
    shown = [d for folder in demonstrations for d in read_demonstrations(folder)]
    with threadpool_limits(1):
        data = label_demonstrations(shown, seed)
        counts = np.bincount(data.labels, minlength=len(LABEL_NAMES))
        print(f"{len(shown)} demonstrations, {len(data.labels)} refined samples")
        print(f"contact by geometry and by force agrees on {100 * data.contact_agreement:.1f} % of the samples")
        print(f"deepest overlap {1e6 * data.deepest_overlap:.0f} um")
        print("samples by true label: " + ", ".join(f"{n} {c}" for n, c in zip(LABEL_NAMES, counts, strict=True) if c))
        rows = compare(data, seed)
    present = np.flatnonzero(counts)
    print(f"\n{SKILL}, samples of each true label: " + ", ".join(LABEL_NAMES[k] for k in present))
    for name, row in zip(rows[0]["names"], rows[0]["confusion"], strict=True):
        print(f"  {name:40}" + "".join(f"{row[k]:7}" for k in present))
    head = {"contact_agreement": data.contact_agreement, "deepest_overlap_m": data.deepest_overlap}
    labels = dict(zip(LABEL_NAMES, counts.tolist(), strict=True))
    finish({"seed": seed, **head, "labels": labels, "learners": rows}, json)


if __name__ == "__main__":
    run(main)
