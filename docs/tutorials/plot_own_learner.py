"""
Your own learner
================

Replace the regression of the skill by an estimator of scikit-learn, and compare both in the same trials.
"""

# %%
# Ten demonstrations to learn from.

import matplotlib.pyplot as plt
import numpy as np
from sklearn.neighbors import KNeighborsRegressor
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from experiments.demonstration_set import demonstrate, requests
from experiments.trial.run_trial import run_trials
from models.scenario import load_scenario
from skill import CompetitiveAgglomeration, ManipulationSkill

scenario = load_scenario("nominal")
demonstrations = [demonstrate(scenario, request, seed=1) for request in requests(8, 2)]

# %%
# ``regressor`` takes anything with ``fit`` and ``predict`` and several outputs. It learns the turns and the feed in a
# frame that the lateral force defines, so that one demonstration serves for all directions. A regressor of
# scikit-learn does not know the contact states. To leave them out for good, give the skill a single one.

neighbours = make_pipeline(StandardScaler(), KNeighborsRegressor(10, weights="distance"))
skills = {
    "locally weighted regression": ManipulationSkill(),
    "10 nearest neighbours, no states": ManipulationSkill(
        regressor=neighbours, states=CompetitiveAgglomeration(m_init=1)
    ),
}
for name, skill in skills.items():
    skill.fit(demonstrations)
    print(f"{name}: {skill.n_states} contact states")

# %%
# Five unseen trials each. Five are far too few to tell one learner from another: :doc:`/comparisons` has hundreds.

results = {}
for name, skill in skills.items():
    results[name] = [result for result, _ in run_trials(scenario, skill, list(range(5)), jobs=1)]
    inserted = sum(result.inserted for result in results[name])
    load = np.median([result.peak_load for result in results[name]])
    print(f"{name}: {inserted} of 5 inserted, median peak load {load:.1f} N")

# %%
# Time of each trial; a cross did not insert.

figure, axis = plt.subplots(figsize=(7, 3), layout="constrained")
for name, found in results.items():
    (line,) = axis.plot([r.seed for r in found], [r.time for r in found], "o", label=name)
    failed = [r for r in found if not r.inserted]
    axis.plot([r.seed for r in failed], [r.time for r in failed], "x", ms=14, color=line.get_color())
axis.set(xlabel="trial", ylabel="time [s]", ylim=(0, None))
axis.legend()
