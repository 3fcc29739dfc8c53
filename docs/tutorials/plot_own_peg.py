"""
Your own peg
============

Teach the insertion of another peg: radius 6 mm in a hole with radius 6.05 mm, and a chamfer of 0.8 mm.
"""

# %%
# A scenario is a YAML file. State what differs, in SI units; numerics, lengths and drives follow the geometry.

import matplotlib.pyplot as plt
import numpy as np

from experiments.demonstration_set import demonstrate, requests
from experiments.trial.run_trial import run_trials
from models.clearance import followed
from models.scenario import parse_scenario
from skill import ManipulationSkill

scenario = parse_scenario("geometry: {peg_radius: 0.006, hole_radius: 0.00605, chamfer: 0.0008}", "my peg")
print(f"clearance over radius: {scenario.geometry.clearance / scenario.geometry.peg_radius:.4f}")
print(f"follows the geometry: {followed(scenario)}")

# %%
# Eight good demonstrations and two bad ones. A simulated operator feels the forces through a spring and a damper, and
# sees the tilt late and with errors; each habit is another way to do it, or to fail.

demonstrations = [demonstrate(scenario, request, seed=0) for request in requests(8, 2)]
for demonstration in demonstrations:
    print(f"{'good' if demonstration.good else 'bad '} {demonstration.reason}, {demonstration.duration:.1f} s")

# %%
# The skill discovers the contact states in all of them, and learns the actions of the good ones.

skill = ManipulationSkill(random_state=0).fit(demonstrations)
print(f"{skill.n_states} contact states")

# %%
# Four trials on the rig, each from a tilt, a pivot and a friction of its own. The rig measures a wrench and a depth,
# and nothing else.

trials = list(run_trials(scenario, skill, [0, 1, 2, 3], jobs=1))
for result, _ in trials:
    tilt = np.degrees(np.hypot(*result.tilt))
    print(f"tilt {tilt:.1f} deg: {result.reason} in {result.time:.2f} s, peak load {result.peak_load:.1f} N")

# %%
# Depth and axial force of the four insertions.

figure, (above, below) = plt.subplots(2, 1, sharex=True, layout="constrained")
for result, run in trials:
    above.plot(run.samples["time"], 1e3 * run.samples["depth"], label=f"trial {result.seed}")
    below.plot(run.samples["time"], run.samples["fz"])
above.set_ylabel("depth [mm]")
above.legend()
below.set(xlabel="time [s]", ylabel="axial force [N]")
figure.align_labels()
