"""Contact states that are discovered in recordings of a real sensor, against the phases of its controller.

    python -m benchmarks.recordings --data FILE.npz|FOLDER --train-trials A-B --test-trials C-D [--rate HZ] [--seed 0]
                                    [--json FILE]

The file has the arrays time (s), wrench (N and N m), trial and phase. A folder of simulated demonstrations serves too:
the good ones, counted from 1, their wrenches with the noise of the rig's sensor; their phases are the exact contact
states. A phase of less than three samples counts as the next one. Learners see the wrenches of the training trials
only, scaled to variance one. All figures are of the test trials:

- states: number of states that were discovered; of segments per trial on average for change point detection;
- ARI, NMI: adjusted Rand index and normalised mutual information between states and phases;
- F1: agreement of the changes of the state with those of the phase, within 0.3 s.

"ContactStates" is the learner of `haptic-skill states`; its second row, "on line", uses the samples so far only. The
learners of the second group choose the number of states themselves. Those of the third are told the number of phases.
Change point detection (ruptures) learns nothing; its states are the segments of a trial, counted from its beginning.

The last line says how well a filter tells the phase on line: each state stands for the phase that it has most often in
training. Delay: time from a change of the phase to the first sample with this phase, over the recognised changes.
"""

from __future__ import annotations

import logging
import re
import time as clock
import warnings
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import ruptures
import typer
from sklearn.preprocessing import StandardScaler
from threadpoolctl import threadpool_limits

from benchmarks.command_line import JsonFile, finish, run
from benchmarks.learners.labelled_demonstrations import WRENCH_NOISE, poses
from benchmarks.learners.state_learners import (
    Found,
    Learner,
    Samples,
    States,
    agreement,
    competition,
    hidden_markov,
    k_means,
    mixture,
)
from benchmarks.state_scores import MIN_DURATION, boundary_f1, recognition
from experiments.exact_states import exact_bodies
from interfaces.reports.result_tables import plain_table
from interfaces.terminal import console, progress
from skill.arrays import sequences
from skill.data.demonstration import read_demonstrations
from skill.features.measurement import MEASURED
from skill.recordings.reading import read_recordings
from skill.recordings.recording import Recording
from skill.states.contact_states import ContactStates

WRENCH = MEASURED[:6]


def change_points(_: Samples, test: Samples, __: int, told: int | None) -> Found:
    """Changes of the mean: PELT with the penalty of the BIC, or the best segmentation into the number that is told."""
    segments = np.empty(len(test.Z), dtype=np.intp)
    numbers = []
    for rows in sequences(test.groups):
        signal = test.Z[rows]
        if told is None:
            penalty = (signal.shape[1] + 1) * np.log(len(signal)) * float(np.median(signal.var(axis=0)))
            # PELT, compiled; the linear kernel is "l2" of the signal.
            ends = ruptures.KernelCPD("linear").fit_predict(signal, pen=penalty)
        else:
            ends = ruptures.Dynp("l2", jump=5).fit_predict(signal, told - 1)
        segments[rows] = np.searchsorted(ends, np.arange(len(rows)), side="right")
        numbers.append(len(ends))
    return Found(round(float(np.mean(numbers))), segments)


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
        **agreement(test.labels, states),
        "boundary_f1": boundary_f1(test.labels, states, test.times, test.groups),
    }


def on_line(learner: ContactStates, train: Samples, test: Samples) -> dict[str, float]:
    """How well the causal filter tells the phase of the test samples."""
    counts = np.zeros((learner.n_clusters_, int(max(train.labels.max(), test.labels.max())) + 1))
    np.add.at(counts, (learner.labels_, train.labels), 1)
    told = counts.argmax(axis=1)[learner.predict(test.Z, test.groups, causal=True)]
    delays, recognised = recognition(test.labels, told, test.times, test.groups)
    return {
        "accuracy": float((told == test.labels).mean()),
        "delay_mean_s": float(delays.mean()),
        "delay_p90_s": float(np.quantile(delays, 0.9)),
        "recognised": recognised,
    }


def compare(train: Samples, test: Samples, seed: int) -> dict[str, Any]:
    """The figures of all learners."""
    told = len(np.unique(train.labels))
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
                number_found, states, _ = peer(train, test, seed, number)
                peers[title] = scores(test, number_found, states)
                advance(title)
    return found | {"peers": peers}


def simulated(folder: Path, seed: int) -> list[Recording]:
    """The good demonstrations of a folder: noisy wrenches, and exact contact states as phases."""
    rng = np.random.default_rng(seed)
    good = [demonstration for demonstration in read_demonstrations(folder) if demonstration.good]
    return [
        Recording(
            f"{folder}, good demonstration {number}",
            demonstration.samples["time"].to_numpy(),
            demonstration.samples[list(WRENCH)].to_numpy()
            + WRENCH_NOISE * rng.standard_normal((len(demonstration.samples), 6)),
            WRENCH,
            exact_bodies(demonstration).label(*poses(demonstration.samples)),
            str(number),
        )
        for number, demonstration in enumerate(good, start=1)
    ]


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
        Z=scaler.transform(np.concatenate([recording.values for recording in recordings])),
        times=np.concatenate([recording.time - recording.time[0] for recording in recordings]),
        groups=np.repeat(np.arange(len(counts)), counts),
        labels=np.concatenate([lasting(np.asarray(recording.phases, dtype=np.intp)) for recording in recordings]),
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


def main(
    data: Annotated[Path, typer.Option(metavar="FILE|FOLDER", help="Recordings with known phases, or demonstrations.")],
    train_trials: Annotated[str, typer.Option(metavar="A-B", help="Trials to learn from.")],
    test_trials: Annotated[str, typer.Option(metavar="C-D", help="Trials to judge on.")],
    rate: Annotated[float, typer.Option(help="Hz; faster recordings are averaged.")] = 50.0,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the learners.")] = 0,
    json: JsonFile = None,
) -> None:
    warnings.simplefilter("ignore")
    logging.getLogger("hmmlearn").setLevel(logging.ERROR)
    recordings = simulated(data, seed) if data.is_dir() else read_recordings(data)
    parts = [selected(recordings, trials, rate) for trials in (train_trials, test_trials)]
    scaler = StandardScaler().fit(np.concatenate([recording.values for recording in parts[0]]))
    train, test = (samples(part, scaler) for part in parts)
    with threadpool_limits(1):
        found = compare(train, test, seed)
    table = plain_table(f"states of {len(parts[1])} unseen trials, {len(np.unique(test.labels))} phases")
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
    finish({"seed": seed, "rate": rate, **found}, json)


if __name__ == "__main__":
    run(main)
