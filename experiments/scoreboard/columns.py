"""The columns of a scoreboard: what they show, and the expressions that compute them from the stored trials."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Column:
    """A column of a table of policies.

    Attributes:
        name: heading.
        unit: printed below the heading.
        tip: what the number is.
        digits: how many are shown after the point.
        pandas: expression that computes the number from a DataFrame ``d`` of the trials of a row; empty for a
            comparison with the reference.
        is_main: whether the page and the terminal show the column at first.
        low_is_good: order of the first click on the heading.
    """

    name: str
    unit: str
    tip: str
    digits: int = 0
    pandas: str = ""
    is_main: bool = False
    low_is_good: bool = True


LOAD_LIMITS = (10, 20, 40)
"""Limits of the load under which insertions are counted, N: where the guard begins to act, yields, and backs off."""

COLUMNS = (
    Column(
        "inserted",
        "95 %",
        "trials that inserted, of all; below: 95 % interval of the share for other sets of demonstrations (Wilson's,"
        " with the effective number of trials; of a policy without sets, for other trials)",
        pandas="d.inserted.sum()",
        is_main=True,
        low_is_good=False,
    ),
    Column(
        "sets",
        "of demos",
        "number of sets of demonstrations; 0: the policy has none",
        pandas="d.demonstration_set.nunique()",
        low_is_good=False,
    ),
    Column(
        "against",
        "+ / − pairs",
        "paired with the reference: + only this policy inserted, − only the reference did; below: sign-flip test of the"
        " sets, Holm-corrected over the rows of the table; of fewer than six sets the difference + less − of each",
        is_main=True,
        low_is_good=False,
    ),
    Column(
        "time",
        "s",
        "median duration of the insertions",
        2,
        pandas="d.time_s[d.inserted].median()",
        is_main=True,
    ),
    Column(
        "slower by",
        "s",
        "mean over the sets of the paired difference in time from the reference, where a failure counts as the whole"
        " time limit; below: as for the insertions",
        2,
        is_main=True,
    ),
    Column(
        "score",
        "of 100",
        "mean score by the rule of the public AI for Industry Challenge: insertion, duration, smoothness, way, force",
        1,
        pandas="d.field_score.mean()",
        is_main=True,
    ),
    Column(
        "contact",
        "N",
        "median of the largest force of a single contact",
        1,
        pandas="d.peak_contact_n.median()",
    ),
    Column(
        "load",
        "N",
        "median of the largest load √(|f|² + |m/r|²) of the net force f and moment m about the tip",
        1,
        pandas="d.peak_load_n.median()",
        is_main=True,
    ),
    *(
        Column(
            f"within {limit} N",
            "trials",
            f"trials that inserted while the load stayed below {limit} N",
            pandas=f"(d.inserted & (d.peak_load_n < {limit})).sum()",
            low_is_good=False,
        )
        for limit in LOAD_LIMITS
    ),
    Column(
        "mean load",
        "N",
        "median of the mean load over the time in contact",
        1,
        pandas="d.mean_load_n.median()",
    ),
    Column(
        "above 20 N",
        "s a trial",
        "mean time with a load above 20 N",
        2,
        pandas="d.seconds_above_20n.mean()",
    ),
    Column(
        "jams",
        "trials",
        "trials that ended jammed",
        pandas="(d.outcome == 'jammed').sum()",
    ),
    Column(
        "wedges",
        "trials",
        "trials in which friction alone could hold the peg between two contacts for 0.1 s or longer",
        pandas="(d.wedged_s > 0).sum()",
    ),
    Column(
        "faults",
        "trials",
        "trials that ended with a fault that the rig detected",
        pandas="(d.fault != '').sum()",
    ),
    Column(
        "lost steps",
        "in all",
        "microsteps that the steppers lost, in all trials",
        pandas="d.lost_steps.sum()",
    ),
    Column(
        "back-offs",
        "in all",
        "how often the controller backed the peg off",
        pandas="d.back_offs.sum()",
    ),
    Column(
        "physics",
        "trials",
        "trials whose bodies overlap by more than a quarter of the clearance: their forces say little about metal",
        pandas="(d.trusted == False).sum()",
        is_main=True,
    ),
    Column(
        "shown",
        "demos",
        "mean number of demonstrations that were used",
        pandas="d.demonstrations.mean()",
    ),
    Column(
        "training",
        "CPU s",
        "mean CPU time of the training, tuning included",
        1,
        pandas="d.train_s.mean()",
    ),
    Column("query", "ms", "mean time of a decision", 2, pandas="d.query_ms.mean()"),
    Column("trial", "CPU s", "mean CPU time of a trial", 1, pandas="d.cpu_s.mean()"),
)
