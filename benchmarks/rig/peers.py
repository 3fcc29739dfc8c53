"""The learnt skill against other policies on the same trials of the rig.

    python -m benchmarks.rig.peers [--demonstrations FOLDER ...] [--sets 4] [--trials 20] [--jobs 1]
                                   [--arm NAME] [--only NAME] [--json FILE] [--figure FILE] [--scenario NAME]
                                   [--candidates 24] [--out FOLDER]

All policies have the same limits, force guard, motors and sensor. All learners get the same demonstrations, with the
same refinement and sensor noise, and the same canonical features. Without --demonstrations, four sets of thirty are
recorded (--sets). A policy that learns is trained on each set, and trial n is performed with set n modulo their number;
the first trial is number 78000. Its number of states and its times are means over the sets. The parameters of
compliance and search are tuned on other trials of the rig, from 80000 on (`benchmarks.rig.control_laws.tuned`; 24
candidates need 104 trials); their training time is the time of these trials on one core. Three rows are controls: in
"mean action" every demonstrated action is replaced by their mean in the canonical frame, in "shuffled actions" by that
of a random sample, and in "random sign" each turn of the product has a random sign. A state of the product is a pair of
contact and context; three rows leave one of the two out, or both.

Columns, one row per policy:

- inserted, 95 %: number of insertions, and Wilson's interval of their probability in percent;
- sets, worst: the 95 % interval over the sets (bootstrap), each with its own trials, and the worst set;
- p: of the exact McNemar test against the insertions of the product in the same trials, with the trials as units, not
  corrected for the number of rows;
- time s: median time of the insertions;
- load N: largest load of the true contact in each trial, failures included: median, 95th percentile, maximum. The force
  across the peg is no measure of it: the two opposite forces of a wedge cancel in it;
- contact N: median of the largest normal force of a single contact; untrusted: trials whose physics is not trusted;
- states: number of contact states or phases;
- train s: training time on one core; query ms: median time of one decision;
- otherwise: how the other trials ended.

An interrupted run continues when it is started again: the results below --out are kept. A policy that fails, in
training or in a trial, has a row in the table as well.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from benchmarks.extras import require_packages

if __name__ == "__main__":
    require_packages("pydrake", "yaml")

from sklearn.dummy import DummyRegressor

from benchmarks.command_line import run
from benchmarks.rig.comparison import (
    CONTEXTLESS,
    CONTEXTS_ALONE,
    PRODUCT,
    STATELESS,
    command_line,
    compare,
    prepared,
    selected,
)
from benchmarks.rig.control_laws import MomentCompliance, SpiralSearch, StraightPush, TunedLaw, tuned, tuning_trials
from benchmarks.rig.figures import draw_groups
from benchmarks.rig.learners import (
    MixtureRegressor,
    MixtureStates,
    RandomSign,
    ShuffledNeighbour,
    SubsetGaussianProcess,
    nearest_neighbours,
    network,
    one_context,
    one_state,
    skill_from,
)
from benchmarks.rig.trials import Advance, Entry, Record, Setting, Train
from models.scenario import load_scenario
from skill.policy import RigPolicy


def push(setting: Setting, record: Record, advance: Advance, number: int) -> RigPolicy:
    """A push without correction, at the feed speed of the simulated operator."""
    return StraightPush(speed=setting.scenario.operator.insertion_speed)


def tuning_of(law: type[TunedLaw]) -> Train:
    """The training of a control law: its parameters are tuned on the rig."""
    return lambda setting, record, advance, number: tuned(law, setting, record, advance)


def stateless(regressor: Callable[[], Any]) -> Train:
    """The training of a regressor without contact states and contexts."""
    return skill_from(states=one_state, contexts=one_context, regressor=regressor)


def entries(candidates: int) -> list[Entry]:
    """The policies; compliance and search are tuned with this number of candidates."""
    tuning = tuning_trials(candidates)
    return [
        Entry("no correction", push, learns=False),
        Entry("moment compliance, tuned", tuning_of(MomentCompliance), learns=False, tuning=tuning),
        Entry("spiral search, tuned", tuning_of(SpiralSearch), learns=False, tuning=tuning),
        Entry("mean action", stateless(DummyRegressor)),
        Entry("shuffled actions", stateless(ShuffledNeighbour)),
        Entry("random sign of the turns", skill_from(policy=RandomSign)),
        Entry("k nearest neighbours", stateless(nearest_neighbours)),
        Entry(STATELESS, skill_from(states=one_state, contexts=one_context)),
        Entry("Gaussian mixture regression", stateless(MixtureRegressor)),
        Entry("neural network (MLP)", stateless(network)),
        Entry("Gaussian process", stateless(SubsetGaussianProcess)),
        Entry("GMM-BIC states + LWR", skill_from(states=MixtureStates, contexts=one_context)),
        Entry(CONTEXTLESS, skill_from(contexts=one_context)),
        Entry(CONTEXTS_ALONE, skill_from(states=one_state)),
        Entry(PRODUCT, skill_from()),
    ]


def main() -> None:
    parser = command_line(__doc__)
    parser.add_argument("--candidates", type=int, default=24, help="parameter sets in each tuning (default: 24)")
    parser.add_argument("--figure", type=Path, metavar="FILE", help="draw the table to this file (.png or .svg)")
    arguments = parser.parse_args()
    chosen = selected(entries(arguments.candidates), arguments.only)
    setting = prepared(
        load_scenario(arguments.scenario),
        arguments.demonstrations,
        arguments.out,
        sets=arguments.sets,
        arm=arguments.arm,
        trials=arguments.trials,
        jobs=arguments.jobs,
        candidates=arguments.candidates,
    )
    summaries = compare("policies on the rig", chosen, setting, arguments.json)
    if arguments.figure is not None:
        draw_groups([("policies", [(row["name"], row) for row in summaries])], arguments.figure)


if __name__ == "__main__":
    run(main)
