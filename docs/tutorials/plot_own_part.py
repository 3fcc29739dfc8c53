"""
Your own part
=============

From the STEP files of a shaft and its block to an insertion: measure the fit, demonstrate, learn, insert. On the
command line this is ``haptic-skill part``, ``record``, ``train`` and ``rig``, which ends with a report.
"""

# %%
# The files of an 8 mm shaft with a flat, and of a block with its hole. Use your own: one closed body in each, drawn as
# they are assembled. STL files have no unit and are read in mm.

from pathlib import Path

import matplotlib.pyplot as plt

import models
from experiments.demonstration_set import demonstrate_all, requests
from experiments.trial.run_trial import run_trials
from interfaces.reports.part_figure import plot_part
from models.cad.pair import fit
from models.cad.scenario_file import part_text, remarks
from models.cad.solid_file import read_solid
from models.scenario import load_scenario
from skill import ManipulationSkill
from skill.features.measurement import contact_loads

folder = Path(models.__file__).parent / "parts"
found = fit(read_solid(folder / "d_shaft.step"), read_solid(folder / "d_shaft_hole.step"))
print("\n".join(remarks(found)))

# %%
# The clearance over the angle about the axis. It is measured between arcs and sides that are fitted to the corners of
# the meshes.

figure = plot_part(found)

# %%
# The scenario. Numerics that it does not name follow from its clearance.

text = part_text(found)
print(text)

# %%
# Sixteen demonstrations by the simulated operator, on rigid bodies, and the skill that they teach.

path = Path("part.yaml")
path.write_text(text)
scenario = load_scenario(path, "exact")
path.unlink()
demonstrations = [shown for _, shown in demonstrate_all(scenario, requests(13, 3), seed=1, jobs=1)]
skill = ManipulationSkill().fit(demonstrations)
print(f"{skill.n_states} contact states")

# %%
# Ten insertions from tilts that no demonstration has.

trials = list(run_trials(scenario, skill, list(range(10)), jobs=1))
for result, _ in trials:
    print(f"trial {result.seed}: {result.outcome}, {result.time:.1f} s, load {result.peak_load:.0f} N")
print(f"{sum(result.inserted for result, _ in trials)} of {len(trials)} inserted")

# %%
# Depth and load of the insertions. The report of ``haptic-skill rig`` has a replay of each.

figure, (above, below) = plt.subplots(2, 1, sharex=True, layout="constrained")
for _, run in trials:
    wrenches = run.samples[["fx", "fy", "fz", "mx", "my", "mz"]].to_numpy()
    above.plot(run.samples["time"], 1e3 * run.samples["depth"])
    below.plot(run.samples["time"], contact_loads(wrenches, scenario.geometry.reach))
above.set_ylabel("depth [mm]")
below.set(xlabel="time [s]", ylabel="load [N]")
figure.align_labels()
