"""Data sets of LeRobot from synthetic recordings."""

import numpy as np

from scripts.export import export_lerobot
from skill.data.demonstration import write_demonstration
from skill.data.rig_run import write_rig_run
from tests.trajectories import make_demonstration, make_rig_run


def write_demonstrations(folder, count=3):
    for k in range(count):
        demonstration = make_demonstration(direction=0.5 * k, number=k)
        write_demonstration(demonstration, folder / f"{k:03d}_good_expert.parquet")
    return folder


def write_runs(folder, count=3, **options):
    for k in range(count):
        write_rig_run(make_rig_run(tilt=np.radians(2.0 + k), **options), folder / f"run_{k:04d}.parquet")
    return folder


def exported(folder, write=write_demonstrations):
    """The folder of recordings and the folder of their data set."""
    source, dataset = write(folder / "recordings"), folder / "dataset"
    export_lerobot(source, dataset)
    return source, dataset
