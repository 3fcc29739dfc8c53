"""Summarises the trials of each policy in each cell of a sweep, and compares the policies by the trials they share."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import pandas as pd

from experiments.scoreboard.paired_statistics import holm, mcnemar_of_counts, over_sets, sign_flip_test, wilson
from experiments.scoreboard.result_store import Origin, Trials
from skill.data.outcome import Outcome

PRODUCT = "CA states, contexts + LWR"
"""The policy with which the others are compared by default, if it is there."""


@dataclass(frozen=True)
class Cell:
    """The conditions of a table: trials are compared only within them.

    Attributes:
        arm: which trials.
        engine: physics engine.
        factors: what the sweep varies, as the JSON text that the files hold.
    """

    arm: str
    engine: str
    factors: str

    @property
    def values(self) -> dict[str, Any]:
        """The factors by name."""
        found: dict[str, Any] = json.loads(self.factors)
        return found

    @property
    def title(self) -> str:
        """The conditions as text."""
        factors = [
            f"{name} {value:g}" if _is_number(value) else f"{name} {value}" for name, value in self.values.items()
        ]
        return ", ".join([f"{self.arm} arm", self.engine, *factors])

    def order(self) -> tuple[Any, ...]:
        """A key that sorts cells: the default arm first, numbers by size."""
        pairs = sorted(self.values.items())
        values = [(0, v, "") if _is_number(v) else (1, 0.0, str(v)) for _, v in pairs]
        return (self.arm != "default", self.arm, self.engine, [name for name, _ in pairs], values, self.factors)


@dataclass(frozen=True)
class Summary:
    """The trials of one policy in one cell. NaN: not recorded, or nothing to take a mean of.

    Attributes:
        cell: the conditions.
        policy: name.
        trials: their number.
        inserted: number of trials that inserted.
        interval: 95 % Wilson interval of the share.
        sets: number of demonstration sets.
        over_sets: 95 % interval of the share by a bootstrap over the sets; None for fewer than two.
        time: median duration of the insertions, s.
        contact: median of the largest force of a single contact, N.
        load: median of the largest load, N.
        mean_load: median of the mean load in contact, N.
        above_20n: mean time with a load above 20 N, s a trial.
        jams: number of trials that ended jammed.
        wedges: number of trials in which the peg was wedged (`experiments.metrics.wedging`; not for less than 0.1 s).
        faults: number of trials by the fault that ended them.
        lost_steps: of both steppers, in all trials.
        back_offs: in all trials.
        untrusted: number of trials whose physics is not trusted.
        score: mean of the field's score.
        demonstrations: mean number of demonstrations that were used.
        train: mean CPU time of the training, s.
        states: mean number of states.
        query: mean time of a decision, ms.
        cpu: mean CPU time of a trial, s.
    """

    cell: Cell
    policy: str
    trials: int
    inserted: int
    interval: tuple[float, float]
    sets: int
    over_sets: tuple[float, float] | None
    time: float
    contact: float
    load: float
    mean_load: float
    above_20n: float
    jams: int
    wedges: int
    faults: dict[str, int]
    lost_steps: int
    back_offs: int
    untrusted: int
    score: float
    demonstrations: float
    train: float
    states: float
    query: float
    cpu: float

    @property
    def share(self) -> float:
        """Share of the trials that inserted."""
        return self.inserted / self.trials


@dataclass(frozen=True)
class Paired:
    """A policy against the reference, in the trials that both performed under the same conditions.

    Attributes:
        pairs: number of pairs of trials.
        better: pairs in which only the policy inserted.
        worse: pairs in which only the reference inserted.
        p: of the exact McNemar test, corrected by Holm's method for the rows of the table.
        slower: mean difference in time, s, where a failure counts as the time limit; positive if the policy is slower.
        p_time: of the sign-flip test of these differences, corrected in the same way.
    """

    pairs: int
    better: int
    worse: int
    p: float
    slower: float
    p_time: float


@dataclass(frozen=True)
class Row:
    """A row of a table; ``paired`` is None for the reference and where no trial is shared."""

    summary: Summary
    paired: Paired | None


@dataclass(frozen=True)
class Table:
    """The policies in one cell, the one with most insertions first."""

    cell: Cell
    rows: list[Row]


@dataclass(frozen=True)
class Scoreboard(Origin):
    """All tables of a folder of results.

    Attributes:
        tables: in the order of their cells.
        reference: name of the policy with which the others are compared.
        trials: number of trials.
    """

    tables: list[Table]
    reference: str
    trials: int


def make_scoreboard(found: Trials, against: str | None = None) -> Scoreboard:
    """Summarises and compares.

    Args:
        found: the trials.
        against: name of the reference; None for `PRODUCT` if it is there, else the policy with the largest share of
            insertions.

    Raises:
        ValueError: if there is no such policy, or the factors of a trial are no JSON object.
    """
    table = found.table
    reference = _reference(table, against)
    tables = []
    for names, rows in table.groupby(["arm", "engine", "factors"], observed=True):
        cell = Cell(*map(str, names))
        _check_factors(cell.factors, found.folder)
        tables.append(_table(cell, rows, reference))
    tables.sort(key=lambda item: item.cell.order())
    origin = {known.name: getattr(found, known.name) for known in fields(Origin)}
    return Scoreboard(**origin, tables=tables, reference=reference, trials=len(table))


def summarise(cell: Cell, policy: str, rows: pd.DataFrame) -> Summary:
    """Summarises the trials of one policy in one cell; ``rows`` as in `Trials.table`, at least one."""
    inserted = int(rows["inserted"].sum())
    shares = rows.groupby("demonstration_set")["inserted"].mean()
    faults = rows.loc[rows["fault"] != "", "fault"].value_counts()
    return Summary(
        cell=cell,
        policy=policy,
        trials=len(rows),
        inserted=inserted,
        interval=wilson(inserted, len(rows)),
        sets=len(shares),
        over_sets=over_sets(shares.to_list())[1:] if len(shares) > 1 else None,
        time=float(rows.loc[rows["inserted"], "time_s"].median()),
        contact=float(rows["peak_contact_n"].median()),
        load=float(rows["peak_load_n"].median()),
        mean_load=float(rows["mean_load_n"].median()),
        above_20n=float(rows["seconds_above_20n"].mean()),
        jams=int((rows["outcome"] == Outcome.JAMMED.value).sum()),
        wedges=int((rows["wedged_s"] > 0.0).sum()),
        faults={str(name): int(count) for name, count in faults.items() if count},
        lost_steps=int(rows["lost_steps"].sum()),
        back_offs=int(rows["back_offs"].sum()),
        untrusted=int((rows["trusted"] == 0.0).sum()),
        score=float(rows["field_score"].mean()),
        demonstrations=float(rows["demonstrations"].mean()),
        train=float(rows["train_s"].mean()),
        states=float(rows["states"].mean()),
        query=float(rows["query_ms"].mean()),
        cpu=float(rows["cpu_s"].mean()),
    )


def compare(rows: pd.DataFrame, other: pd.DataFrame) -> Paired | None:
    """Compares two policies in one cell; p-values are not corrected. None if they share no trial.

    Two trials are a pair if they have the same number and, where both policies learn, the same set of demonstrations.
    The test of the insertions takes the pairs as independent. For that of the times, the differences of a trial are
    averaged over the sets first.
    """
    names = ["trial", "demonstration_set", "inserted", "time_s", "time_limit_s"]
    pairs = rows[names].merge(other[names], on="trial", suffixes=("", "_other"))
    mine, theirs = pairs["demonstration_set"], pairs["demonstration_set_other"]
    pairs = pairs[(mine == theirs) | mine.isna() | theirs.isna()]
    if pairs.empty:
        return None
    inserted, inserted_other = pairs["inserted"], pairs["inserted_other"]
    better, worse = int((inserted & ~inserted_other).sum()), int((inserted_other & ~inserted).sum())
    taken = pairs["time_s"].where(inserted, pairs["time_limit_s"])
    differences = taken - pairs["time_s_other"].where(inserted_other, pairs["time_limit_s_other"])
    of_trials = differences.groupby(pairs["trial"]).mean()
    return Paired(
        pairs=len(pairs),
        better=better,
        worse=worse,
        p=mcnemar_of_counts(better, worse),
        slower=float(differences.mean()),
        p_time=sign_flip_test(of_trials.to_numpy()),
    )


def _table(cell: Cell, rows: pd.DataFrame, reference: str) -> Table:
    """The rows of a cell, compared with those of the reference."""
    by_policy = {str(name): part for name, part in rows.groupby("policy", observed=True)}
    summaries = [summarise(cell, name, part) for name, part in by_policy.items()]
    summaries.sort(key=lambda s: (-s.share, math.inf if math.isnan(s.time) else s.time, s.policy))
    paired = {}
    if reference in by_policy:
        other = by_policy[reference]
        compared = {name: compare(part, other) for name, part in by_policy.items() if name != reference}
        paired = _corrected({name: pair for name, pair in compared.items() if pair is not None})
    return Table(cell, [Row(summary, paired.get(summary.policy)) for summary in summaries])


def _corrected(pairs: dict[str, Paired]) -> dict[str, Paired]:
    """The comparisons of a table with p-values corrected by Holm's method: those of insertions, and those of times."""
    found = list(pairs.values())
    p, p_time = holm([pair.p for pair in found]), holm([pair.p_time for pair in found])
    return {
        name: Paired(pair.pairs, pair.better, pair.worse, p[k], pair.slower, p_time[k])
        for k, (name, pair) in enumerate(pairs.items())
    }


def _reference(table: pd.DataFrame, against: str | None) -> str:
    """The name of the policy with which the others are compared."""
    names = [str(name) for name in table["policy"].cat.categories]
    if against is not None:
        if against not in names:
            raise ValueError(f"--against {against!r}: no such policy; there are {', '.join(map(repr, names))}")
        return against
    if PRODUCT in names:
        return PRODUCT
    shares = table.groupby("policy", observed=True)["inserted"].mean()
    return str(shares.idxmax())


def _check_factors(factors: str, folder: Path) -> None:
    try:
        found = json.loads(factors)
    except ValueError:
        found = None
    if not isinstance(found, dict):
        raise ValueError(f"{folder}: 'factors' of a trial is {factors!r}, expected a JSON object such as {{}}")


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def numeric_factors(tables: Sequence[Table]) -> list[str]:
    """Returns the names of the factors that are numbers in all cells that have them, sorted."""
    names = sorted({name for table in tables for name in table.cell.values})
    found = {name: [t.cell.values[name] for t in tables if name in t.cell.values] for name in names}
    return [name for name in names if all(_is_number(value) for value in found[name])]
