"""The skill with one of its choices undone at a time, and its learning curve, on the same trials of the rig.

    python -m benchmarks.rig.ablations [--demonstrations FOLDER] [--trials 20] [--jobs 1] [--only NAME ...]
                                       [--json FILE] [--figures FOLDER] [--scenario NAME] [--out FOLDER]

"CA states + LWR" is the product: canonical features, states by the repaired Competitive Agglomeration, good and bad
demonstrations in the fixture of the rig. Every other row differs from it in what its name says. The columns of the
table are those of `benchmarks.rig.peers`.

A skill learns states and their graph from all demonstrations, but actions from the good ones alone. The bad ones show
contacts that careful operators avoid (a jam, a slam), so that the filter recognises such a contact instead of calling
it unknown, and the graph contains the states from which insertions fail. The operator's actions there led to the
failure and are not imitated. Two rows test this: "bad left out" learns from the good demonstrations alone, "bad
imitated" treats the bad ones as good.

The sets of the learning curve have four good demonstrations in five, like the whole set. The choice of a small set
matters, so that each point of the curve has four skills, from four draws, which share the trials.

Without --demonstrations thirty are recorded; those in the free fixture (six freedoms, no virtual guide) are always
recorded. An interrupted run continues when it is started again, and uses the results that `benchmarks.rig.peers` has
stored in the same --out.
"""

from __future__ import annotations

import copy
import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from benchmarks.extras import require_packages

if __name__ == "__main__":
    require_packages("pydrake", "yaml")

import numpy as np

from benchmarks.command_line import run
from benchmarks.rig.comparison import (
    CONTEXTLESS,
    CONTEXTS_ALONE,
    PRODUCT,
    STATELESS,
    command_line,
    compare,
    prepared,
    recorded,
    recording_folder,
    selected,
)
from benchmarks.rig.figures import draw_groups, draw_learning_curve
from benchmarks.rig.learners import Demonstrations, Extrapolating, one_context, one_state, skill_from
from benchmarks.rig.trials import Entry
from models.scenario import FREE_FACETS, FREE_FIXTURE, Scenario, load_scenario
from skill.clustering.competitive_agglomeration import CompetitiveAgglomeration
from skill.features.wrench_features import NormalisedFeatures, RawFeatures

SIZES = (1, 2, 3, 5, 8, 12, 20)  # numbers of demonstrations of the learning curve; its last point is the whole set
DRAWS = 4  # skills per point of the learning curve
FREE = "free demonstrations"
EXTRAPOLATING = "turns neither pooled nor limited"


def literal_competition() -> CompetitiveAgglomeration:
    """Competitive Agglomeration as printed in the paper: one start, no merging."""
    return CompetitiveAgglomeration(bias="literal", merge=None, n_init=1, random_state=0)


def bad_left_out(demonstrations: Demonstrations, draw: int) -> Demonstrations:
    """Chooses the good demonstrations."""
    return [d for d in demonstrations if d.good]


def bad_imitated(demonstrations: Demonstrations, draw: int) -> Demonstrations:
    """Chooses all demonstrations and labels them good."""
    return [replace(d, good=True) for d in demonstrations]


def drawn(size: int) -> Callable[[Demonstrations, int], Demonstrations]:
    """Chooses ``size`` demonstrations, with as large a share of good ones as in the whole set.

    In one draw, a larger set contains the smaller ones.
    """

    def choose(demonstrations: Demonstrations, draw: int) -> Demonstrations:
        rng = np.random.default_rng([17, draw])
        good = [d for d in demonstrations if d.good]
        bad = [d for d in demonstrations if not d.good]
        share = len(good) / len(demonstrations)
        n_good = min(len(good), max(1, round(size * share)))
        return [
            *(good[k] for k in rng.permutation(len(good))[:n_good]),
            *(bad[k] for k in rng.permutation(len(bad))[: size - n_good]),
        ]

    return choose


def entries(free: Path) -> list[Entry]:
    """The product, its variants, and the points of the learning curve; ``free`` has the free demonstrations."""
    return [
        Entry(PRODUCT, skill_from()),
        Entry("raw features", skill_from(features=RawFeatures)),
        Entry("normalised features", skill_from(features=NormalisedFeatures)),
        Entry("states by literal CA", skill_from(states=literal_competition)),
        Entry(STATELESS, skill_from(states=one_state, contexts=one_context)),
        Entry(CONTEXTS_ALONE, skill_from(states=one_state)),
        Entry(CONTEXTLESS, skill_from(contexts=one_context)),
        Entry(EXTRAPOLATING, skill_from(policy=Extrapolating)),
        Entry("bad left out", skill_from(bad_left_out)),
        Entry("bad imitated", skill_from(bad_imitated)),
        Entry(FREE, skill_from(folder=free)),
        *(Entry(curve_name(size), skill_from(drawn(size)), draws=DRAWS) for size in SIZES),
    ]


def curve_name(size: int) -> str:
    """The name of the entry that learns from this number of demonstrations."""
    return f"{size} demonstration{'s' if size > 1 else ''}"


GROUPS: tuple[tuple[str, tuple[tuple[str, str], ...]], ...] = (
    ("features", (("raw", "raw features"), ("normalised", "normalised features"), ("canonical", PRODUCT))),
    ("contact states", (("none", CONTEXTS_ALONE), ("literal CA", "states by literal CA"), ("repaired CA", PRODUCT))),
    ("contexts", (("none", CONTEXTLESS), ("found", PRODUCT), ("neither contexts nor contacts", STATELESS))),
    ("turns", (("neither pooled nor limited", EXTRAPOLATING), ("pooled and limited", PRODUCT))),
    (
        "bad demonstrations",
        (("left out", "bad left out"), ("imitated", "bad imitated"), ("for states and graph", PRODUCT)),
    ),
    ("demonstrated in", (("free space", FREE), ("the rig's fixture", PRODUCT))),
)
"""Groups of the figure: a title, and for each row its label and the name of its entry."""


def draw(summaries: list[dict[str, Any]], folder: Path, whole: int) -> None:
    """Draws ``ablations.svg`` and ``learning_curve.svg`` from the entries that were performed.

    Args:
        summaries: results of `compare`.
        folder: of the files.
        whole: number of demonstrations of the whole set.
    """
    by_name = {row["name"]: row for row in summaries}
    groups = [(title, [(label, by_name[name]) for label, name in rows if name in by_name]) for title, rows in GROUPS]
    present = [(title, rows) for title, rows in groups if rows]
    if present:
        draw_groups(present, folder / "ablations.svg")
    points = [*((size, curve_name(size)) for size in SIZES), (whole, PRODUCT)]
    curve = [(size, by_name[name]) for size, name in points if name in by_name]
    if any(row["trials"] for _, row in curve):
        draw_learning_curve(curve, folder / "learning_curve.svg")


def in_free_space(scenario: Scenario) -> Scenario:
    """The scenario with the free fixture, and with the facets for a peg that may rotate about its axis."""
    free = copy.deepcopy(scenario)
    free.fixture = FREE_FIXTURE
    free.geometry.facets = max(free.geometry.facets, FREE_FACETS)
    return free


def main() -> None:
    parser = command_line(__doc__)
    parser.add_argument("--figures", type=Path, metavar="FOLDER", help="draw ablations.svg and learning_curve.svg here")
    arguments = parser.parse_args()
    for known in ("bias='literal'", "groups names a single demonstration"):  # warnings that some rows cause on purpose
        warnings.filterwarnings("ignore", message=known)
    scenario = load_scenario(arguments.scenario)
    free = in_free_space(scenario)
    chosen = selected(entries(recording_folder(free, arguments.out)), arguments.only)
    if any(entry.name == FREE for entry in chosen):
        recorded(free, arguments.out, jobs=arguments.jobs)
    numbers = {"trials": arguments.trials, "jobs": arguments.jobs}
    setting = prepared(scenario, arguments.demonstrations, arguments.out, arm=arguments.arm, **numbers)
    summaries = compare("ablations on the rig", chosen, setting, arguments.json)
    if arguments.figures is not None:
        draw(summaries, arguments.figures, len(setting.demonstrations))


if __name__ == "__main__":
    run(main)
