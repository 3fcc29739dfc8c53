"""Agreement of the discovered contact states with exact geometry, for the skill's learner and others.

    python -m benchmarks.learners.contact_states [--demonstrations FOLDER | --good 24 --bad 6] [--seed 0] [--json FILE]
                                                 [--figure FILE]                      needs the extra [peers]

Each recorded sample is labelled from its pose by `models.contact_geometry`; no learner sees a label. All learners get
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
from pathlib import Path
from typing import Any

from benchmarks.extras import require_packages

if __name__ == "__main__":
    require_packages("pydrake", "yaml", "hmmlearn")

import numpy as np
from sklearn.metrics import adjusted_rand_score, normalized_mutual_info_score
from threadpoolctl import threadpool_limits

from benchmarks.command_line import argument_parser, run
from benchmarks.learners.labelled_demonstrations import LabelledDemonstrations, label_demonstrations
from benchmarks.learners.state_learners import LEARNERS, States, gaussian_states, on_regressor_features
from benchmarks.physics.figures import draw_states
from benchmarks.recording import record_demonstrations
from benchmarks.state_scores import recognition
from experiments.demonstration_set import requests
from interfaces.terminal import progress, write_json
from models.contact_geometry import ContactLabel
from models.scenario import Scenario
from skill.arrays import Array
from skill.data.demonstration import read_demonstrations
from skill.states.contact_state_filter import ContactStateFilter, StateEstimator
from skill.states.state_graph import StateGraph
from skill.states.state_naming import StateNames, name_states

LABEL_NAMES = tuple(label.label for label in ContactLabel)
SKILL = "CA-FMLE"  # the learner of the skill


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
        gaussian_states(data.Z, states), gate=None, transitions=transitions, channels=np.arange(data.measured)
    )
    estimates = []
    for group in np.unique(data.groups):
        estimator = StateEstimator(state_filter)
        estimates += [estimator.update(x)[0] for x in data.Z[data.groups == group, : data.measured]]
    return np.array(estimates)


def evaluate(data: LabelledDemonstrations, name: str, seed: int) -> tuple[dict[str, Any], States, StateNames]:
    """The row of one learner, the state of each sample (N,), and the names of the states."""
    start = time.process_time()
    states, transitions = LEARNERS[name](data, seed)
    used, dense = np.unique(states, return_inverse=True)  # a mixture may have components without a sample
    seconds = time.process_time() - start
    transitions = None if transitions is None else transitions[np.ix_(used, used)] + 1e-9
    names = name_states(dense, data.labels, LABEL_NAMES, n_states=len(used))
    seen = data.as_the_regressor_sees_it() if LEARNERS[name] is on_regressor_features else data
    labels = names.labels[filtered_states(seen, dense, transitions)]
    delays, recognised = recognition(data.labels, labels, data.times, data.groups)
    row = {
        "learner": name,
        "states": len(used),
        "ari": float(adjusted_rand_score(data.labels, dense)),
        "nmi": float(normalized_mutual_info_score(data.labels, dense)),
        "purity": float(names.counts.max(axis=1).sum() / names.counts.sum()),
        "on_line_accuracy": float((labels == data.labels).mean()),
        "on_line_delay_s": float(np.median(delays)),
        "on_line_delay_p90_s": float(np.quantile(delays, 0.9)),
        "on_line_delay_mean_s": float(delays.mean()),
        "recognised": recognised,
        "fit_cpu_s": seconds,
        "names": names.names,
        "confusion": names.counts.tolist(),
    }
    return row, dense, names


def compare(data: LabelledDemonstrations, seed: int, figure: Path | None) -> list[dict[str, Any]]:
    """Evaluates all learners, prints a row for each, and draws one insertion with the states of the skill's learner."""
    rows = []
    print(f"\n{'':26} states   ARI   NMI purity | on line: right  delay s: mean  90 %  recognised | fit s")
    with progress("contact states", len(LEARNERS)) as advance:
        for name in LEARNERS:
            row, states, names = evaluate(data, name, seed)
            rows.append(row)
            print(
                f"{name:26} {row['states']:6} {row['ari']:5.3f} {row['nmi']:5.3f} {row['purity']:6.3f} |"
                f" {row['on_line_accuracy']:14.3f} {row['on_line_delay_mean_s']:13.3f}"
                f" {row['on_line_delay_p90_s']:5.2f} {row['recognised']:11.3f} | {row['fit_cpu_s']:5.1f}",
                flush=True,
            )
            if name == SKILL and figure is not None:
                one = data.groups == data.example
                draw_states(figure, data.times[one], data.labels[one], LABEL_NAMES, states[one], names)
            advance(name)
    return rows


def main() -> None:
    parser = argument_parser(__doc__)
    parser.add_argument("--demonstrations", type=Path, metavar="FOLDER", help="recorded ones; without it, records new")
    parser.add_argument("--good", type=int, default=24, help="good demonstrations to record (default: 24)")
    parser.add_argument("--bad", type=int, default=6, help="bad demonstrations to record (default: 6)")
    parser.add_argument("--seed", type=int, default=0, help="seed of recording, noise and learners (default: 0)")
    parser.add_argument("--figure", type=Path, metavar="FILE", help="draw one insertion to this file (.png or .svg)")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    if arguments.demonstrations is not None:
        demonstrations = read_demonstrations(arguments.demonstrations)
    else:
        wanted = requests(arguments.good, arguments.bad)
        demonstrations = [d for _, d in record_demonstrations(Scenario(), wanted, seed=arguments.seed)]
    with threadpool_limits(1):
        data = label_demonstrations(demonstrations, arguments.seed)
        counts = np.bincount(data.labels, minlength=len(LABEL_NAMES))
        print(f"{len(demonstrations)} demonstrations, {len(data.labels)} refined samples")
        print(f"contact by geometry and by force agrees on {100 * data.contact_agreement:.1f} % of the samples")
        print(f"deepest overlap {1e6 * data.deepest_overlap:.0f} um")
        print("samples by true label: " + ", ".join(f"{n} {c}" for n, c in zip(LABEL_NAMES, counts, strict=True) if c))
        rows = compare(data, arguments.seed, arguments.figure)
    present = np.flatnonzero(counts)
    print(f"\n{SKILL}, samples of each true label: " + ", ".join(LABEL_NAMES[k] for k in present))
    for name, row in zip(rows[0]["names"], rows[0]["confusion"], strict=True):
        print(f"  {name:40}" + "".join(f"{row[k]:7}" for k in present))
    if arguments.json:
        head = {
            "seed": arguments.seed,
            "contact_agreement": data.contact_agreement,
            "deepest_overlap_m": data.deepest_overlap,
            "labels": dict(zip(LABEL_NAMES, counts.tolist(), strict=True)),
        }
        write_json(arguments.json, {**head, "learners": rows})


if __name__ == "__main__":
    run(main)
