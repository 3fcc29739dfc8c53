"""Why the skill works: each of its choices undone by itself, and the learning curve, on the same trials of the rig.

    python -m benchmarks.rig.ablations [--demonstrations FOLDER] [--trials 20] [--jobs 1] [--only NAME ...]
                                       [--json FILE] [--figures FOLDER] [--scenario NAME] [--out FOLDER]

"CA states + LWR" is the product: canonical features; states by the repaired Competitive Agglomeration; demonstrations
in the rig's fixture, good and bad. Every other row differs from it in what its name says.

How bad demonstrations are used. A skill learns *states* and their graph from all demonstrations, and *actions* from the
good ones alone. The bad ones show contacts that gentle people avoid (a jam, a slam), so that the filter knows such a
contact for what it is instead of calling it unknown, and the graph knows from which states insertions fail; but what
the hand did there is what led into it, and is not imitated. Two rows put this to the test: "bad left out" learns from
the good ones alone, "bad imitated" takes the bad ones' actions for good.

The learning curve keeps four good ones in five, as the whole set does. Which demonstrations a small set happens to hold
matters; so each of its points is four skills, from four draws, that share the trials between them.

Without --demonstrations thirty are recorded; those in the free fixture (six freedoms, no virtual guide) always are. The
run can be interrupted and given again; what `benchmarks.rig.peers` has stored in the same --out counts.
"""

from __future__ import annotations

import copy
import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.rig.figures import draw_groups, draw_learning_curve
from benchmarks.rig.peers import one_state, selected
from benchmarks.rig.trials import (
    Advance,
    Arm,
    Record,
    Setting,
    Train,
    command_line,
    compare,
    prepared,
    recorded,
    recording_folder,
)
from models.scenario import Scenario, load_scenario
from skill.clustering.competitive_agglomeration import CompetitiveAgglomeration
from skill.data.demonstration import Demonstration, read_demonstrations
from skill.features.wrench_features import NormalisedFeatures, RawFeatures
from skill.manipulation_skill import ManipulationSkill
from systems.control.policy import RigPolicy
from systems.reports.terminal import report_errors

SIZES = (1, 2, 3, 5, 8, 12, 20)  # of the learning curve; the whole set is its last point
DRAWS = 4
SKILL, STATELESS, FREE = "CA states + LWR", "LWR without states", "free demonstrations"

Shown = list[Demonstration]


def literal() -> CompetitiveAgglomeration:
    """The equations as printed, one start, no merging."""
    return CompetitiveAgglomeration(bias="literal", merge=None, n_init=1, random_state=0)


def as_shown(shown: Shown, draw: int) -> Shown:
    return shown


def bad_left_out(shown: Shown, draw: int) -> Shown:
    return [d for d in shown if d.good]


def bad_imitated(shown: Shown, draw: int) -> Shown:
    return [replace(d, good=True) for d in shown]


def drawn(size: int) -> Callable[[Shown, int], Shown]:
    """So many of them, four in five of them good; the sets of one draw contain each other."""

    def choose(shown: Shown, draw: int) -> Shown:
        rng = np.random.default_rng([17, draw])
        good = [d for d in shown if d.good]
        bad = [d for d in shown if not d.good]
        share = len(good) / len(shown)
        max_good = min(len(good), max(1, round(size * share)))
        return [
            *(good[k] for k in rng.permutation(len(good))[:max_good]),
            *(bad[k] for k in rng.permutation(len(bad))[: size - max_good]),
        ]

    return choose


def skill_from(choose: Callable[[Shown, int], Shown] = as_shown, folder: Path | None = None, **parts: Any) -> Train:
    """The skill from chosen demonstrations, of another folder if given, with some parts exchanged."""

    def train(setting: Setting, record: Record, advance: Advance, draw: int) -> RigPolicy:
        shown = setting.demonstrations if folder is None else read_demonstrations(folder)
        return ManipulationSkill(**{name: part() for name, part in parts.items()}).fit(choose(shown, draw))

    return train


def arms(free: Path) -> list[Arm]:
    return [
        Arm(SKILL, skill_from()),
        Arm("raw features", skill_from(features=RawFeatures)),
        Arm("normalised features", skill_from(features=NormalisedFeatures)),
        Arm("states by literal CA", skill_from(states=literal)),
        Arm(STATELESS, skill_from(states=one_state)),
        Arm("bad left out", skill_from(bad_left_out)),
        Arm("bad imitated", skill_from(bad_imitated)),
        Arm(FREE, skill_from(folder=free)),
        *(Arm(curve_name(size), skill_from(drawn(size)), draws=DRAWS) for size in SIZES),
    ]


def curve_name(size: int) -> str:
    return f"{size} demonstration{'s' if size > 1 else ''}"


GROUPS: tuple[tuple[str, tuple[tuple[str, str], ...]], ...] = (
    ("features", (("raw", "raw features"), ("normalised", "normalised features"), ("canonical", SKILL))),
    ("contact states", (("none", STATELESS), ("literal CA", "states by literal CA"), ("repaired CA", SKILL))),
    (
        "bad demonstrations",
        (("left out", "bad left out"), ("imitated", "bad imitated"), ("for states and graph", SKILL)),
    ),
    ("demonstrated in", (("free space", FREE), ("the rig's fixture", SKILL))),
)
"""Of the figure: a title, and a label and an arm a row."""


def draw(summaries: list[dict[str, Any]], folder: Path, whole: int) -> None:
    """``ablations.svg`` and ``learning_curve.svg``, of the arms that were performed."""
    by_name = {row["name"]: row for row in summaries}
    groups = [(title, [(label, by_name[name]) for label, name in rows if name in by_name]) for title, rows in GROUPS]
    present = [(title, rows) for title, rows in groups if rows]
    if present:
        draw_groups(present, folder / "ablations.svg")
    points = [*((size, curve_name(size)) for size in SIZES), (whole, SKILL)]
    curve = [(size, by_name[name]) for size, name in points if name in by_name]
    if any(row["trials"] for _, row in curve):
        draw_learning_curve(curve, folder / "learning_curve.svg")


def in_free_space(scenario: Scenario) -> Scenario:
    free = copy.deepcopy(scenario)
    free.fixture = "free"
    return free


@report_errors
def main() -> None:
    parser = command_line(__doc__)
    parser.add_argument("--figures", type=Path, help="folder for ablations.svg and learning_curve.svg")
    arguments = parser.parse_args()
    for known in ("bias='literal'", "groups names a single demonstration"):  # what their rows are there to show
        warnings.filterwarnings("ignore", message=known)
    scenario = load_scenario(arguments.scenario)
    free = in_free_space(scenario)
    chosen = selected(arms(recording_folder(free, arguments.out)), arguments.only)
    if any(arm.name == FREE for arm in chosen):
        recorded(free, arguments.out, jobs=arguments.jobs)
    setting = prepared(scenario, arguments.demonstrations, arguments.out, trials=arguments.trials, jobs=arguments.jobs)
    summaries = compare("ablations on the rig", chosen, setting, arguments.json)
    if arguments.figures is not None:
        draw(summaries, arguments.figures, len(setting.demonstrations))


if __name__ == "__main__":
    main()
