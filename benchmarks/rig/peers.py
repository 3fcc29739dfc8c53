"""Against what else a person would use: policies side by side on the same trials of the rig, in one run.

    python -m benchmarks.rig.peers [--demonstrations FOLDER] [--trials 20] [--jobs 1] [--only NAME ...] [--json FILE]
                                   [--figure FILE] [--scenario NAME] [--candidates 24] [--out FOLDER]

All stand behind the same limits, supervisor, motors and sensor; all that learn get the same demonstrations, refined and
seen through the sensor alike, and the same canonical features. Without --demonstrations thirty are recorded. Trials are
numbered from 7000 on. Compliance and search have parameters that people set by hand: these are tuned on rig trials of
their own, from 9000 on (`benchmarks.rig.control_laws.tuned`; by default 24 candidates, 104 trials), which the learners
do not get; their time to train is the time of those trials on one core.

The run can be interrupted and given again: what is stored below --out is not done again. A policy that fails, to
train or in a trial, is a row of the table like any other.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from benchmarks.rig.control_laws import MomentCompliance, SpiralSearch, StraightPush, TunedLaw, tuned, tuning_trials
from benchmarks.rig.figures import draw_groups
from benchmarks.rig.learners import (
    MixtureRegressor,
    MixtureStates,
    SubsetGaussianProcess,
    nearest_neighbours,
    network,
)
from benchmarks.rig.trials import Advance, Arm, Record, Setting, Train, command_line, compare, prepared
from models.scenario import load_scenario
from skill.clustering.competitive_agglomeration import CompetitiveAgglomeration
from skill.manipulation_skill import ManipulationSkill
from systems.control.policy import RigPolicy
from systems.reports.terminal import report_errors


def push(setting: Setting, record: Record, advance: Advance, draw: int) -> RigPolicy:
    return StraightPush(speed=setting.scenario.operator.insertion_speed)


def by_hand(law: type[TunedLaw]) -> Train:
    return lambda setting, record, advance, draw: tuned(law, setting, record, advance)


def one_state() -> CompetitiveAgglomeration:
    """No contact states: a single one, whose gate still tells what was never felt."""
    return CompetitiveAgglomeration(m_init=1)


def learnt(**parts: Any) -> Train:
    """A skill with some of its parts exchanged; ``parts`` are functions that make them."""

    def train(setting: Setting, record: Record, advance: Advance, draw: int) -> RigPolicy:
        return ManipulationSkill(**{name: part() for name, part in parts.items()}).fit(setting.demonstrations)

    return train


def arms(candidates: int) -> list[Arm]:
    tuning = tuning_trials(candidates)
    return [
        Arm("no correction", push),
        Arm("moment compliance, tuned", by_hand(MomentCompliance), tuning=tuning),
        Arm("spiral search, tuned", by_hand(SpiralSearch), tuning=tuning),
        Arm("k nearest neighbours", learnt(states=one_state, regressor=nearest_neighbours)),
        Arm("LWR without states", learnt(states=one_state)),
        Arm("Gaussian mixture regression", learnt(states=one_state, regressor=MixtureRegressor)),
        Arm("neural network (MLP)", learnt(states=one_state, regressor=network)),
        Arm("Gaussian process", learnt(states=one_state, regressor=SubsetGaussianProcess)),
        Arm("GMM-BIC states + LWR", learnt(states=MixtureStates)),
        Arm("CA states + LWR", learnt()),
    ]


@report_errors
def main() -> None:
    parser = command_line(__doc__)
    parser.add_argument("--candidates", type=int, default=24, help="of each tuning by hand")
    parser.add_argument("--figure", type=Path, help="draw the table to this file (.png or .svg)")
    arguments = parser.parse_args()
    chosen = selected(arms(arguments.candidates), arguments.only)
    setting = prepared(
        load_scenario(arguments.scenario),
        arguments.demonstrations,
        arguments.out,
        trials=arguments.trials,
        jobs=arguments.jobs,
        candidates=arguments.candidates,
    )
    summaries = compare("policies on the rig", chosen, setting, arguments.json)
    if arguments.figure is not None:
        draw_groups([("policies", [(row["name"], row) for row in summaries])], arguments.figure)


def selected(all_arms: list[Arm], only: list[str] | None) -> list[Arm]:
    """Those whose name has one of the given parts; all if none is given."""
    chosen = [arm for arm in all_arms if only is None or any(part.lower() in arm.name.lower() for part in only)]
    if not chosen:
        raise ValueError(f"--only {only} names none of {[arm.name for arm in all_arms]}")
    return chosen


if __name__ == "__main__":
    main()
