"""Failures of a robot, told by the contact states of a short window of wrenches: a public data set.

    python -m benchmarks.learners.execution_failures FOLDER [--repeats 5] [--seed 0] [--json FILE]

FOLDER has the files lp1.data to lp5.data of "Robot Execution Failures" (Seabra Lopes and Camarinha-Matos; UCI Machine
Learning Repository, data set 138). Each file is a problem: windows of 15 wrenches in 315 ms after a failure was
detected, and the class of each window. A window is a line with its class, 15 lines of six whole numbers
Fx Fy Fz Tx Ty Tz, and an empty line.

Accuracy: the mean of repeated five-fold cross-validation with stratified folds. In brackets is Wilson's 95 % interval
for as many windows. Windows that share at least half of their wrenches are copies of each other, some of them with
another class; copies are in the same fold. A random forest of scikit-learn with its default parameters classifies:

- majority: the most frequent class of all windows, for comparison;
- statistics: mean, standard deviation, least and greatest value of each channel;
- states: the share of the window in each contact state and the longest visit to it. `ContactStates` learns the states
  from the training windows without their classes;
- components: the same with the Gaussians of `CompetitiveAgglomeration` for states.

Published, with one division into training and test windows (38 and 50, 17 and 30, 17 and 30, 42 and 75, 64 and 100), in
which copies may be on both sides: SMTS (Baydogan and Runger, Data Mining and Knowledge Discovery 29, 2015) and
WEASEL+MUSE, "MUSE" (Schäfer and Leser, arXiv 1711.11343, 2017, whose table has both). They are quoted from memory and
still have to be compared with the table.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, Self

import numpy as np
import typer
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components
from sklearn.base import BaseEstimator, TransformerMixin, clone
from sklearn.ensemble import RandomForestClassifier
from sklearn.model_selection import StratifiedGroupKFold, cross_val_predict
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer, StandardScaler
from threadpoolctl import threadpool_limits

from benchmarks.command_line import JsonFile, finish, run
from experiments.scoreboard.paired_statistics import wilson
from interfaces.reports.result_tables import plain_table
from interfaces.terminal import console, progress
from skill.arrays import Array
from skill.clustering.competitive_agglomeration import CompetitiveAgglomeration
from skill.states.contact_states import ContactStates

ADDRESS = "https://archive.ics.uci.edu/dataset/138/robot+execution+failures"
LENGTH, CHANNELS, FOLDS = 15, 6, 5

Classes = NDArray[np.str_]
Results = dict[str, Any]

PUBLISHED = {  # accuracy, %: SMTS, WEASEL+MUSE
    "lp1": (85.6, 94.0),
    "lp2": (76.0, 73.3),
    "lp3": (76.0, 90.0),
    "lp4": (89.5, 96.0),
    "lp5": (65.0, 69.0),
}


def read_windows(path: Path) -> tuple[Array, Classes]:
    """Reads a problem.

    Returns:
        The windows, shape (n, 15, 6), in the units of the file, and their classes, shape (n,).

    Raises:
        ValueError: if a window is incomplete or has something else than whole numbers. The message names the line.
    """
    lines = enumerate(path.read_text(encoding="utf-8", errors="replace").splitlines(), start=1)
    classes: list[str] = []
    wrenches: list[list[int]] = []
    for number, line in lines:
        words = line.split()
        if not words:
            continue
        begins = len(wrenches) == LENGTH * len(classes)
        try:
            if begins and line.strip().replace("_", "").isalpha():
                classes.append(words[0])
            elif not begins and len(words) == CHANNELS:
                wrenches.append([int(word) for word in words])
            else:
                raise ValueError
        except ValueError:
            expected = "the class of the next window" if begins else f"{CHANNELS} whole numbers"
            raise ValueError(f"{path}, line {number}: '{line.strip()[:40]}', expected {expected}") from None
    if not classes or len(wrenches) != LENGTH * len(classes):
        raise ValueError(f"{path}: {len(classes)} windows and {len(wrenches)} wrenches, expected {LENGTH} a window")
    return np.array(wrenches, dtype=float).reshape(-1, LENGTH, CHANNELS), np.array(classes)


def read_problems(folder: Path) -> dict[str, tuple[Array, Classes]]:
    """Reads all problems of a folder.

    Raises:
        ValueError: if a file is missing or damaged.
    """
    missing = [f"{name}.data" for name in PUBLISHED if not (folder / f"{name}.data").is_file()]
    if missing:
        raise ValueError(f"{folder}: no {', '.join(missing)}; download them from {ADDRESS} and unpack them there")
    return {name: read_windows(folder / f"{name}.data") for name in PUBLISHED}


def copies(windows: Array) -> NDArray[np.intp]:
    """Numbers of the groups of windows that are copies of each other, shape (n,).

    Two windows are copies if at least half of the wrenches of one are in the other, in any order.
    """
    wrenches = [{tuple(wrench) for wrench in window} for window in windows]
    shared = [[2 * len(one & other) >= min(len(one), len(other)) for other in wrenches] for one in wrenches]
    groups: NDArray[np.intp] = connected_components(np.array(shared), directed=False)[1].astype(np.intp)
    return groups


def statistics(windows: Array) -> Array:
    """Mean, standard deviation, least and greatest value of each channel, shape (n, 24)."""
    return np.hstack([windows.mean(axis=1), windows.std(axis=1), windows.min(axis=1), windows.max(axis=1)])


def longest_visits(inside: NDArray[np.bool_]) -> NDArray[np.intp]:
    """The longest run of true values along the second axis of (n, t, m), shape (n, m)."""
    run = longest = np.zeros((len(inside), inside.shape[2]), dtype=np.intp)
    for sample in np.moveaxis(inside, 1, 0):
        run = (run + 1) * sample
        longest = np.maximum(longest, run)
    return longest


class StateHistograms(TransformerMixin, BaseEstimator):
    """The share of a window in each state and the longest visit to it, as shares of its length, shape (n, 2 M).

    Args:
        learner: finds the states in the scaled samples of windows (n, 15, 6), without their classes.
    """

    def __init__(self, learner: ContactStates | CompetitiveAgglomeration) -> None:
        self.learner = learner

    def fit(self, X: Array, y: Any = None) -> Self:
        self.scaler_ = StandardScaler().fit(X.reshape(-1, CHANNELS))
        samples = self.scaler_.transform(X.reshape(-1, CHANNELS))
        self.learner_ = clone(self.learner).fit(samples, groups=np.repeat(np.arange(len(X)), LENGTH))
        return self

    def transform(self, X: Array) -> Array:
        samples = self.scaler_.transform(X.reshape(-1, CHANNELS))
        windows = np.repeat(np.arange(len(X)), LENGTH)
        together = {"groups": windows} if isinstance(self.learner_, ContactStates) else {}
        states = self.learner_.predict(samples, **together).reshape(len(X), LENGTH)
        inside = states[:, :, None] == np.arange(self.learner_.n_clusters_)
        return np.hstack([inside.mean(axis=1), longest_visits(inside) / LENGTH])


def learners(seed: int) -> dict[str, Any]:
    """The classifiers of windows (n, 15, 6), by their names in the table."""
    features = {
        "statistics": FunctionTransformer(statistics),
        "states": StateHistograms(ContactStates(random_state=seed)),
        "components": StateHistograms(CompetitiveAgglomeration(random_state=seed)),
    }
    return {
        name: make_pipeline(transformer, RandomForestClassifier(random_state=seed))
        for name, transformer in features.items()
    }


def accuracies(windows: Array, classes: Classes, repeats: int, seed: int, advance: Callable[[str], None]) -> Results:
    """The figures of a problem; keys are those of the file."""
    groups = copies(windows)
    n = len(windows)
    found: Results = {
        "windows": n,
        "copies": n - len(np.unique(groups)),
        "classes": len(np.unique(classes)),
        "majority": float(np.unique(classes, return_counts=True)[1].max() / n),
    }
    for name, learner in learners(seed).items():
        shares = []
        for repeat in range(repeats):
            folds = StratifiedGroupKFold(FOLDS, shuffle=True, random_state=seed + repeat)
            told = cross_val_predict(learner, windows, classes, groups=groups, cv=folds)
            shares.append(float(np.mean(told == classes)))
            advance(name)
        accuracy = float(np.mean(shares))
        found[name] = {"accuracy": accuracy, "interval": wilson(round(accuracy * n), n)}
    return found


def main(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="Files lp1.data to lp5.data.")],
    repeats: Annotated[int, typer.Option(min=1, help="Repetitions of the cross-validation.")] = 5,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the folds and the learners.")] = 0,
    json: JsonFile = None,
) -> None:
    warnings.simplefilter("ignore")  # of classes with fewer windows than folds
    problems = read_problems(folder)
    names = list(learners(seed))
    with threadpool_limits(1), progress("folds", len(problems) * len(names) * repeats) as advance:
        found = {name: accuracies(*problem, repeats, seed, advance) for name, problem in problems.items()}
    table = plain_table("accuracy (%) and its 95 % interval; the last two: published, not checked at the source")
    table.padding = (0, 0, 0, 0)  # so that ten columns fit 80 characters
    table.add_column("")
    for name in ("windows", "copies", "classes", "majority", *names, "SMTS", "MUSE"):
        table.add_column(name, justify="right")
    for name, row in found.items():
        numbers = (str(row[key]) for key in ("windows", "copies", "classes"))
        cells = (percent(row[key]["accuracy"], row[key]["interval"]) for key in names)
        table.add_row(name, *numbers, percent(row["majority"]), *cells, *(f"{p:.0f}" for p in PUBLISHED[name]))
    console.print(table)
    finish({"seed": seed, "repeats": repeats, "problems": found}, json)


def percent(share: float, interval: tuple[float, float] | None = None) -> str:
    """A share in per cent, with its interval in a second line."""
    return f"{100 * share:.0f}" + ("" if interval is None else "\n{:.0f}-{:.0f}".format(*np.multiply(100, interval)))


if __name__ == "__main__":
    run(main)
