"""Recordings of three contacts as CSV files, and labelled recordings, for tests."""

from pathlib import Path

import numpy as np
import pandas as pd

from skill.recordings.recording import Recording
from skill.states.state_summary import LabelledRecording

CHANNELS = ("fx", "fy", "fz", "mx", "my", "mz")
FORCES = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, -8.0], [-12.0, 0.0, -16.0]])  # N, of the three contacts
MOMENTS = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.5, 0.0]])  # N m
NAMES = ("free", "8 N along -z", "20 N along -z -x, 0.5 N m about +y")


def three_contacts(seed: int, *, rate: float = 50.0, start: float = 0.0) -> pd.DataFrame:
    """A recording of about three seconds: time, wrench and phase; the noise is correlated."""
    rng = np.random.default_rng(seed)
    phase = np.repeat([0, 1, 2], (rng.uniform(0.8, 1.2, size=3) * rate).astype(int))
    noise = rng.normal(size=(len(phase), 6))
    for t in range(1, len(noise)):
        noise[t] = 0.8 * noise[t - 1] + 0.6 * noise[t]
    wrench = np.hstack([FORCES[phase], MOMENTS[phase]]) + noise * ([0.2] * 3 + [0.01] * 3)
    table = pd.DataFrame(wrench, columns=list(CHANNELS))
    table.insert(0, "time", start + np.arange(len(phase)) / rate)
    return table.assign(phase=np.array(["reach <i>", "touch", "press"])[phase])


def write_files(folder: Path, number: int = 3, *, phases: bool = True, **options: float) -> list[Path]:
    """Writes CSV files of one recording each."""
    paths = []
    for k in range(number):
        table = three_contacts(k, **options)
        paths.append(folder / f"insert_{k}.csv")
        (table if phases else table.drop(columns="phase")).to_csv(paths[-1], index=False)
    return paths


def labelled(states, values, *, time=None, channels=CHANNELS, phases=None, name="a.csv", probability=1.0, trial=""):
    """A recording whose sample has the values of its state; ten samples a second, by default."""
    states = np.asarray(states)
    time = 0.1 * np.arange(len(states)) if time is None else np.asarray(time)
    recording = Recording(name, time, np.asarray(values, dtype=float)[states], channels, phases, trial)
    return LabelledRecording(recording, states, np.full(len(states), probability))
