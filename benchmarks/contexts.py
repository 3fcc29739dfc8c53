"""Which contexts are found in recorded demonstrations, and how soon an answer to an own motion tells the side.

    python -m benchmarks.contexts [--demonstrations FOLDER ...] [--json FILE]

One row for each set of demonstrations. *contexts*: how many `ContextMixture` finds in the good ones, and the gain of
the last one that was accepted, in nats per demonstration, with its standard error. *side*: share of the demonstrations
with the pivot of the fixture at least ``OFF`` off the mouth that lie in a context whose majority has its pivot on the
same side; *chance* is the same in a single context. The sides serve this judgement only.

*told after 0.1, 0.2, 0.4 s*: of the same demonstrations, the share whose side is told right by the evidence of that
much time under load, each from all others with their sides given. This is what the answers contain, whatever is
discovered.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from benchmarks.command_line import Demonstrations, JsonFile, finish, run
from interfaces.reports.result_tables import plain_table
from interfaces.terminal import busy, console
from skill.arrays import Array
from skill.data.demonstration import Demonstration, read_demonstrations
from skill.features.responses import ResponseFeatures, joined
from skill.features.wrench_features import CanonicalFeatures
from skill.manipulation_skill import ManipulationSkill
from skill.regression.response_model import ResponseModel
from skill.states.context_mixture import ContextMixture

OFF = 8e-4  # m
TIMES = (0.1, 0.2, 0.4)  # s
PERIOD = 0.02  # s


def pivot_of(demonstration: Demonstration) -> float:
    """Height of the pivot of the fixture above the mouth, m."""
    return float(yaml.safe_load(demonstration.metadata["scenario"])["rig"]["pivot_height"])


def found_in(demonstrations: Sequence[Demonstration]) -> dict[str, Any]:
    """The figures of one set."""
    good = [d for d in demonstrations if d.good]
    features, rng = ResponseFeatures(CanonicalFeatures(), CanonicalFeatures().peg_radius), np.random.default_rng(0)
    samples = ManipulationSkill().sample_settings()
    answers, group = joined({k: samples.responses(d, features, PERIOD, rng) for k, d in enumerate(good)})
    mixture = ContextMixture(random_state=0).fit(answers.features, answers.outputs, inputs=answers.inputs, groups=group)
    pivots = np.array([pivot_of(d) for d in good])[mixture.groups_]
    context = mixture.responsibilities_.argmax(axis=1)
    accepted = mixture.gains_[: mixture.n_contexts_ - 1]
    return {
        "contexts": mixture.n_contexts_,
        "gain": accepted[-1] if accepted else None,
        "side": agreement(context, pivots),
        "chance": agreement(np.zeros_like(context), pivots),
        "told": told(mixture, group, pivots),
    }


def agreement(context: NDArray[np.intp], pivots: Array) -> float:
    """Share of the demonstrations with a pivot off the mouth that agree with the majority of their context."""
    off = np.abs(pivots) > OFF
    high = pivots > 0.0
    right = 0
    for k in np.unique(context[off]):
        members = high[off & (context == k)]
        right += max(int(members.sum()), int((~members).sum()))
    return right / int(off.sum())


def told(mixture: ContextMixture, group: NDArray[np.intp], pivots: Array) -> list[float]:
    """Shares of the demonstrations whose side is told right after each of ``TIMES`` under load."""
    model, samples = ResponseModel(mixture.samples_), mixture.samples_
    member = np.searchsorted(mixture.groups_, group)
    sides = np.column_stack([pivots <= 0.0, pivots > 0.0]).astype(float)
    right = []
    for g in np.flatnonzero(np.abs(pivots) > OFF):
        own = member == g
        kernel = samples.kernel(samples.X[own], mixture.bandwidth) * (~own)
        evidence = model.log_likelihoods(
            kernel, sides[member], samples.U[own], samples.Y[own], mixture.correlation_times_
        )
        total = np.cumsum(evidence[:, 1] - evidence[:, 0])
        last = [min(round(time / PERIOD), len(total)) - 1 for time in TIMES]
        right.append((total[last] > 0.0) == (pivots[g] > 0.0))
    return [float(share) for share in np.mean(right, axis=0)]


def main(demonstrations: Demonstrations = [Path("out/demonstrations")], json: JsonFile = None) -> None:  # noqa: B006
    table = plain_table("contexts of demonstrations; last columns: sides told right after that time")
    titles = ("contexts", "gain", "side", "chance", *(f"{time:g} s" for time in TIMES))
    for title in ("set", *titles):
        table.add_column(title, justify="left" if title == "set" else "right", vertical="bottom", no_wrap=True)
    content = {}
    for folder in demonstrations:
        with busy(f"contexts of {folder}"):
            row = content[str(folder)] = found_in(read_demonstrations(folder))
        gain = "" if row["gain"] is None else "{:.1f} ± {:.1f}".format(*row["gain"])
        shares = (f"{share:.2f}" for share in (row["side"], row["chance"], *row["told"]))
        table.add_row(folder.name, str(row["contexts"]), gain, *shares)
    console.print(table)
    finish(content, json)


if __name__ == "__main__":
    run(main)
