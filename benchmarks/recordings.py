"""Contact states that are discovered in recordings of a real sensor, against the phases of its controller.

    python -m benchmarks.recordings --data FILE.npz|FOLDER --train-trials A-B --test-trials C-D [--rate HZ] [--seed 0]
                                    [--hours H] [--json FILE]             needs the extra [peers]

The file has the arrays time (s), wrench (N and N m), trial and phase. In place of a file, a folder of simulated
demonstrations serves: the good ones, counted from 1, with the noise of the rig's sensor; their phases are the exact
contact states. A phase of less than three samples counts as the next one. Learners see the wrenches of the training
trials only, scaled to variance one. All figures are of the test trials:

- states: number of states that were discovered; of segments per trial on average for change point detection;
- ARI, NMI: adjusted Rand index and normalised mutual information between states and phases;
- F1: agreement of the changes of the state with those of the phase, within 0.3 s.

"ContactStates" is the learner of `haptic-skill states`; its second row, "on line", uses the samples so far only. The
learners of the second group choose the number of states themselves. Those of the third are told the number of phases.
Change point detection (ruptures) learns nothing; its states are the segments of a trial, counted from its beginning.

The last line says how well a filter tells the phase on line: each state stands for the phase that it has most often in
training. Delay: time from a change of the phase to the first sample with this phase, over the recognised changes.

--hours also measures what long recordings cost: a Parquet file with the given hours at 1 kHz, made of the training
trials one after the other, interpolated and with noise, is read, averaged and learnt from. CPU time on one core.
"""

from __future__ import annotations

import logging
import re
import resource
import tempfile
import time as clock
import warnings
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.extras import require_packages

if __name__ == "__main__":
    require_packages("hmmlearn", "ruptures")

import numpy as np
import pandas as pd
import ruptures
from hmmlearn.hmm import GaussianHMM
from numpy.typing import NDArray
from sklearn.cluster import KMeans
from sklearn.metrics import adjusted_rand_score, normalized_mutual_info_score, silhouette_score
from sklearn.mixture import GaussianMixture
from sklearn.preprocessing import StandardScaler
from threadpoolctl import threadpool_limits

from benchmarks.command_line import argument_parser, run
from benchmarks.learners.gaussian_mixture_regression import best_mixture
from benchmarks.learners.labelled_demonstrations import WRENCH_NOISE
from benchmarks.state_scores import MIN_DURATION, boundary_f1, recognition
from experiments.exact_states import exact_labels
from interfaces.reports.result_tables import plain_table
from interfaces.terminal import console, progress, write_json
from skill.arrays import Array
from skill.clustering.competitive_agglomeration import CompetitiveAgglomeration
from skill.data.demonstration import read_demonstrations
from skill.features.wrench_features import MEASURED
from skill.recordings.reading import read_recordings
from skill.recordings.recording import Recording
from skill.sequences import sequences
from skill.states.contact_states import ContactStates

MAX_STATES = 15
RATE = 50.0  # Hz
FLOOR = 1e-3  # variance that is added for the hidden Markov models, as a share of that of a channel
SILHOUETTE_SAMPLES = 5000
FAST = 1000.0  # sampling rate of the long recordings, Hz
NOISE, OFFSET = 0.05, 0.1  # their standard deviations in the long recordings, in those of the channels

States = NDArray[np.intp]


@dataclass(frozen=True)
class Samples:
    """Samples of several trials.

    Attributes:
        Z: (N, d), scaled wrenches.
        time: (N,), s.
        groups: (N,), trial of each sample.
        phases: (N,), phase of each sample.
    """

    Z: Array
    time: Array
    groups: States
    phases: States

    @property
    def lengths(self) -> list[int]:
        """Number of samples of each trial."""
        return [len(rows) for rows in sequences(self.groups)]


Learner = Callable[[Samples, Samples, int, int | None], tuple[int, States]]
"""Discovers states in training samples, with a seed and the number of states if it is told. Returns the number, and the
states of the test samples."""


def competition(train: Samples, test: Samples, seed: int, _: int | None) -> tuple[int, States]:
    """Competitive Agglomeration with its defaults: each Gaussian is a state."""
    fitted = CompetitiveAgglomeration(random_state=seed).fit(train.Z, groups=train.groups)
    return fitted.n_clusters_, fitted.predict(test.Z)


def mixture(train: Samples, test: Samples, seed: int, told: int | None) -> tuple[int, States]:
    """A Gaussian mixture, by default that of smallest BIC."""
    if told is None:
        best = best_mixture(train.Z, MAX_STATES, n_init=2, random_state=seed)
    else:
        best = GaussianMixture(told, n_init=5, random_state=seed).fit(train.Z)
    return best.n_components, best.predict(test.Z)


def hidden_markov(train: Samples, test: Samples, seed: int, told: int | None) -> tuple[int, States]:
    """A hidden Markov model with Gaussian emissions, by default that of smallest BIC among those that can be fitted."""
    fits = []
    for k in range(1, MAX_STATES + 1) if told is None else [told]:
        model = GaussianHMM(k, covariance_type="full", min_covar=FLOOR, n_iter=60, random_state=seed)
        with suppress(ValueError):  # a state with too few samples
            model.fit(train.Z, train.lengths)
            fits.append((float(model.bic(train.Z, train.lengths)), k, model))
    if not fits:
        raise ValueError(f"the hidden Markov model of {told} states cannot be fitted: too few samples")
    _, _, best = min(fits)
    return best.n_components, best.predict(test.Z, test.lengths)


def k_means(train: Samples, test: Samples, seed: int, told: int | None) -> tuple[int, States]:
    """k-means, by default with the number of the largest mean silhouette."""
    numbers = range(2, MAX_STATES + 1) if told is None else [told]
    fits = [KMeans(k, n_init=10, random_state=seed).fit(train.Z) for k in numbers]

    def silhouette(fit: KMeans) -> float:
        size = min(SILHOUETTE_SAMPLES, len(train.Z))
        return float(silhouette_score(train.Z, fit.labels_, sample_size=size, random_state=seed))

    best = fits[0] if told else max(fits, key=silhouette)
    return best.n_clusters, best.predict(test.Z)


def change_points(_: Samples, test: Samples, __: int, told: int | None) -> tuple[int, States]:
    """Changes of the mean: PELT with the penalty of the BIC, or the best segmentation into the number that is told."""
    segments = np.empty(len(test.Z), dtype=np.intp)
    numbers = []
    for rows in sequences(test.groups):
        signal = test.Z[rows]
        if told is None:
            penalty = (signal.shape[1] + 1) * np.log(len(signal)) * float(np.median(signal.var(axis=0)))
            ends = ruptures.Pelt("l2", jump=1).fit_predict(signal, penalty)
        else:
            ends = ruptures.Dynp("l2", jump=5).fit_predict(signal, told - 1)
        segments[rows] = np.searchsorted(ends, np.arange(len(rows)), side="right")
        numbers.append(len(ends))
    return round(float(np.mean(numbers))), segments


PEERS: dict[str, Learner] = {
    "CompetitiveAgglomeration": competition,
    "GMM-BIC": mixture,
    "HMM-BIC": hidden_markov,
    "k-means, silhouette": k_means,
    "ruptures PELT": change_points,
}
TOLD: dict[str, Learner] = {
    "GMM": mixture,
    "HMM": hidden_markov,
    "k-means": k_means,
    "ruptures": change_points,
}


def scores(test: Samples, number: int, states: States) -> dict[str, float]:
    """The figures of one learner; keys are those of the file."""
    return {
        "states": number,
        "ari": float(adjusted_rand_score(test.phases, states)),
        "nmi": float(normalized_mutual_info_score(test.phases, states)),
        "boundary_f1": boundary_f1(test.phases, states, test.time, test.groups),
    }


def on_line(learner: ContactStates, train: Samples, test: Samples) -> dict[str, float]:
    """How well the causal filter tells the phase of the test samples."""
    counts = np.zeros((learner.n_clusters_, int(max(train.phases.max(), test.phases.max())) + 1))
    np.add.at(counts, (learner.labels_, train.phases), 1)
    told = counts.argmax(axis=1)[learner.predict(test.Z, test.groups, causal=True)]
    delays, recognised = recognition(test.phases, told, test.time, test.groups)
    return {
        "accuracy": float((told == test.phases).mean()),
        "delay_mean_s": float(delays.mean()),
        "delay_p90_s": float(np.quantile(delays, 0.9)),
        "recognised": recognised,
    }


def compare(train: Samples, test: Samples, seed: int) -> dict[str, Any]:
    """The figures of all learners."""
    told = len(np.unique(train.phases))
    with progress("learners", 1 + len(PEERS) + len(TOLD)) as advance:
        start = clock.process_time()
        learner = ContactStates(random_state=seed).fit(train.Z, groups=train.groups)
        seconds = clock.process_time() - start
        found: dict[str, Any] = scores(test, learner.n_clusters_, learner.predict(test.Z, test.groups))
        causal = scores(test, learner.n_clusters_, learner.predict(test.Z, test.groups, causal=True))
        found |= {"fit_cpu_s": seconds, "on_line": causal | on_line(learner, train, test)}
        advance("ContactStates")
        peers = {}
        for group, number in ((PEERS, None), (TOLD, told)):
            for name, peer in group.items():
                title = name if number is None else f"{name}, told {number}"
                peers[title] = scores(test, *peer(train, test, seed, number))
                advance(title)
    return found | {"peers": peers}


def simulated(folder: Path, seed: int) -> list[Recording]:
    """The noisy wrenches of the good demonstrations of a folder, with their exact contact states as phases."""
    rng = np.random.default_rng(seed)
    wrench = MEASURED[:6]
    recordings = []
    for number, demonstration in enumerate((d for d in read_demonstrations(folder) if d.good), start=1):
        samples = demonstration.samples
        noise = WRENCH_NOISE * rng.standard_normal((len(samples), 6))
        recordings.append(
            Recording(
                f"{folder}, good demonstration {number}",
                samples["time"].to_numpy(),
                samples[list(wrench)].to_numpy() + noise,
                wrench,
                exact_labels(demonstration),
                str(number),
            )
        )
    return recordings


def selected(recordings: list[Recording], trials: str, rate: float) -> list[Recording]:
    """The recordings of the trials "A-B" or "A,C", averaged to the rate.

    Raises:
        ValueError: if the text is not such a list, a trial is missing, or it has no phases.
    """
    if not re.fullmatch(r"\d+(-\d+)?(,\d+(-\d+)?)*", trials):
        raise ValueError(f"trials '{trials}', expected numbers such as 1-4 or 1,3,5-7")
    ends = [[int(end) for end in part.split("-")] for part in trials.split(",")]
    wanted = [trial for part in ends for trial in range(part[0], part[-1] + 1)]
    by_trial = {recording.trial: recording for recording in recordings}
    missing = [trial for trial in wanted if str(trial) not in by_trial]
    if missing:
        raise ValueError(f"no trials {missing}; there are {', '.join(by_trial)}")
    chosen = [by_trial[str(trial)].averaged(rate) for trial in wanted]
    for recording in chosen:
        if recording.phases is None or recording.phases.dtype.kind not in "iu":
            raise ValueError(f"{recording.name}: no phases, expected an array 'phase' of integers")
    return chosen


def samples(recordings: list[Recording], scaler: StandardScaler) -> Samples:
    """The samples of the recordings, scaled."""
    counts = [len(recording.time) for recording in recordings]
    return Samples(
        scaler.transform(np.concatenate([recording.values for recording in recordings])),
        np.concatenate([recording.time - recording.time[0] for recording in recordings]),
        np.repeat(np.arange(len(counts)), counts),
        np.concatenate([lasting(np.asarray(recording.phases, dtype=np.intp)) for recording in recordings]),
    )


def lasting(phases: States) -> States:
    """The phases (n,) of a trial, where one that lasts less than ``MIN_DURATION`` samples counts as the next one."""
    begins = np.flatnonzero(np.diff(phases, prepend=phases[0] - 1))
    lengths = np.diff(begins, append=len(phases))
    found = phases[begins]
    for k in range(len(begins) - 2, -1, -1):
        if lengths[k] < MIN_DURATION:
            found[k] = found[k + 1]
    return np.repeat(found, lengths)


def long_recordings(recordings: list[Recording], hours: float, seed: int, path: Path) -> int:
    """Writes a table of the recordings in turn, at 1 kHz, until it lasts so long; returns its number of recordings."""
    if not 0 < hours < np.inf:
        raise ValueError(f"--hours {hours:g}: expected a positive number")
    rng = np.random.default_rng(seed)
    tables: list[pd.DataFrame] = []
    seconds = 0.0
    while seconds < 3600 * hours:
        one = recordings[len(tables) % len(recordings)]
        time = np.arange(one.time[0], one.time[-1], 1 / FAST)
        values = np.column_stack([np.interp(time, one.time, channel) for channel in one.values.T])
        spread = one.values.std(axis=0)
        values += NOISE * spread * rng.normal(size=values.shape) + OFFSET * spread * rng.normal(size=len(spread))
        tables.append(pd.DataFrame(values, columns=list(one.channels)).assign(time=time, trial=len(tables)))
        seconds += one.duration
    pd.concat(tables).to_parquet(path, index=False)
    return len(tables)


def cost(recordings: list[Recording], hours: float, rate: float, seed: int) -> dict[str, float]:
    """CPU time, s, of the steps of `haptic-skill states` for hours at 1 kHz, and the peak memory of the process, GB."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "long.parquet"
        number = long_recordings(recordings, hours, seed, path)
        begins = [clock.process_time()]
        long = read_recordings(path)
    begins.append(clock.process_time())
    averaged = [recording.averaged(rate) for recording in long]
    begins.append(clock.process_time())
    groups = np.repeat(np.arange(number), [len(recording.time) for recording in averaged])
    X = StandardScaler().fit_transform(np.concatenate([recording.values for recording in averaged]))
    learner = ContactStates(random_state=seed).fit(X, groups=groups)
    begins.append(clock.process_time())
    steps = dict(zip(("read_s", "average_s", "fit_s"), map(float, np.diff(begins)), strict=True))
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e9
    return {"hours": hours, "recordings": number, "states": learner.n_clusters_, **steps, "peak_memory_gb": peak}


def main() -> None:
    parser = argument_parser(__doc__)
    parser.add_argument(
        "--data",
        type=Path,
        required=True,
        metavar="PATH",
        help="recordings with known phases, or demonstrations",
    )
    parser.add_argument("--train-trials", required=True, metavar="A-B", help="trials to learn from")
    parser.add_argument("--test-trials", required=True, metavar="C-D", help="trials to judge on")
    parser.add_argument("--rate", type=float, default=RATE, help="Hz; faster recordings are averaged (default: 50)")
    parser.add_argument("--seed", type=int, default=0, help="seed of the learners (default: 0)")
    parser.add_argument("--hours", type=float, metavar="H", help="also measure the cost of so many hours at 1 kHz")
    arguments = parser.parse_args()
    warnings.simplefilter("ignore")
    logging.getLogger("hmmlearn").setLevel(logging.ERROR)
    recordings = (
        simulated(arguments.data, arguments.seed) if arguments.data.is_dir() else read_recordings(arguments.data)
    )
    parts = [selected(recordings, t, arguments.rate) for t in (arguments.train_trials, arguments.test_trials)]
    scaler = StandardScaler().fit(np.concatenate([recording.values for recording in parts[0]]))
    train, test = (samples(part, scaler) for part in parts)
    with threadpool_limits(1):
        found = compare(train, test, arguments.seed)
    table = plain_table(f"states of {len(parts[1])} unseen trials, {len(np.unique(test.phases))} phases")
    table.add_column("learner")
    for name in ("states", "ARI", "NMI", "F1"):
        table.add_column(name, justify="right")
    for name, row in {"ContactStates": found, "... on line": found["on_line"], **found["peers"]}.items():
        figures = (f"{row[key]:.2f}" for key in ("ari", "nmi", "boundary_f1"))
        table.add_row(name, str(row["states"]), *figures)
    console.print(table)
    line = found["on_line"]
    console.print(
        f"on line: the phase is right for {100 * line['accuracy']:.0f} % of the samples;"
        f" {100 * line['recognised']:.0f} % of the changes are recognised, after {line['delay_mean_s']:.2f} s"
        f" on average and {line['delay_p90_s']:.2f} s for nine in ten"
    )
    if arguments.hours is not None:
        with threadpool_limits(1):
            found["cost"] = cost(parts[0], arguments.hours, arguments.rate, arguments.seed)
        line = found["cost"]
        console.print(
            f"{line['hours']:g} h at 1 kHz in {line['recordings']} recordings: {line['states']} states; CPU time of"
            f" reading {line['read_s']:.1f} s, averaging {line['average_s']:.1f} s, learning {line['fit_s']:.0f} s;"
            f" peak memory {line['peak_memory_gb']:.1f} GB"
        )
    if arguments.json:
        write_json(arguments.json, {"seed": arguments.seed, "rate": arguments.rate, **found})


if __name__ == "__main__":
    run(main)
