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

from benchmarks.command_line import add_demonstrations, argument_parser, run
from skill.arrays import Array
from skill.data.demonstration import Demonstration, read_demonstrations
from skill.features.contact_features import ContactFeatures
from skill.features.responses import LOADS, ResponseFeatures
from skill.manipulation_skill import ManipulationSkill
from skill.planning.planning_model import MAX_LOAD, PlanningModel
from skill.planning.transitions import Transitions, transitions
from skill.states.context_filter import pair_probabilities
from skill.training_samples import observed_series
from systems.reports.result_tables import plain_table
from systems.reports.terminal import console, progress, write_json

FOLDS = 5
KINDS = ("drift", "motion", "context")


def rows_of(skill: ManipulationSkill, demonstration: Demonstration, rng: np.random.Generator) -> Transitions:
    """The transitions of a demonstration in the states of a skill."""
    noisy = skill.sample_settings().with_noise(demonstration.samples, rng)
    labels = skill.states_.predict(skill.state_features_.transform_demonstration(noisy))
    responses = ResponseFeatures(skill.features_, ContactFeatures().peg_radius)
    settings: dict[str, Any] = {"n_states": skill.n_states, "period": skill.period_}
    return transitions([observed_series(noisy)], [labels], [demonstration.good], responses, **settings)[0]


def told_context(skill: ManipulationSkill, rows: Transitions, informative: NDArray[np.bool_]) -> Array:
    """Probabilities (1, C) of the contexts after all informative answers (n,) of a demonstration."""
    if skill.contexts_ is None or not informative.any():
        return np.ones((1, 1)) if skill.contexts_ is None else skill.contexts_.weights_[None]
    told = (rows.features[informative], rows.outputs[informative])
    return skill.contexts_.predict_proba(*told, inputs=rows.inputs[informative], groups=np.zeros(informative.sum()))


def predicted(skill: ManipulationSkill, demonstration: Demonstration, rng: np.random.Generator) -> dict[str, Array]:
    """The changes of the loads, what is predicted of them, and the states that follow, of the judged samples."""
    rows = rows_of(skill, demonstration, rng)
    responses = ResponseFeatures(skill.features_, ContactFeatures().peg_radius)
    informative = responses.informative(np.column_stack([rows.measured, np.zeros((len(rows.times), 2))]))
    Q = told_context(skill, rows, informative)
    any_context = np.full_like(Q, 1.0 / Q.size) if skill.contexts_ is None else skill.contexts_.weights_[None]
    judged = np.flatnonzero(informative & (np.abs(rows.outputs).max(axis=1) <= MAX_LOAD))
    states, model = skill.state_probabilities(rows.measured), cast(PlanningModel, skill.planning_)
    found: dict[str, list[Any]] = {name: [] for name in (*KINDS, "desired", "usual")}
    for row in judged:
        for context, kinds in ((any_context, KINDS[:2]), (Q, KINDS[2:])):
            weights = model.log_weights(rows.features[row], pair_probabilities(states[row : row + 1], context)[0])
            drift, response = model.forward(weights)
            for kind in kinds:
                found[kind].append(drift + (0.0 if kind == "drift" else response @ rows.inputs[row]))
        found["desired"].append(model.desired(weights).state)
        found["usual"].append(int(skill.graph_.next_given_success_[states[row].argmax()].argmax()))
    arrays = {name: np.array(values) for name, values in found.items()}
    return arrays | {"changes": rows.outputs[judged], "next": rows.next_states[judged]}


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


def main() -> None:
    parser = argument_parser(__doc__)
    add_demonstrations(parser)
    arguments = parser.parse_args()
    table = plain_table("share of the changes of the loads over 0.1 s that is predicted, and of the next states")
    for title in ("set", "samples", "with", *LOADS, "usual", "desired"):
        table.add_column(title, justify="left" if title in ("set", "with") else "right", no_wrap=True)
    content = {}
    with progress("sets", FOLDS * len(arguments.demonstrations)) as advance:
        for folder in arguments.demonstrations:
            content[str(folder)] = judged(read_demonstrations(folder), advance)
    for name, row in content.items():
        for kind in KINDS:
            first = [Path(name).name, str(row["samples"])] if kind == KINDS[0] else ["", ""]
            last = [f"{row['usual']:.2f}", f"{row['desired']:.2f}"] if kind == KINDS[0] else []
            table.add_row(*first, kind, *(f"{share:.2f}" for share in row["shares"][kind]), *last)
    console.print(table)
    if arguments.json is not None:
        write_json(arguments.json, content)


if __name__ == "__main__":
    run(main)
