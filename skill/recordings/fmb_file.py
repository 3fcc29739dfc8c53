"""Trajectories of the Functional Manipulation Benchmark (FMB): refused, with the command that converts them.

By documentation, tested on synthetic files only. A trajectory is an .npy file with a pickled dictionary
(https://functional-manipulation-benchmark.github.io/dataset). Of its arrays the command takes ``obs/tcp_force`` and
``obs/tcp_torque``, shape (n, 3), in the frame of the end effector, and ``primitive``, n texts. Times are not
documented; 10 Hz is the rate of the port to LeRobot, https://huggingface.co/datasets/robot-lev/fmb. Nor are units; they
are taken to be N and N m.
"""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import NoReturn

CONVERSION = (
    "import sys, numpy as np; f = sys.argv[1]; d = np.load(f, allow_pickle=True).item(); "
    "F, M = d['obs/tcp_force'], d['obs/tcp_torque']; "
    "np.savez(f[:-4], time_s=np.arange(len(F)) / 10, wrench=np.hstack([F, M]), phase=np.array(d['primitive'], str))"
)
"""Program that writes NAME.npz for the trajectory NAME.npy."""


def refuse_npy_file(path: Path) -> NoReturn:
    """Refuses a file: opening a pickle can run any program, so its user must trust it, and convert it.

    Raises:
        ValueError: always. The message has the command.
    """
    if not path.is_file():
        raise ValueError(f"{path}: no such file")
    raise ValueError(
        f"{path}: an .npy file has no names; expected an .npz with 'time' and 'wrench'. A trajectory of FMB is a"
        f' pickle, which is not opened here; if you trust it, run: python -c "{CONVERSION}" {shlex.quote(str(path))}'
    )
