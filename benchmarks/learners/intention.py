"""How much of a demonstrated action can be predicted: the action as it was shown, and what the person intended.

    python -m benchmarks.learners.intention [--demonstrations FOLDER ...] [--json FILE]

The refined samples of the good demonstrations are predicted by locally weighted regression on the canonical features,
each fifth of the demonstrations from the others. Under load, where a person has something to correct, the table gives
1 - sum (y - yhat)^2 / sum y^2 of the turn about the canonical y axis, the share of predictions with the right sign, and
the same coefficient of the feed. The targets are the next action of the operator, the mean of those in the next 0.1 and
0.3 s, and `intended_actions`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from rich.table import Table
from sklearn.model_selection import GroupKFold, cross_val_predict

from benchmarks.command_line import add_demonstrations, argument_parser, run
from interfaces.terminal import console, write_json
from skill.arrays import Array
from skill.data.demonstration import Demonstration, read_demonstrations
from skill.data.refinement import INTENDED, intended_actions, refine_demonstration, with_following_actions
from skill.features.measurement import contact_loads
from skill.features.wrench_features import MEASURED, CanonicalFeatures
from skill.manipulation_skill import ManipulationSkill
from skill.regression.locally_weighted_regression import LWRegressor

DEFAULT = ManipulationSkill()  # for its settings of refinement and intention
LOADED = 1.0  # N
SHOWN = ("rx", "ry", "uz")
WINDOWS = {"next action": 1, "mean of 0.1 s": 5, "mean of 0.3 s": 15}


def targets_of(demonstration: Demonstration) -> pd.DataFrame:
    """The refined samples of a demonstration, with the columns of every target: "name/column"."""
    samples = with_following_actions(demonstration.samples)
    backwards = samples[list(SHOWN)][::-1]
    for name, length in WINDOWS.items():
        mean = backwards.rolling(length, min_periods=1).mean()[::-1]
        samples[[f"{name}/{column}" for column in SHOWN]] = mean
    intended = intended_actions(samples, correction_time=DEFAULT.correction_time, feed_time=DEFAULT.feed_time)
    samples[[f"intended/{column}" for column in SHOWN]] = intended[list(INTENDED)].to_numpy()
    return refine_demonstration(samples, still=DEFAULT.still, rough=DEFAULT.rough)[0]


def predicted(demonstrations: Sequence[Demonstration]) -> list[dict[str, Any]]:
    """One row of figures for each target."""
    refined = [targets_of(d) for d in demonstrations if d.good]
    samples = pd.concat(refined, ignore_index=True)
    groups = np.repeat(np.arange(len(refined)), [len(r) for r in refined])
    features = CanonicalFeatures()
    measured = samples[list(MEASURED)].to_numpy()
    X = features.transform(measured)
    loaded = contact_loads(measured, features.peg_radius) > LOADED
    rows = []
    for name in (*WINDOWS, "intended"):
        Y = features.actions_to_frame(measured, samples[[f"{name}/{column}" for column in SHOWN]].to_numpy())
        model = LWRegressor(bandwidth=1.0, feature_scale="standard", ridge=1.0)
        found = cross_val_predict(model, X, Y, groups=groups, cv=GroupKFold(5))
        rows.append({"target": name, **figures(Y[loaded], found[loaded])})
    return rows


def figures(Y: Array, found: Array) -> dict[str, float]:
    """Coefficients of determination about zero, and the share of right signs of the turn; columns as of the actions."""
    explained = 1.0 - ((Y - found) ** 2).sum(axis=0) / (Y**2).sum(axis=0)
    sign = float(np.mean(np.sign(Y[:, 1]) == np.sign(found[:, 1])))
    return {"turn": float(explained[1]), "sign": sign, "feed": float(explained[2])}


def main() -> None:
    parser = argument_parser(__doc__)
    add_demonstrations(parser)
    arguments = parser.parse_args()
    table = Table(title="left-out demonstrations, under load")
    for column in ("set", "target", "turn", "right sign", "feed"):
        table.add_column(column, justify="left" if column in ("set", "target") else "right")
    content = {}
    for folder in arguments.demonstrations:
        content[str(folder)] = predicted(read_demonstrations(folder))
        for row in content[str(folder)]:
            table.add_row(
                *(folder.name, row["target"]), *(f"{row['turn']:.2f}", f"{row['sign']:.2f}", f"{row['feed']:.2f}")
            )
    console.print(table)
    if arguments.json is not None:
        write_json(arguments.json, content)


if __name__ == "__main__":
    run(main)
