"""What follows an action: how well a planner predicts the loads and the next state of unseen demonstrations.

    python -m benchmarks.forward_models [--demonstrations FOLDER ...] [--json FILE]

Each fifth of the good demonstrations is predicted by a skill (`ManipulationSkill(policy="plan")`) that has learnt from
the others and from the bad ones. Under load and outside the deep half of the hole, where a turn is needed, the table
gives 1 - sum (y - yhat)^2 / sum y^2 of the changes of the loads over one horizon: *drift* without the own motion,
*motion* with it, and *context* with the motion and the context that the answers of the whole demonstration tell.
*desired*: how often the desired next state is the one that followed; *usual*: how often the most probable follower of
the state in successful demonstrations is.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray
from sklearn.model_selection import KFold

from benchmarks.command_line import Demonstrations, JsonFile, finish, run
from interfaces.reports.result_tables import plain_table
from interfaces.terminal import console, progress
from skill.arrays import Array
from skill.data.demonstration import Demonstration, read_demonstrations
from skill.features.contact_features import ContactFeatures
from skill.features.responses import LOADS, ResponseFeatures
from skill.manipulation_skill import ManipulationSkill
from skill.planning.planning_model import MAX_LOAD, PlanningModel
from skill.planning.transitions import Transitions
from skill.states.context_filter import pair_probabilities

FOLDS = 5
KINDS = ("drift", "motion", "context")


def predicted(skill: ManipulationSkill, demonstration: Demonstration, rng: np.random.Generator) -> dict[str, Array]:
    """The changes of the loads, what is predicted of them, and the states that follow, of the judged samples."""
    rows, _ = skill.transitions([demonstration], rng)
    responses = ResponseFeatures(skill.features_, ContactFeatures().peg_radius)
    informative = responses.informative(np.column_stack([rows.measured, np.zeros((len(rows.times), 2))]))
    chosen = np.flatnonzero(informative & (np.abs(rows.outputs).max(axis=1) <= MAX_LOAD))
    states, model = skill.state_probabilities(rows.measured), cast(PlanningModel, skill.planning_)
    unknown, told = contexts_of(skill, rows, informative)
    found: dict[str, list[Any]] = {name: [] for name in (*KINDS, "desired", "usual")}
    for row in chosen:
        without, with_context = (
            model.log_weights(rows.features[row], pair_probabilities(states[row : row + 1], contexts)[0])
            for contexts in (unknown, told)
        )
        drift, response = model.forward(without)
        found["drift"].append(drift)
        found["motion"].append(drift + response @ rows.inputs[row])
        drift, response = model.forward(with_context)
        found["context"].append(drift + response @ rows.inputs[row])
        found["desired"].append(model.desired(with_context).state)
        found["usual"].append(int(skill.graph_.next_given_success_[states[row].argmax()].argmax()))
    arrays = {name: np.array(values) for name, values in found.items()}
    return arrays | {"changes": rows.outputs[chosen], "next": rows.next_states[chosen]}


def contexts_of(skill: ManipulationSkill, rows: Transitions, informative: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Probabilities (1, C) of the contexts of a demonstration: before, and after all its informative answers (n,)."""
    if skill.contexts_ is None:
        return np.ones((1, 1)), np.ones((1, 1))
    shares = skill.contexts_.weights_[None]
    if not informative.any():
        return shares, shares
    X, y, inputs = (values[informative] for values in (rows.features, rows.outputs, rows.inputs))
    return shares, skill.contexts_.predict_proba(X, y, inputs=inputs, groups=np.zeros(len(X)))


def judged(demonstrations: Sequence[Demonstration], advance: Any) -> dict[str, Any]:
    """The figures of one set."""
    good = [d for d in demonstrations if d.good]
    bad = [d for d in demonstrations if not d.good]
    parts, rng = [], np.random.default_rng(0)
    for train, test in KFold(FOLDS).split(good):
        skill = ManipulationSkill(policy="plan").fit([*(good[k] for k in train), *bad])
        parts += [predicted(skill, good[k], rng) for k in test]
        advance("")
    joined = {name: np.concatenate([part[name] for part in parts if len(part["next"])]) for name in parts[0]}
    square = (joined["changes"] ** 2).sum(axis=0)
    shares = {kind: (1.0 - ((joined["changes"] - joined[kind]) ** 2).sum(axis=0) / square).tolist() for kind in KINDS}
    right = {name: float((joined[name] == joined["next"]).mean()) for name in ("desired", "usual")}
    return {"samples": len(joined["next"]), "shares": shares, **right}


def main(demonstrations: Demonstrations = [Path("out/demonstrations")], json: JsonFile = None) -> None:  # noqa: B006
    table = plain_table("share of the changes of the loads over 0.1 s that is predicted, and of the next states")
    for title in ("set", "samples", "with", *LOADS, "usual", "desired"):
        table.add_column(title, justify="left" if title in ("set", "with") else "right", no_wrap=True)
    content = {}
    with progress("sets", FOLDS * len(demonstrations)) as advance:
        for folder in demonstrations:
            content[str(folder)] = judged(read_demonstrations(folder), advance)
    for name, row in content.items():
        for kind in KINDS:
            first = [Path(name).name, str(row["samples"])] if kind == KINDS[0] else ["", ""]
            last = [f"{row['usual']:.2f}", f"{row['desired']:.2f}"] if kind == KINDS[0] else []
            table.add_row(*first, kind, *(f"{share:.2f}" for share in row["shares"][kind]), *last)
    console.print(table)
    finish(content, json)


if __name__ == "__main__":
    run(main)
