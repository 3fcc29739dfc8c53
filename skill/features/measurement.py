"""What a policy receives, a measurement and its own turns, and the contact load that the force guard limits."""

from __future__ import annotations

import math

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from compiled import compiled
from skill.arrays import Array

MEASURED = ("fx", "fy", "fz", "mx", "my", "mz", "z")
"""What the rig measures: the wrench on the peg about its tip, expressed in P (N, N m), and the height of the tip above
the mouth, (p_HP)_z (m), which is minus the insertion depth."""


def measurement(wrench: ArrayLike, depth: ArrayLike) -> Array:
    """Joins a wrench and a depth to a measurement.

    Args:
        wrench: (..., 6), force (N), then moment (N m), on the peg about its tip, in P.
        depth: (...), depth of the tip below the mouth, m.

    Returns:
        (..., 7), the wrench and the height z = -depth of the tip, in the order of `MEASURED`.
    """
    return np.concatenate([np.asarray(wrench, dtype=float), -np.asarray(depth, dtype=float)[..., None]], axis=-1)


def observations(measured: Array, turned: Array) -> Array:
    """Joins measurements (..., 7) and own turns (..., 2) to observations (..., 9).

    The own turn is the rotation vector (about x and y of P, rad) by which own motions have turned the peg relative to
    the hole since the start.
    """
    return np.concatenate([measured, turned], axis=-1)


def rig_observations(measured: Array, targets: Array) -> Array:
    """Joins measurements (..., 7) and commanded angles of the hole (..., 2), rad, to observations (..., 9).

    Turning the hole by an angle turns the peg relative to it by minus that angle.
    """
    return observations(measured, -targets)


def observed_series(samples: pd.DataFrame) -> Array:
    """Returns the observations (n, 9) of the samples of a demonstration; the own turn is the sum of its turns."""
    turned = samples[["rx", "ry"]].to_numpy().cumsum(axis=0)
    return observations(samples[list(MEASURED)].to_numpy(), turned)


def contact_loads(wrenches: Array, lever: float) -> Array:
    """Returns the load sqrt(|f|^2 + |m/r|^2) of each wrench, N.

    The moment counts because a wedged peg carries a large couple under a small net force.

    Args:
        wrenches: (..., 6 or more), force f (N), then moment m (N m); further elements are ignored.
        lever: r of the moments, m; the reach of the peg.
    """
    force, moment = np.linalg.norm(wrenches[..., :3], axis=-1), np.linalg.norm(wrenches[..., 3:6], axis=-1)
    loads: Array = np.hypot(force, moment / lever)
    return loads


def contact_load(wrench: Array, lever: float) -> float:
    """Returns the load of one wrench (6 or more,), N; see `contact_loads`."""
    return float(contact_loads(wrench, lever))


@compiled
def load_of_components(fx: float, fy: float, fz: float, mx: float, my: float, mz: float, lever: float) -> float:
    """Returns the load of fx fy fz (N) mx my mz (N m) as `contact_load` does, up to rounding, and faster."""
    moment = (mx * mx + my * my + mz * mz) / (lever * lever)
    return math.sqrt(fx * fx + fy * fy + fz * fz + moment)
