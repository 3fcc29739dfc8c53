"""
Your own recording
==================

Discover the contact states in recordings of any force/torque sensor. Nothing here needs Drake.
"""

# %%
# Twelve recordings of a made-up assembly with three phases: free motion, sliding along a face, pressing. With files
# of your own, ``read_recordings("insert_1.csv")`` gives the same objects; :doc:`/recordings` lists what it reads.

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

from skill import ContactStates, Recording

RATE = 100  # Hz
FORCE = np.array([[0, 0, 0], [4, 0, -7], [0, 0, -25]])  # N, on the part
CHANNELS = ("fx", "fy", "fz")


def made_up(trial: int) -> Recording:
    """Makes a recording with an unsteady hand and a noisy sensor."""
    rng = np.random.default_rng(trial)
    counts = (RATE * np.array([1.5, 2.5, 1.5]) * rng.uniform(0.7, 1.3, size=3)).astype(int)
    phase = np.repeat(np.arange(3), counts)
    hand = np.zeros((len(phase), 3))
    for k in range(1, len(phase)):
        hand[k] = 0.97 * hand[k - 1] + 0.15 * rng.normal(size=3)
    force = FORCE[phase] + hand * (phase > 0)[:, None] + 0.05 * rng.normal(size=hand.shape)
    return Recording(f"trial {trial}", np.arange(len(phase)) / RATE, force, CHANNELS, phases=phase)


recordings = [made_up(trial) for trial in range(12)]

# %%
# ``ContactStates`` is a clusterer of scikit-learn. ``groups`` says which samples belong to one recording.

values = np.vstack([recording.values for recording in recordings])
groups = np.repeat(np.arange(len(recordings)), [len(recording.time) for recording in recordings])
states = ContactStates(random_state=0).fit(values, groups=groups)
print(f"{states.n_clusters_} contact states")

# %%
# The known phases were not used. They tell what each state is:

known = np.concatenate([recording.phases for recording in recordings])
print(pd.crosstab(known, states.labels_, rownames=["phase"], colnames=["state"]))

# %%
# One recording over its states.

first = recordings[0]
labels = states.labels_[groups == 0]
figure, axis = plt.subplots(figsize=(7, 3), layout="constrained")
for k, name in enumerate(CHANNELS):
    axis.plot(first.time, first.values[:, k], label=name)
for state in range(states.n_clusters_):
    axis.fill_between(first.time, 0, 1, where=labels == state, alpha=0.15, transform=axis.get_xaxis_transform())
axis.set(xlabel="time [s]", ylabel="force [N]")
axis.legend()

# %%
# The same for files, with a page of all recordings:
#
# .. code-block:: console
#
#     $ haptic-skill states insert_*.csv
