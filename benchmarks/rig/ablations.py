"""The skill with one of its choices undone at a time, on the same trials of the rig.

    python -m benchmarks.rig.ablations [--demonstrations FOLDER ...] [--sets 4] [--trials 20] [--jobs 1]
                                       [--arm NAME] [--only NAME] [--json FILE] [--figure FILE] [--scenario NAME]
                                       [--out FOLDER]

"CA states, contexts + LWR" is the product: canonical features, states by the repaired Competitive Agglomeration, good
and bad demonstrations in the fixture of the rig. Every other row differs from it in what its name says. The columns of
the table are those of `benchmarks.rig.peers`.

A skill learns states and their graph from all demonstrations, but actions from the good ones alone. The bad ones show
contacts that careful operators avoid (a jam, a slam), so that the filter recognises such a contact instead of calling
it unknown, and the graph contains the states from which insertions fail. The operator's actions there led to the
failure and are not imitated. Two rows test this: "bad left out" learns from the good demonstrations alone, "bad
imitated" treats the bad ones as good.

Without --demonstrations, four sets of thirty are recorded (--sets); those in the free fixture (six freedoms, no virtual
guide) are always recorded. An interrupted run continues when it is started again, and uses the results that
`benchmarks.rig.peers` has stored in the same --out.
"""

from __future__ import annotations

import copy
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from benchmarks.extras import require_packages

if __name__ == "__main__":
    require_packages("pydrake", "yaml")

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
    recording_folders,
    selected,
)
from benchmarks.rig.figures import draw_groups
from benchmarks.rig.learners import (
    Extrapolating,
    bad_imitated,
    bad_left_out,
    literal_competition,
    one_context,
    one_state,
    skill_from,
)
from benchmarks.rig.trials import Entry
from models.scenario import FREE_FACETS, FREE_FIXTURE, Scenario, load_scenario
from skill.features.wrench_features import NormalisedFeatures, RawFeatures

FREE = "free demonstrations"
EXTRAPOLATING = "turns neither pooled nor limited"


def entries(free: Sequence[Path]) -> list[Entry]:
    """The product and its variants; ``free`` are the sets of free demonstrations."""
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
        Entry(FREE, skill_from(folders=free)),
    ]


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


def draw(summaries: list[dict[str, Any]], path: Path) -> None:
    """Draws the entries that were performed, in groups."""
    by_name = {row["name"]: row for row in summaries}
    groups = [(title, [(label, by_name[name]) for label, name in rows if name in by_name]) for title, rows in GROUPS]
    present = [(title, rows) for title, rows in groups if rows]
    if present:
        draw_groups(present, path)


def in_free_space(scenario: Scenario) -> Scenario:
    """The scenario with the free fixture, and with the facets for a peg that may rotate about its axis."""
    free = copy.deepcopy(scenario)
    free.fixture = FREE_FIXTURE
    free.geometry.facets = max(free.geometry.facets, FREE_FACETS)
    return free


def main() -> None:
    parser = command_line(__doc__)
    parser.add_argument("--figure", type=Path, metavar="FILE", help="draw the table to this file (.png or .svg)")
    arguments = parser.parse_args()
    for known in ("bias='literal'", "groups names a single demonstration"):  # warnings that some rows cause on purpose
        warnings.filterwarnings("ignore", message=known)
    scenario = load_scenario(arguments.scenario)
    free, sets = in_free_space(scenario), len(arguments.demonstrations or range(arguments.sets))
    chosen = selected(entries(recording_folders(free, arguments.out, sets)), arguments.only)
    if any(entry.name == FREE for entry in chosen):
        recorded(free, arguments.out, sets=sets, jobs=arguments.jobs)
    numbers = {"trials": arguments.trials, "jobs": arguments.jobs}
    setting = prepared(scenario, arguments.demonstrations, arguments.out, sets=sets, arm=arguments.arm, **numbers)
    summaries = compare("ablations on the rig", chosen, setting, arguments.json)
    if arguments.figure is not None:
        draw(summaries, arguments.figure)


if __name__ == "__main__":
    run(main)
