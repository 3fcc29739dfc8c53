"""Summarises the trials of each policy under each conditions, and compares the policies by the trials they share."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import pandas as pd

from experiments.scoreboard.columns import COLUMNS, Column
from experiments.scoreboard.paired_statistics import MIN_UNITS, holm, sign_flip_test, wilson, wilson_over_sets
from experiments.scoreboard.result_store import Trials

PRODUCT = "CA states + LWR"
"""The policy with which the others are compared by default, if it is there."""

FACTOR_NAMES = {
    "training.size": "number of demonstrations",
    "training.good": "number of good demonstrations",
    "training.bad": "number of bad demonstrations",
}
"""How factors are called that have no name of their own but the key that they set."""


def factor_name(factor: str) -> str:
    """Returns how a factor is called: ``mount stiffness`` for ``rig.mount_stiffness``."""
    return FACTOR_NAMES.get(factor, factor.rpartition(".")[2].replace("_", " "))


@dataclass(frozen=True)
class Conditions:
    """The conditions of a table: trials are compared only within them.

    Attributes:
        trial_set: which trials.
        engine: physics engine.
        factors: what the sweep varies, as the JSON text that the files hold.
    """

    trial_set: str
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
            f"{factor_name(name)} {f'{value:g}' if _is_number(value) else value}" for name, value in self.values.items()
        ]
        return ", ".join([f"{self.trial_set} trials", self.engine, *factors])

    def order(self) -> tuple[Any, ...]:
        """A key that sorts conditions: usual trials first, numbers by size."""
        pairs = sorted(self.values.items())
        values = [(0, v, "") if _is_number(v) else (1, 0.0, str(v)) for _, v in pairs]
        return (
            self.trial_set != "usual",
            self.trial_set,
            self.engine,
            [name for name, _ in pairs],
            values,
            self.factors,
        )


@dataclass(frozen=True)
class Summary:
    """The trials of one policy under the same conditions.

    Attributes:
        conditions: the conditions.
        policy: name.
        trials: their number.
        numbers: by the names of the `COLUMNS` that are computed from the trials; NaN: not recorded, or nothing to take
            a mean of.
        interval: 95 % interval of the share of insertions, for other sets; of a policy without sets, for other trials.
            None for a single set, which tells nothing of others.
        faults: number of trials by the fault that ended them.
    """

    conditions: Conditions
    policy: str
    trials: int
    numbers: dict[str, float]
    interval: tuple[float, float] | None
    faults: dict[str, int]

    @property
    def inserted(self) -> int:
        """Number of trials that inserted."""
        return int(self.numbers["inserted"])

    @property
    def share(self) -> float:
        """Share of the trials that inserted."""
        return self.inserted / self.trials

    def within(self, limit: int) -> Summary:
        """Returns the summary, without interval, in which only insertions below a load of `LOAD_LIMITS` (N) count."""
        inserted = self.numbers[f"within {limit} N"]
        return replace(self, numbers={**self.numbers, "inserted": inserted}, interval=None)

    @property
    def untrusted(self) -> int:
        """Number of trials whose physics is not trusted."""
        return int(self.numbers["physics"])


@dataclass(frozen=True)
class Paired:
    """A policy against the reference, in the trials that both performed under the same conditions.

    Attributes:
        pairs: number of pairs of trials.
        better: pairs in which only the policy inserted.
        worse: pairs in which only the reference inserted.
        p: of the sign-flip test of the units' shares of insertions, corrected by Holm's method for the rows of the
            table; NaN for fewer than `MIN_UNITS`.
        slower: mean over the units of the difference in time, s, where a failure counts as the time limit; positive if
            the policy is slower.
        p_time: of the sign-flip test of these differences, corrected in the same way.
        unit: what is compared, "sets" of demonstrations, or "trials" if neither policy has any.
        gains: ``better`` less ``worse`` of each unit.
        delays: ``slower`` of each unit, s.
    """

    pairs: int
    better: int
    worse: int
    p: float
    slower: float
    p_time: float
    unit: str
    gains: tuple[int, ...]
    delays: tuple[float, ...]

    @property
    def is_tested(self) -> bool:
        """Whether there are enough units for a test."""
        return len(self.gains) >= MIN_UNITS


@dataclass(frozen=True)
class Row:
    """A row of a table; ``paired`` is None for the reference and where no trial is shared."""

    summary: Summary
    paired: Paired | None

    def key(self, column: Column) -> float:
        """Returns the number by which a column is sorted; NaN for nothing."""
        if column.pandas:
            return self.summary.share if column.name == "inserted" else self.summary.numbers[column.name]
        if self.paired is None:
            return math.nan
        return float(self.paired.better - self.paired.worse) if column.name == "against" else self.paired.slower

    def text(self, column: Column) -> str:
        """Returns what the row shows; "–" for nothing."""
        s, key = self.summary, self.key(column)
        if column.name == "inserted" or (column.name == "physics" and s.untrusted):
            return f"{s.numbers[column.name]:.0f} of {s.trials}"
        if math.isnan(key):
            return "–"
        if column.name == "against" and self.paired is not None:
            return f"+{self.paired.better} −{self.paired.worse}"
        if column.name == "slower by":
            return _signed(key, 2)
        return f"{0.0 if abs(key) < 0.5 * 10**-column.digits else key:.{column.digits}f}"

    def note(self, column: Column) -> str:
        """Returns the small text below it; empty for none."""
        s = self.summary
        match column.name:
            case "inserted":
                return "" if s.interval is None else f"{100 * s.interval[0]:.0f}–{100 * s.interval[1]:.0f} %"
            case "against" if (pair := self.paired) is not None:
                return _p(pair.p) if pair.is_tested else _each(pair.unit, pair.gains, 0)
            case "slower by" if (pair := self.paired) is not None:
                return _p(pair.p_time) if pair.is_tested else _each(pair.unit, pair.delays, 2)
            case "faults":
                return ", ".join(f"{count} {name.split(':')[0]}" for name, count in s.faults.items())
            case "physics":
                return "not trusted" if s.untrusted else ""
        return ""


@dataclass(frozen=True)
class Table:
    """The policies under the same conditions, the one with most insertions first."""

    conditions: Conditions
    rows: list[Row]


@dataclass(frozen=True)
class Scoreboard(Trials):
    """The trials of a folder of results, in tables.

    Attributes:
        tables: in the order of their conditions.
        reference: name of the policy with which the others are compared.
    """

    tables: list[Table]
    reference: str

    @property
    def trials(self) -> int:
        """Number of trials."""
        return len(self.table)


def make_scoreboard(found: Trials, against: str | None = None) -> Scoreboard:
    """Summarises and compares.

    Args:
        found: the trials.
        against: name of the reference; None for `PRODUCT` if it is there, else the policy with the largest share of
            insertions.

    Raises:
        ValueError: if there is no such policy.
    """
    table = found.table
    reference = _reference(table, against)
    by_conditions = table.groupby(["trial_set", "engine", "factors"], observed=True)
    tables = [_table(Conditions(*map(str, names)), rows, reference) for names, rows in by_conditions]
    tables.sort(key=lambda item: item.conditions.order())
    return Scoreboard(**vars(found), tables=tables, reference=reference)


def summarise(conditions: Conditions, policy: str, rows: pd.DataFrame) -> Summary:
    """Summarises the trials of one policy under the same conditions; ``rows`` as in `Trials.table`, at least one."""
    numbers = {column.name: float(eval(column.pandas, {"d": rows})) for column in COLUMNS if column.pandas}
    sets = rows.groupby("demonstration_set")["inserted"].agg(["sum", "count"])
    interval = None
    if sets.empty:
        interval = wilson(int(numbers["inserted"]), len(rows))
    elif len(sets) > 1:
        interval = wilson_over_sets(sets["sum"], sets["count"])
    faults = rows.loc[rows["fault"] != "", "fault"].value_counts()
    return Summary(
        conditions=conditions,
        policy=policy,
        trials=len(rows),
        numbers=numbers,
        interval=interval,
        faults={str(name): int(count) for name, count in faults.items() if count},
    )


def compare(rows: pd.DataFrame, other: pd.DataFrame) -> Paired | None:
    """Compares two policies under the same conditions; p-values are not corrected. None if they share no trial.

    Two trials are a pair if they have the same number and, where both policies learn, the same set of demonstrations.
    The differences of the pairs of a set are averaged, and the signs of these means are flipped. So the conclusion is
    about other sets; trials that all sets perform, and a policy without sets in them, are taken as given. If neither
    policy has sets, each pair is a unit.
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
    sets = pairs["demonstration_set"].fillna(pairs["demonstration_set_other"])
    units = [sets, pairs["trial"].where(sets.isna())]
    gains = (inserted.astype(int) - inserted_other.astype(int)).groupby(units, dropna=False)
    delays = differences.groupby(units, dropna=False).mean()
    is_tested = len(delays) >= MIN_UNITS
    return Paired(
        pairs=len(pairs),
        better=better,
        worse=worse,
        p=sign_flip_test(gains.mean()) if is_tested else math.nan,
        slower=float(delays.mean()),
        p_time=sign_flip_test(delays) if is_tested else math.nan,
        unit="sets" if sets.notna().any() else "trials",
        gains=tuple(map(int, gains.sum())),
        delays=tuple(map(float, delays)),
    )


def numeric_factors(tables: Sequence[Table]) -> list[str]:
    """Returns the names of the factors that are numbers in all tables that have them, sorted."""
    names = sorted({name for table in tables for name in table.conditions.values})
    found = {name: [t.conditions.values[name] for t in tables if name in t.conditions.values] for name in names}
    return [name for name in names if all(_is_number(value) for value in found[name])]


def _table(conditions: Conditions, rows: pd.DataFrame, reference: str) -> Table:
    """The rows of a table, compared with those of the reference; the p-values are corrected over the table."""
    by_policy = {str(name): part for name, part in rows.groupby("policy", observed=True)}
    summaries = [summarise(conditions, name, part) for name, part in by_policy.items()]
    summaries.sort(key=lambda s: (-s.share, math.inf if math.isnan(s.numbers["time"]) else s.numbers["time"], s.policy))
    paired: dict[str, Paired] = {}
    for name in by_policy if reference in by_policy else ():
        if name != reference and (pair := compare(by_policy[name], by_policy[reference])) is not None:
            paired[name] = pair
    tested = {name: pair for name, pair in paired.items() if pair.is_tested}
    p, p_time = (holm([getattr(pair, key) for pair in tested.values()]) for key in ("p", "p_time"))
    paired |= {name: replace(pair, p=p[k], p_time=p_time[k]) for k, (name, pair) in enumerate(tested.items())}
    return Table(conditions, [Row(summary, paired.get(summary.policy)) for summary in summaries])


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


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _signed(value: float, digits: int) -> str:
    """A number with its sign as text."""
    return f"{value:+.{digits}f}".replace("-", "−")


def _each(unit: str, values: Sequence[float], digits: int) -> str:
    """The differences of few units as text."""
    return f"{unit}: {' '.join(_signed(value, digits) for value in values)}"


def _p(p: float) -> str:
    """A p-value as text."""
    return "p < 0.001" if p < 0.001 else f"p {p:.3f}" if p < 0.1 else f"p {p:.2f}"
