"""Do the discovered contact states mean anything? Their agreement with exact geometry, beside other learners'.

    python -m benchmarks.learners.contact_states [--demonstrations FOLDER | --good 24 --bad 6] [--seed 0] [--json FILE]
                                        [--figure FILE]

Each recorded sample is labelled by `models.contact_geometry` from its pose; no learner sees a label. All learners get
the same features of the same refined samples, with the sensor's noise: those by which the skill tells states apart
(`ContactFeatures`, measured and hidden), and, where they can have one, the skill's floor under the variances. Two rows
undo these choices: no floor, then also the features that the regressor sees (`CanonicalFeatures`).

Two bodies touch where the gap of the *simulated* bodies is at most zero: peg and bore are regular polygons of the same
number of sides, aligned, with their edges on the true circles, so that the play is the true one. The deadband is
therefore zero; `contact_agreement` says how often this and the recorded force (over 10 mN) agree.

On line, every learner's Gaussians are followed by the same hidden Markov filter over the measured features alone. A
change of the true label that lasts at least 60 ms is recognised when the state's dominant label is the true one before
the next change; the delays are the mean and the 90 % quantile over the recognised ones (most are zero).

k-means is given the number of states that the competition found, having no
way to choose one.
"""

from __future__ import annotations

import argparse
import json
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from hmmlearn.hmm import GaussianHMM
from sklearn.cluster import KMeans
from sklearn.metrics import adjusted_rand_score, normalized_mutual_info_score
from sklearn.mixture import BayesianGaussianMixture, GaussianMixture
from threadpoolctl import threadpool_limits

from models.contact_geometry import ContactLabel, axes_of_rotation_vectors
from models.scenario import Scenario
from skill.clustering.cluster_initialization import components_of_partition
from skill.clustering.competitive_agglomeration import CompetitiveAgglomeration
from skill.clustering.expectation_maximization import CovariancePrior
from skill.data.demonstration import ACTIONS, Demonstration, read_demonstrations
from skill.data.refinement import refine_demonstration
from skill.features.contact_features import ContactFeatures
from skill.features.wrench_features import MEASURED, CanonicalFeatures
from skill.manipulation_skill import STATE_FLOOR
from skill.states.contact_state_filter import ContactStateFilter, StateEstimator
from skill.states.state_graph import StateGraph
from skill.states.state_naming import StateNames, name_states
from systems.runs.exact_states import exact_bodies

FORCE_NOISE, MOMENT_NOISE = 0.06, 5e-3  # N, N m: of the sensor the skill will feel through
STILL, ROUGH = 2e-5, 4e-4  # m: of the refinement
LASTING = 3  # samples that a change of label must last to ask for its recognition
LABEL_NAMES = tuple(label.label for label in ContactLabel)
MAX_STATES = 15  # states tried by the criteria


@dataclass(frozen=True)
class Recorded:
    """All samples: standardised features, true labels, demonstration, phase, and how many features are measured."""

    Z: np.ndarray
    regressor_Z: np.ndarray
    y: np.ndarray
    groups: np.ndarray
    phase: np.ndarray
    times: np.ndarray
    measured: int
    contact_agreement: float
    deepest_overlap: float
    example: int

    def as_the_regressor_sees_it(self) -> Recorded:
        """The same samples by `CanonicalFeatures`."""
        return replace(self, Z=self.regressor_Z, measured=len(CanonicalFeatures().get_feature_names_out()))

    @property
    def lengths(self) -> list[int]:
        """Samples of each demonstration."""
        return np.bincount(self.groups).tolist()


def recorded(demonstrations: list[Demonstration], seed: int) -> Recorded:
    rng = np.random.default_rng(seed)
    Z: dict[type, list[np.ndarray]] = {ContactFeatures: [], CanonicalFeatures: []}
    y, lengths, phase, times, touching, gaps = [], [], [], [], [], []
    for demonstration in demonstrations:
        samples = demonstration.samples.copy()
        samples[list(ACTIONS)] = samples[list(ACTIONS)].shift(-1, fill_value=0.0)
        refined, _ = refine_demonstration(samples, still=STILL, rough=ROUGH)
        bodies = exact_bodies(demonstration)
        axis = axes_of_rotation_vectors(refined[["ax", "ay", "az"]].to_numpy() * refined[["angle"]].to_numpy())
        p_HP = refined[["x", "y", "z"]].to_numpy()
        y.append(bodies.label(p_HP, axis))
        gaps.append(bodies.gap(p_HP, axis))
        touching.append((np.linalg.norm(refined[["fx", "fy", "fz"]], axis=1) > 0.01) == (y[-1] > 0))
        sigma = np.repeat([FORCE_NOISE, MOMENT_NOISE], 3)
        refined[list(MEASURED[:6])] += sigma * rng.standard_normal((len(refined), 6))
        for features, seen in Z.items():
            seen.append(features().transform_demonstration(refined))
        lengths.append(len(refined))
        phase.append(np.linspace(0.0, 1.0, len(refined), endpoint=False))
        times.append(refined["time"].to_numpy())
    standardised = {}
    for features, seen in Z.items():
        stacked = np.vstack(seen)
        standardised[features] = (stacked - stacked.mean(axis=0)) / stacked.std(axis=0)
    good = [k for k, demonstration in enumerate(demonstrations) if demonstration.good] or [0]
    return Recorded(
        Z=standardised[ContactFeatures],
        regressor_Z=standardised[CanonicalFeatures],
        y=np.concatenate(y),
        groups=np.repeat(np.arange(len(lengths)), lengths),
        phase=np.concatenate(phase),
        times=np.concatenate(times),
        measured=len(ContactFeatures().get_feature_names_out()),
        contact_agreement=float(np.concatenate(touching).mean()),
        deepest_overlap=float(-np.concatenate(gaps).min()),
        # Of the good ones, that which spends its time most evenly among the most labels.
        example=max(good, key=lambda k: (len(set(y[k])), np.unique(y[k], return_counts=True)[1].min() / len(y[k]))),
    )


Found = tuple[np.ndarray, np.ndarray | None]
"""States (N,), and the transition matrix if the learner has one of its own."""


def competition(data: Recorded, seed: int, floor: float = STATE_FLOOR) -> Found:
    learner = CompetitiveAgglomeration(reg_covar=floor, random_state=seed)
    fitted = learner.fit(data.Z, groups=data.groups, phase=data.phase)
    return fitted.predict(data.Z), None


def on_regressor_features(data: Recorded, seed: int) -> Found:
    return competition(data.as_the_regressor_sees_it(), seed, floor=1e-6)


def mixture_by_bic(data: Recorded, seed: int) -> Found:
    settings = {"reg_covar": STATE_FLOOR, "n_init": 2, "random_state": seed}
    mixtures = [GaussianMixture(k, **settings).fit(data.Z) for k in range(1, MAX_STATES + 1)]
    return min(mixtures, key=lambda mixture: mixture.bic(data.Z)).predict(data.Z), None


def bayesian_mixture(data: Recorded, seed: int) -> Found:
    mixture = BayesianGaussianMixture(n_components=MAX_STATES, max_iter=500, reg_covar=STATE_FLOOR, random_state=seed)
    return mixture.fit_predict(data.Z), None


def k_means(data: Recorded, seed: int) -> Found:
    found = competition(data, seed)[0].max() + 1
    return KMeans(int(found), n_init=10, random_state=seed).fit_predict(data.Z), None


def hidden_markov(data: Recorded, seed: int) -> Found:
    models = []
    for k in range(1, MAX_STATES + 1, 2):
        model = GaussianHMM(k, covariance_type="full", min_covar=STATE_FLOOR, n_iter=60, random_state=seed)
        models.append(model.fit(data.Z, data.lengths))
    best = min(models, key=lambda model: model.bic(data.Z, data.lengths))
    return best.predict(data.Z, data.lengths), best.transmat_


def truth(data: Recorded, seed: int) -> Found:
    """Gaussians fitted to the true labels: what no learner of one Gaussian a state can be expected to surpass."""
    _, dense = np.unique(data.y, return_inverse=True)
    states = gaussian_states(data, dense)
    return states.predict(data.Z), None


LEARNERS: dict[str, Callable[[Recorded, int], Found]] = {
    "CA-FMLE": competition,
    "CA-FMLE, no floor": partial(competition, floor=1e-6),
    "... and regressor's features": on_regressor_features,
    "GMM-BIC": mixture_by_bic,
    "BayesianGaussianMixture": bayesian_mixture,
    "k-means": k_means,
    "HMM": hidden_markov,
    "Gaussians of true labels": truth,
}


def gaussian_states(data: Recorded, states: np.ndarray) -> CompetitiveAgglomeration:
    """A classifier from any partition: one Gaussian a state."""
    d = data.Z.shape[1]
    prior = CovariancePrior(count=d + 1.0, variance=1.0, floor=np.full(d, STATE_FLOOR), diagonal=False)
    found = components_of_partition(data.Z, states, prior)
    factors = np.stack([np.linalg.inv(np.linalg.cholesky(F)).T for F in found.covariances])
    return CompetitiveAgglomeration.from_arrays(
        {
            "weights": found.weights,
            "means": found.means,
            "covariances": found.covariances,
            "precision_factors": factors,
            "design_effect": np.array(1.0),
            "distance": np.array("fmle"),
        }
    )


def on_line(data: Recorded, states: np.ndarray, transitions: np.ndarray | None) -> np.ndarray:
    """States (N,) that the filter names, sample by sample, from measured features."""
    if transitions is None:
        parts = [data.groups == group for group in np.unique(data.groups)]
        graph = StateGraph(n_states=int(states.max()) + 1)
        graph.fit([states[p] for p in parts], ["ended"] * len(parts), times=[data.times[p] for p in parts])
        transitions = graph.transition_matrix()
    transitions = transitions / transitions.sum(axis=1, keepdims=True)
    follow = ContactStateFilter(
        gaussian_states(data, states), gate=None, transitions=transitions, channels=np.arange(data.measured)
    )
    named = []
    for group in np.unique(data.groups):
        estimator = StateEstimator(follow)
        named += [estimator.update(x)[0] for x in data.Z[data.groups == group, : data.measured]]
    return np.array(named)


def recognition(data: Recorded, labels: np.ndarray) -> tuple[np.ndarray, float]:
    """Delays, s, and share of lasting changes that were recognised before the next one."""
    delays, asked = [], 0
    for group in np.unique(data.groups):
        chosen = data.groups == group
        true, told, at = data.y[chosen], labels[chosen], data.times[chosen]
        starts = np.flatnonzero(np.diff(true, prepend=-1))
        for begin, end in zip(starts, [*starts[1:], len(true)], strict=True):
            if end - begin < LASTING:
                continue
            asked += 1
            hits = np.flatnonzero(told[begin:end] == true[begin])
            delays += [at[begin + hits[0]] - at[begin]] if len(hits) else []
    return np.array(delays or [np.nan]), len(delays) / max(asked, 1)


def judge(data: Recorded, name: str, seed: int) -> tuple[dict[str, Any], np.ndarray, StateNames]:
    start = time.process_time()
    states, transitions = LEARNERS[name](data, seed)
    used, dense = np.unique(states, return_inverse=True)  # a mixture may leave components without a sample
    seconds = time.process_time() - start
    transitions = None if transitions is None else transitions[np.ix_(used, used)] + 1e-9
    named = name_states(dense, data.y, LABEL_NAMES, n_states=len(used))
    seen = data.as_the_regressor_sees_it() if LEARNERS[name] is on_regressor_features else data
    estimated = on_line(seen, dense, transitions)
    told = named.labels[estimated]
    delays, recognised = recognition(data, told)
    row = {
        "learner": name,
        "states": len(used),
        "ari": float(adjusted_rand_score(data.y, dense)),
        "nmi": float(normalized_mutual_info_score(data.y, dense)),
        "purity": float(named.counts.max(axis=1).sum() / named.counts.sum()),
        "on_line_accuracy": float((told == data.y).mean()),
        "on_line_delay_s": float(np.median(delays)),
        "on_line_delay_p90_s": float(np.quantile(delays, 0.9)),
        "on_line_delay_mean_s": float(delays.mean()),
        "recognised": recognised,
        "fit_cpu_s": seconds,
        "names": named.names,
        "confusion": named.counts.tolist(),
    }
    return row, dense, named


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--demonstrations", type=Path, help="folder of recorded ones; recorded anew without it")
    parser.add_argument("--good", type=int, default=24)
    parser.add_argument("--bad", type=int, default=6)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--json", type=Path, help="write the figures to this file")
    parser.add_argument("--figure", type=Path, help="draw one insertion to this file (.png or .svg)")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    if arguments.demonstrations is not None:
        demonstrations = read_demonstrations(arguments.demonstrations)
    else:
        from systems.runs.demonstration_set import demonstrate_all, requests

        wanted = requests(arguments.good, arguments.bad)
        shown = demonstrate_all(Scenario(), wanted, seed=arguments.seed, jobs=1)
        demonstrations = [demonstration for _, demonstration in shown]
    with threadpool_limits(1):
        data = recorded(demonstrations, arguments.seed)
        print(f"{len(demonstrations)} demonstrations, {len(data.y)} refined samples; touching by geometry and by force")
        print(f"agree on {100 * data.contact_agreement:.1f} %; deepest overlap {1e6 * data.deepest_overlap:.0f} um")
        counts = np.bincount(data.y, minlength=len(LABEL_NAMES))
        print("true labels: " + ", ".join(f"{n} {c}" for n, c in zip(LABEL_NAMES, counts, strict=True) if c))
        print(f"\n{'':26} states   ARI   NMI purity | on line: right  delay s: mean  90 %  recognised | fit s")
        rows = []
        for name in LEARNERS:
            row, states, named = judge(data, name, arguments.seed)
            rows.append(row)
            print(
                f"{name:26} {row['states']:6} {row['ari']:5.3f} {row['nmi']:5.3f} {row['purity']:6.3f} |"
                f" {row['on_line_accuracy']:14.3f} {row['on_line_delay_mean_s']:13.3f}"
                f" {row['on_line_delay_p90_s']:5.2f} {row['recognised']:11.3f} | {row['fit_cpu_s']:5.1f}",
                flush=True,
            )
            if name == "CA-FMLE" and arguments.figure:
                from benchmarks.physics.figures import draw_states

                one = data.groups == data.example
                draw_states(arguments.figure, data.times[one], data.y[one], LABEL_NAMES, states[one], named)
    shown = [k for k in range(len(LABEL_NAMES)) if counts[k]]
    print("\nCA-FMLE, samples of each true label: " + ", ".join(LABEL_NAMES[k] for k in shown))
    for name, row in zip(rows[0]["names"], rows[0]["confusion"], strict=True):
        print(f"  {name:40}" + "".join(f"{row[k]:7}" for k in shown))
    if arguments.json:
        head = {
            "seed": arguments.seed,
            "contact_agreement": data.contact_agreement,
            "deepest_overlap_m": data.deepest_overlap,
            "labels": dict(zip(LABEL_NAMES, counts.tolist(), strict=True)),
        }
        arguments.json.write_text(json.dumps({**head, "learners": rows}, indent=1))


if __name__ == "__main__":
    main()
