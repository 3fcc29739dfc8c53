"""Where the figures of the pages come from: `docs/_tools/figures_check.py` compares them.

``ROWS`` has, for each page, texts with a ``{}`` for each figure, and the figures, computed from the published rows. Of a
DataFrame each row is a text of its own: the index, and the columns. ``ELSEWHERE`` has the figures that are computed by
a command which the page names: where they stand (a text, or all below a heading), and the command.
"""

from __future__ import annotations

from typing import Any

import pandas as pd

from docs._tools.published_rows import ROOT, above_limit, against, both, inserted, published, summary, word
from models.clearance import SMALL

NAMES = (
    *("arms", "clocking", "curves", "engines", "force_use", "force_use_networks"),
    *("fresh", "ladder", "learning", "scoreboard", "sections", "sets"),
)
(
    arms,
    clocking,
    curves,
    engines,
    force_use,
    force_use_networks,
    all_fresh,
    ladder,
    learning,
    scoreboard,
    sections,
    sets,
) = map(published, NAMES)
protocol = pd.read_csv(ROOT / "docs" / "protocol.csv")
own_pegs = pd.read_csv(ROOT / "docs" / "own_pegs.csv")
pegs = own_pegs.dropna(subset="inserted").astype({"inserted": int})
lacking = pegs[pegs.inserted < 9]

fresh = all_fresh.query("factor == ''")
alone, corrected = fresh.query("policy == 'skill'"), fresh.query("policy == 'skill with corrections'")
alone_exact, alone_drake = (alone[alone.engine == name] for name in ("exact", "drake"))
corrected_exact = corrected.query("engine == 'exact'")
shown_exact = fresh.query("policy == 'skill shown in exact'")
corrected_shown_exact = fresh.query("policy == 'skill shown in exact, with corrections'")
with_contexts = fresh[fresh.policy.str.contains("contexts")]
better = {name: against("fresh", "skill", "skill with corrections", name) for name in ("exact", "drake")}
contexts = pd.concat(
    [
        against("fresh", "skill", "skill with contexts"),
        against("fresh", "skill shown in exact", "skill shown in exact, with contexts"),
    ]
)

learnt, stateless = learning.query("policy == 'skill'"), learning.query("policy == 'LWR without states'")
sets_below_90 = (
    learnt.groupby(["value", "trial_set", "demonstration_set"])
    .inserted.mean()
    .lt(0.9)
    .groupby(["value", "trial_set"])
    .sum()
)
states_pay = against("learning", "LWR without states", "skill").groupby("trial_set")[["better", "worse"]].sum()

asked, unasked = (sets[sets.policy.eq(name) & sets.value.gt(0)] for name in ("skill with corrections", "skill"))
asked_pairs = against("sets", "skill", "skill with corrections").query("value == 20").sort_values("trial_set")

taught = sections[~sections.policy.str.startswith("taught with a ")]
other_part = sections[sections.policy.str.startswith("taught with a ")]
other_part = other_part.assign(taught=other_part.policy.str.split().str[-1], value=other_part.value.replace("d", "D"))
sections_corrected = sections.query("policy == 'skill with corrections'")
least = against("sections", "skill", "skill with corrections").nsmallest(1, "p").iloc[0]

sixty = scoreboard[scoreboard.trial < 78060]
undone = [
    *("CA states, contexts + LWR", "turns neither pooled nor limited", "contexts + LWR", "CA states + LWR"),
    *("bad left out", "states by literal CA", "LWR without states", "raw features", "normalised features"),
    *("bad imitated", "free demonstrations"),
]
by_policy = scoreboard.groupby(["policy", "trial_set"])
times = scoreboard[scoreboard.inserted].groupby(["policy", "trial_set"]).time_s.median()
with_states = pd.concat(
    [
        against("scoreboard", "LWR without states", name)
        for name in ("CA states + LWR", "contexts + LWR", "CA states, contexts + LWR")
    ]
).groupby("trial_set")
stateless_sets = scoreboard.query("policy == 'LWR without states' and not inserted")
contexts_too = (
    against("scoreboard", "CA states + LWR", "CA states, contexts + LWR").query("trial_set == 'hard'").iloc[0]
)
loads = by_policy[["mean_load_n", "peak_load_n"]].median()

rungs = ladder.replace({"policy": {"taught there": "skill, taught there", "taught at 0.005": "skill, carried over"}})
rung_table = pd.concat(
    [
        inserted(rungs, "policy", "trial_set", "value").unstack(),
        rungs[rungs.inserted].groupby(["policy", "trial_set", "value"]).time_s.median().unstack(),
    ],
    axis=1,
)
rung = inserted(rungs, "value", "trial_set", "policy")
untrusted = ladder[~ladder.trusted].groupby(["value", "trial_set", "policy"]).size()
loose = rungs.query("value > 0.03 and policy == 'moment compliance, tuned there'")

point = curves[(curves.engine == "exact") | (curves.factor == "training.size")]
exact_curve = curves.query("engine == 'exact' and policy == 'skill'")
mixture_curve = curves.query("engine == 'exact' and policy == 'Gaussian mixture regression'")
exact_curve, mixture_curve = (
    rows.assign(place=rows.groupby("factor").value.rank("dense").astype(int)) for rows in (exact_curve, mixture_curve)
)
curve_table = pd.concat(
    [
        exact_curve.groupby(["factor", "place"]).apply(summary, include_groups=False).unstack(),
        inserted(mixture_curve, "factor", "place").unstack(),
    ],
    axis=1,
)
curve_pairs = against("curves", "Gaussian mixture regression", "skill", "exact")
most_noise = curve_pairs.query("factor == 'noise' and value == 64").iloc[0]
other_pairs = curve_pairs.drop(most_noise.name)
curve = inserted(exact_curve, "factor", "value")
over = exact_curve.groupby(["factor", "value"]).apply(above_limit, include_groups=False)
largest = exact_curve.groupby(["factor", "value"]).peak_measured_load_n.max()
drake_curve = inserted(curves.query("engine == 'drake' and factor != 'training.size'"), "policy", "factor", "value")

planned = sets.query("factor == '' and trial_set == 'hard' and trial < 83020 and policy != 'skill with corrections'")
planned = planned.replace(
    {
        "policy": {
            "skill": "imitate (default)",
            "planning": "plan",
            "skill without contexts": "imitate, no contexts",
            "skill without contact states": "imitate, one contact state",
            "planning without contact states": "plan, one contact state",
        }
    }
)
plan = against("sets", "skill", "planning").iloc[0]
plan_states = against("sets", "planning", "planning without contact states").iloc[0]
imitate_states = against("sets", "skill", "skill without contact states").iloc[0]
no_contexts = against("sets", "skill", "skill without contexts").iloc[0]
other_delays = sorted(plan.delays)[:-1]

mujoco = engines.query("engine == 'mujoco' and value == 0.002")
three = pd.concat([alone, mujoco])
three_medians = three.groupby(["engine", "trial_set"]).median(numeric_only=True)
first_five = pd.concat([alone[alone.trial < 94005], mujoco])
half = pd.concat([all_fresh, engines]).query("policy == 'skill' and value == 0.001")
whole = pd.concat([all_fresh, engines]).query("policy == 'skill' and value == 0.002")
half_first = half[half.trial < 94005]
laws = engines.query("factor == ''")
laws_differ = [
    sum(both(*(laws[laws.policy.eq(name) & laws.engine.eq(engine)] for engine in ("exact", "drake")))[1:])
    for name in ("Gaussian mixture regression", "LWR without states", "moment compliance, tuned", "skill")
]
stuck = mujoco[~mujoco.inserted]

few = [("noise", 64.0), ("rig.pivot_range", 0.012), ("rig.mount_stiffness", 400_000.0)]
loaded = [("noise", 1.0), ("friction", 0.4), ("rig.pivot_range", 0.012)]
compared = [name for name in times.index.unique("policy") if (scoreboard.policy == name).sum() == 200]
sixty_times = sixty[sixty.inserted].groupby(["policy", "trial_set"]).time_s.median()
round_exact = pd.concat([all_fresh, learning, curves, engines, arms]).query("engine == 'exact'")
both_steps = both(half.query("engine == 'exact'"), whole.query("engine == 'exact'"))
contexts_harder = contexts.query("trial_set == 'hard'")[["better", "worse"]]
planned_table = planned.groupby("policy").apply(summary, include_groups=False)
planned_table["back_offs"] = planned.groupby("policy").back_offs.sum()
planned_table["load"] = planned.groupby("policy").peak_measured_load_n.max()
planned_table["trusted"] = planned.groupby("policy").trusted.sum()
planned_table["share"] = planned_table.inserted / 2
given = ["true", "scaled:0.5", "shuffled", "frozen", "zero"]
all_given = pd.concat([force_use, force_use_networks])
gentle = all_given.assign(gentle=all_given.inserted & (all_given.peak_load_n < 20)).groupby(["policy", "value"])
by_wrench = (
    gentle[["inserted", "gentle"]]
    .sum()
    .unstack()
    .swaplevel(axis=1)[[(w, k) for w in given for k in ("inserted", "gentle")]]
)
wrench_loads = force_use.query("policy == 'skill'").groupby("value").peak_load_n.median()
arm_skill = arms.query("policy == 'skill'")
per_skill = inserted(protocol, "skill")


def arm_row(policy: str) -> list[float]:
    """Insertions, trials, medians of time and load, trials above the limit of the load, and the largest load."""
    rows = arms[arms.policy == policy]
    medians = [rows[rows.inserted].time_s.median(), rows.peak_load_n.median()]
    return [rows.inserted.sum(), len(rows), *medians, above_limit(rows), rows.peak_measured_load_n.max()]


Figures = dict[str, list[tuple[str, Any]]]  # A figure is two lines: its text, and what the rows say.
# fmt: off
ROWS: dict[str, list[tuple[str, Any]]] = {
    "README.md": [
        ("| {} of 400 | {} of 400 | `haptic-skill scoreboard docs/fresh` |",
         inserted(alone_exact)),
        ("that the skill asked for | {} of 400 | {} of 400 | the same |",
         inserted(corrected_exact)),
        ("up to {} demonstrations that the skill asked for",
         word(corrected.demonstrations.max() - 30)),
        ("with those it asked for | {}, {} of 250 | {}, {} of 250 |",
         inserted(fresh.query("engine == 'drake'"), "trial_set", "policy")),
        ("| {} of 1,000 ({}) | {} of 1,000 ({}) | `haptic-skill scoreboard docs/learning` |",
         inserted(learnt.query("value in [10, 30]"), "trial_set", "value")),
        ("| {:,} of 2,000 | {:,} of 2,000 | `haptic-skill scoreboard docs/sections` |",
         inserted(sections_corrected)),
        ("| {}, {}, {} of 100 | {}, {}, {} of 100 | `haptic-skill scoreboard docs/scoreboard` |",
         inserted(scoreboard.query("policy in ['CA states + LWR', 'Gaussian mixture regression', 'moment compliance, tuned']"), "trial_set", "policy")),
        ("Failures have pivots {:.0f} to {:.0f} mm",
         fresh[~fresh.inserted].pivot_mm.abs().agg(["min", "max"])),
        ("without any, the last row has {} and {}.",
         inserted(scoreboard.query("policy == 'LWR without states'"))),
    ],
    "docs/results.md": [
        ("| {} | {}, {} | {}, {} | {}, {} | {}, {} |",
         inserted(pd.concat([alone, corrected]), "demonstration_set", "policy", "engine", "trial_set") .unstack([1, 2, 3]) .sort_index(axis=1, ascending=[True, False, True])),
        ("| all | {}, {} of 400 | {}, {} of 250 | {}, {} of 400 | {}, {} of 250 |",
         inserted(pd.concat([alone, corrected]), "policy", "engine", "trial_set").sort_index(ascending=[True, False, True])),
        ("With corrections, {2:.0f} % of the usual and {3:.1f} % of the harder trials are inserted on rigid bodies, {0:.0f} and {1:.1f} % in Drake**",
         list(100 * corrected.groupby(["engine", "trial_set"]).inserted.mean())),
        ("and {:.0f} % or more with every set. The skills asked for",
         100 * corrected.groupby(["engine", "trial_set", "demonstration_set"]).inserted.mean().min()),
        ("The skills asked for {} to {}.",
         corrected.demonstrations.agg(["min", "max"]) - 30),
        ("As demonstrated it is {2:.1f} and {3:.1f} %, in Drake {0:.1f} and {1:.1f} %",
         list(100 * alone.groupby(["engine", "trial_set"]).inserted.mean())),
        ("all within {:.1f} and {:.1f} %)",
         alone.groupby(["engine", "trial_set"]).apply(summary, include_groups=False).agg({"low": "min", "high": "max"})),
        ("%), {:.0f} % or more with every set.",
         alone.groupby(["engine", "trial_set"]).apply(summary, include_groups=False).worst.min()),
        ("skills that insert {} and {} of 400 there, with corrections {} and {}.",
         [*inserted(shown_exact), *inserted(corrected_shown_exact)]),
        ("of {} trials that both performed, {} are inserted in the exact engine only and {} in Drake only.",
         both(alone_exact, alone_drake)),
        ("at pivots of {:.1f} mm or more below or above it",
         pd.concat([alone, corrected, shown_exact, corrected_shown_exact]) .query("not inserted") .pivot_mm.abs() .min()),
        ("{} of the {} failures of skills shown in the exact engine are of one set, 970.",
         [(shown_exact[~shown_exact.inserted].demonstration_set == 970).sum(), (~shown_exact.inserted).sum()]),
        ("{:.2f} s of a usual trial and {:.2f} s of a harder one (p {:.3f}, {:.3f};",
         [*-better["drake"].slower, *better["drake"].p_time]),
        ("In the exact engine {:.2f} and {:.2f} s are not certain (p {:.2f}, {:.2f})",
         [*-better["exact"].slower, *better["exact"].p_time]),
        ("nor are more insertions in either (p {:.2f}).",
         min(frame.p.min() for frame in better.values())),
        ("Of {} back-offs {} are saved there.",
         [alone_exact.back_offs.sum(), alone_exact.back_offs.sum() - corrected_exact.back_offs.sum()]),
        ("in {} of 800 trials as demonstrated, by {:.1f} N at most, and in {} with corrections ({:.1f} N); in Drake it is at most {:.1f} N.",
         [*(above_limit(alone_exact), alone_exact.peak_measured_load_n.max() - 40), *(above_limit(corrected_exact), corrected_exact.peak_measured_load_n.max()), fresh.query("engine == 'drake'").peak_measured_load_n.max()]),
        ("| {0:.0f} | {1:.0f} of 1,000 | {3:.0f}-{5:.0f} % | {7:.0f} % | {9:.1f} s | {11} of 200 | {2:.0f} of 1,000 | {4:.0f}-{6:.0f} % | {8:.0f} % | {10:.1f} s | {12} of 200 |",
         pd.concat([learnt.groupby(["value", "trial_set"]).apply(summary, include_groups=False).unstack(), inserted(stateless, "value", "trial_set").unstack()], axis=1)),
        ("With thirty demonstrations every set but {} inserts at least 90 % of the harder trials",
         word(sets_below_90[30, "hard"])),
        ("from ten, {} of twenty sets insert less than 90 % of the usual trials, and {} less than 90 % of the harder ones.",
         sets_below_90[10].map(word)),
        ("(p over the sets {:.2f} or more)",
         against("learning", "LWR without states", "skill").p.min()),
        ("{} usual and {} harder ones are inserted only with states, {} and {} only without",
         [*states_pay.better, *states_pay.worse]),
        ("ten insert {} and {} of 60 trials, thirty {} and {} ([table](curves.md)).",
         inserted(curves.query("policy == 'demonstrations' and value in [10, 30]"), "value", "trial_set")),
        ("| {0:.0f} | {1:.1f} | {2:.0f} of 60 | {4:.0f}-{6:.0f} % | {8:.0f} % | {10:.1f} s | {12} | {3:.0f} of 60 | {5:.0f}-{7:.0f} % | {9:.0f} % | {11:.1f} s | {13} |",
         pd.concat([asked.groupby("value").demonstrations.mean(), asked.groupby(["value", "trial_set"]).apply(summary, include_groups=False).unstack(), inserted(unasked, "value", "trial_set").unstack()], axis=1)),
        ("insert {} of 60 of each set**",
         inserted(asked[asked.value == 20]).unique()[0]),
        ("{} of the harder trials are better and {} worse ({} of the {} with one set), {} usual ones better and none worse",
         [*asked_pairs.iloc[1][["better", "worse"]], max(asked_pairs.iloc[1].gains), *asked_pairs.better[::-1]]),
        ("| {0} | {7}, {8} | {1}, {2} | {5}, {6} | {9}, {10} | {11:.0f} N | {3}, {4} |",
         pd.concat([inserted(taught, "value", "policy", "engine", "trial_set").unstack([1, 2, 3]).sort_index(axis=1), sections_corrected.query("trial_set == 'usual'").groupby("value").peak_load_n.median()], axis=1).rename({"d": "D"})),
        ("| all | {6:.0f}, {7:.0f} % | {0:.0f}, {1:.0f} % | {4:.0f}, {5:.0f} % | {8:.0f}, {9:.0f} % | | {2:.0f}, {3:.0f} % |",
         list(100 * taught.groupby(["policy", "engine", "trial_set"]).inserted.mean())),
        ("the least p of ten tables is {:.3f} (harder hexagons, {} better, none worse;",
         [least.p, least.better]),
        ("Rectangle ({3:.0f} % usual) and D ({0:.2f} % usual) miss it.",
         list(100 * sections_corrected.query("trial_set == 'usual'").groupby("value").inserted.mean())),
        ("{} of its trials of all policies end with a fault",
         (sections[sections.value == "rectangle"].fault != "").sum()),
        ("passes it in {0} of 2,000 usual and {1} of 2,000 harder trials, up to {2:.0f} and {3:.0f} N.",
         [*sections_corrected.groupby("trial_set").apply(above_limit, include_groups=False), *sections_corrected.groupby("trial_set").peak_measured_load_n.max()]),
        ("In Drake {} of 200 usual and {} of 200 harder trials are trusted**",
         sections.query("engine == 'drake'").groupby("trial_set").trusted.sum()),
        ("in the exact engine all but {} of {:,}:",
         [(~sections.query("engine == 'exact'").trusted).sum(), (sections.engine == "exact").sum()]),
        ("| {0} | {9}, {10} | {3}, {4} | {7}, {8} | {5}, {6} | {1}, {2} | {11}, {12} |",
         pd.concat([inserted(other_part, "taught", "value", "trial_set").unstack([1, 2]).sort_index(axis=1), inserted(other_part, "taught", "trial_set").unstack()], axis=1)),
        ("| {} | {}, {} | {}, {} |",
         inserted(clocking, "value", "policy", "trial_set").unstack([1, 2]).sort_index(axis=1)),
    ],
    "docs/comparisons.md": [
        ("| {} | {} ({}) | {} ({}) | {} ({}) | {} ({}) | {} ({}) |",
         by_wrench),
        ("the skill in {} of 20;",
         20 - by_wrench.loc["skill", ("zero", "inserted")]),
        ("blind, they still insert {} of {} and {} of {}, always",
         [by_wrench.loc[policy, (wrench, "inserted")] for policy in ("SAC", "ACT") for wrench in ("zero", "true")]),
        ("touch is enough for {} insertions; an earlier one, drawn anew each time, for {}, but with a load of {:.0f} N in place of {:.0f} N (medians).",
         [*by_wrench.loc["skill", [("frozen", "inserted"), ("shuffled", "inserted")]], *wrench_loads[["shuffled", "true"]]]),
        ("| {} | {} | {} | {:.2f} | {:.2f} |",
         pd.concat([inserted(scoreboard, "policy", "trial_set").unstack(), times.unstack()], axis=1).loc[compared]),
        ("| no correction | {} | {} | – | – |",
         inserted(scoreboard.query("policy == 'no correction'"))),
        ("({} usual trials better, none worse), in {:.1f} to {:.1f} s less; in hard trials ({} better, {} worse), in {:.1f} to {:.1f} s less.",
         [with_states.better.max().usual, -with_states.slower.max().usual, -with_states.slower.min().usual, with_states.better.max().hard, with_states.worse.max().hard, -with_states.slower.max().hard, -with_states.slower.min().hard]),
        ("all {:.0f} failures without states in hard trials are of set {:.0f}",
         stateless_sets.query("trial_set == 'hard'").demonstration_set.agg(["size", "max"])),
        ("by default {}, {}, {} and {} of the four sets.",
         [*stateless_sets.query("trial_set == 'usual'").demonstration_set.value_counts(), 0]),
        ("contexts add {:.1f} s that are saved in hard trials ({:.1f} to {:.1f} s with three sets, nothing with one)",
         [-contexts_too.slower, *-pd.Series(sorted(contexts_too.delays)[2::-2])]),
        ("GMM-BIC has {} to {} components where CA has {} or {} states",
         [*scoreboard[scoreboard.policy == "GMM-BIC states + LWR"].states.agg(["min", "max"]), *scoreboard[scoreboard.policy == "CA states + LWR"].states.agg(["min", "max"])]),
        ("{0:.1f} N in contact where the skill has {2:.1f} N, its largest load is {1:.0f} N where the skill has {3:.0f} N (medians); in hard trials {4:.0f} N where it has {5:.0f} N.",
         [*loads.loc["moment compliance, tuned", "usual"], *loads.loc["CA states + LWR", "usual"], *(loads.peak_load_n[name, "hard"] for name in ("moment compliance, tuned", "CA states + LWR"))]),
        ("The largest measured load of any row is {:.0f} N** ({})",
         [scoreboard.peak_measured_load_n.max(), scoreboard.policy[scoreboard.peak_measured_load_n.idxmax()]]),
        *(("| {0} | {5} ({10:.1f}) | {4} ({9:.1f}) | {3} ({8:.1f}) | {2} ({7:.1f}) | {1} ({6:.1f}) |", rung_table.xs(arm, level="trial_set")) for arm in ("usual", "hard")),
        ("the skill inserts at least {} of 200 at every clearance tried**",
         rung.xs("skill, carried over", level="policy").min()),
        ("at 0.038 its mean load is {:.0f} N, {:.0f} N if it is taught there.",
         rungs.query("value == 0.038 and trial_set == 'usual' and policy.str.startswith('skill')") .groupby("policy") .mean_load_n.median()),
        ("at 0.038 the skill of one of the four sets inserts {} and {} of 50.",
         inserted(ladder.query("value == 0.038 and demonstration_set == 768 and policy.str.startswith('Gaussian')"))),
        ("of the skill taught there {} of {} failures in hard trials are of one of the four sets.",
         [50 - inserted(ladder.query("value == 0.0025 and trial_set == 'hard' and policy == 'taught there'"), "demonstration_set").min(), 200 - rung[0.0025, "hard", "skill, taught there"]]),
        ("{} to {} of 200 usual and {} to {} harder trials overlap by more than a quarter of the clearance; at 0.005 it is {} to {} and {} to {}.",
         list(untrusted.groupby(["value", "trial_set"]).agg(["min", "max"]).stack())),
        ("| | {1:,.0f} ({6:.1f}-{11:.1f} %) / {26} | {2:,.0f} ({7:.1f}-{12:.1f} %) / {27} | {3:,.0f} ({8:.1f}-{13:.1f} %) / {28} | {4:,.0f} ({9:.1f}-{14:.1f} %) / {29} | {5:,.0f} ({10:.1f}-{15:.1f} %) / {30} |",
         curve_table),
        ("at most {} of the 100 trials a point that both perform are inserted by the skill only, and at most {} by the regression only",
         [word(other_pairs.better.max()), word(other_pairs.worse.max())]),
        ("A straight push inserts {} of {}.",
         curves.query("policy == 'straight push' and engine == 'exact'").inserted.agg(["sum", "size"])),
        ("at 64 times the regression inserts more (p < {}).", max(0.001, most_noise.p)),
        ("{:.0f} or {:.0f} are inserted everywhere but at 64 times the noise ({:.0f}), with pivots up to 12 mm ({:.0f}) and at 400 kN/m ({:.0f}).",
         [*drake_curve["skill"].drop(few).agg(["min", "max"]), *drake_curve["skill"][few]]),
        ("The regression inserts {} to {} of 40, and {} at the largest noise.",
         [*drake_curve["Gaussian mixture regression"].drop(few[0]).agg(["min", "max"]), drake_curve["Gaussian mixture regression"][few[0]]]),
        ("in {0} of the 1,000 nominal trials ({3:.0f} N at most), in {1} at a friction of 0.4 ({4:.0f} N), in {2} with pivots up to 12 mm ({5:.0f} N)",
         [*over[loaded], *largest[loaded]]),
        ("in {} with 64 times the noise ({:.0f} N)",
         [over["noise", 64], largest["noise", 64]]),
        ("| {} | {} | {} |",
         inserted(sixty, "policy", "trial_set").unstack().loc[undone]),
        ("the skill inserts fewer, in {:.1f} and {:.1f} s where it takes {:.1f} and {:.1f} s.",
         [*sixty_times["free demonstrations"], *sixty_times["CA states + LWR"]]),
    ],
    "docs/limits.md": [
        ("In Drake, in {:.0f} % of the usual and {:.0f} % of the harder trials of [ten sets]",
         100 - 100 * alone_drake.groupby("trial_set").trusted.mean()),
        ("In the exact engine {} trials of the round peg are trusted.",
         "all" if round_exact.trusted.all() else "not all"),
    ],
    "docs/physics.md": [
        ("{:.0f} % of [Drake's trials](#trials-in-three-engines) exceed 12.5 µm.",
         100 * (alone_drake.penetration_um > 12.5).mean()),
        ("| inserted | {2}, {3} of 400 | {0}, {1} of 250 | {4}, {5} of 50 |",
         list(inserted(three, "engine", "trial_set"))),
        ("| time | {2:.2f}, {3:.2f} s | {0:.2f}, {1:.2f} s | {4:.2f}, {5:.2f} s |",
         list(three[three.inserted].groupby(["engine", "trial_set"]).time_s.median())),
        ("| mean load | {2:.1f}, {3:.1f} N | {0:.1f}, {1:.1f} N | {4:.1f}, {5:.1f} N |",
         list(three_medians.mean_load_n)),
        ("| largest load | {2:.1f}, {3:.1f} N | {0:.1f}, {1:.1f} N | {4:.1f}, {5:.1f} N |",
         list(three_medians.peak_load_n)),
        ("| largest force of a single contact | {2:.1f}, {3:.1f} N | {0:.1f}, {1:.1f} N | {4:.1f}, {5:.1f} N |",
         list(three_medians.peak_contact_n)),
        ("| overlap | {2:.1f}, {3:.1f} µm | {0:.1f}, {1:.1f} µm | {4:.1f}, {5:.1f} µm |",
         list(three_medians.penetration_um)),
        ("| physics trusted | {2:.0f}, {3:.0f} % | {0:.0f}, {1:.0f} % | {4:.0f}, {5:.0f} % |",
         list(100 * three.groupby(["engine", "trial_set"]).trusted.mean())),
        ("| these 50 and 50 trials: inserted | {2}, {3} | {0}, {1} | {4}, {5} |",
         list(inserted(first_five, "engine", "trial_set"))),
        ("| at half the step | {2}, {3} | {0}, {1} | {4}, {5} |",
         list(inserted(half_first, "engine", "trial_set"))),
        ("At half the step the exact engine inserts the same {} of {} trials",
         [both_steps[0] - sum(both_steps[1:]), both_steps[0]]),
        ("largest loads have medians of {:.1f} and {:.1f} N instead of {:.1f} and {:.1f} N, single contacts {:.1f} and {:.1f} N instead of {:.1f} and {:.1f} N.",
         [value for column in ("peak_load_n", "peak_contact_n") for rows in (half, whole) for value in rows.query("engine == 'exact'").groupby("trial_set")[column].median()]),
        ("a single contact has twice the force of Drake's, {:.0f} and {:.0f} N.",
         [three_medians.peak_contact_n[name, "hard"] for name in ("exact", "drake")]),
        ("In the first five trials of each set it does not, {1:.0f} and {0:.0f} N.",
         list(first_five[first_five.engine != "mujoco"] .query("trial_set == 'hard'") .groupby("engine") .peak_contact_n.median())),
        ("Gaussian mixture regression inserts {2} and {3} in the exact engine and {0} and {1} in Drake, regression without states {6} and {7}, and {4} and {5}, tuned moment compliance {10} and {11}, and {8} and {9}, the skill {14} and {15}, and {12} and {13}.",
         list(inserted(laws, "policy", "engine", "trial_set"))),
        ("Of 200 pairs, {}, {}, {} and {} differ.",
         laws_differ),
        ("{:.0f} % of its harder trials are not trusted",
         100 - 100 * alone_drake.groupby("trial_set").trusted.mean().hard),
        ("inserts {} of {} trials of which the others insert {} and {}, at half the step {}; {} pairs differ between the two steps.",
         [*mujoco.inserted.agg(["sum", "size"]), *inserted(first_five, "engine")[["drake", "exact"]], half.query("engine == 'mujoco'").inserted.sum(), sum(both(mujoco, half.query("engine == 'mujoco'"))[1:])]),
        ("at pivots {:.1f} to {:.1f} mm below it",
         (-stuck.pivot_mm).agg(["min", "max"])),
    ],
    "docs/practice.md": [
        ("it then inserts in [{} of {} trials]",
         corrected.inserted.agg(["sum", "size"])),
    ],
    "docs/planning.md": [
        ("| {0} | {1:.0f} of 200 | {9:.0f} % ({2:.0f} to {3:.0f}) | {4:.0f} % | {5:.2f} s | {6} | {7:.1f} N | {8} |",
         planned_table),
        ("{} trials better, {} worse (p {:.2f}), {:.1f} s slower on average (p {:.2f}).",
         plan[["better", "worse", "p", "slower", "p_time"]]),
        ("Set 759 decides both: {} more failures and {:.1f} s; with the others it is {:.1f} s faster to {:.1f} s slower.",
         [word(-min(plan.gains)), max(plan.delays), -other_delays[0], other_delays[-1]]),
        ("({} trials better, {} worse than with one contact state)",
         plan_states[["worse", "better"]]),
        ("nor where it imitates ({} better, {} worse).",
         imitate_states[["worse", "better"]]),
        ("{} trials better, {} worse (p {:.2f}), {:.1f} s faster on average (p {:.2f})",
         no_contexts[["worse", "better", "p", "slower", "p_time"]]),
        ("and {} back-offs where there are {} without.",
         planned.groupby("policy").back_offs.sum()[["imitate (default)", "imitate, no contexts"]]),
    ],
    "docs/arm.md": [
        ("| skill | {} of {} | {:.1f} s | {:.0f} N | {}, up to {:.0f} N |", arm_row("skill")),
        ("| moment compliance, tuned | {} of {} | {:.1f} s | **{:.0f} N** | {} |", arm_row("moment compliance, tuned")[:5]),
        ("| spiral search, tuned | {} of {} | {:.1f} s | {:.0f} N | {}, up to {:.0f} N |", arm_row("spiral search, tuned")),
        ("| straight push | {} of {} | {:.1f} s | {:.0f} N | {}, up to {:.0f} N |", arm_row("straight push")),
        ("By skill, {} insert 20 of 20 and {} 19.",
         [word((inserted(arm_skill, "demonstration_set") == n).sum()) for n in (20, 19)]),
        ("median clock of the arm {:.2f} of real time",
         protocol.clock.median()),
        ("the pivot up to 3 mm off | {} of 400 |",
         inserted(alone_exact).usual),
        ("| arm, one diagram (above) | {} of {} | {:.1f} s | {:.0f} N | {}, up to {:.0f} N |", arm_row("skill")),
        ("| {} of {} | {:.1f} s | {:.0f} N | {}, up to {:.0f} N |",
         [*protocol.inserted.agg(["sum", "size"]), protocol.time_s.median(), protocol.measured_load_n.median(), (protocol.measured_load_n > 40).sum(), protocol.measured_load_n.max()]),
        ("{} skills insert 20 of 20, the others {} and {}.",
         [word((per_skill == 20).sum()).capitalize(), *sorted(per_skill)[:2]]),
        ("All {} failures give up {:.0f} to {:.0f} mm deep",
         [word((~protocol.inserted).sum()), *protocol[~protocol.inserted].true_depth_mm.agg(["min", "max"])]),
    ],
    "docs/usage.md": [
        ("has {} pegs drawn", len(own_pegs)),
        ("In all {} the laws of theory hold", int(pegs.laws.astype(bool).sum())),
        ("insert {} of {} trials: all ten with {} of them, nine with {}, fewer with {}",
         [pegs.inserted.sum(), 10 * len(pegs), (pegs.inserted == 10).sum(), (pegs.inserted == 9).sum(), len(lacking)]),
        ("these {} are among the {} with a radius below 6 mm",
         [(lacking.radius < SMALL).sum(), (pegs.radius < SMALL).sum()]),
        ("the other {} skills all insert at least nine", int((pegs[pegs.radius >= SMALL].inserted >= 9).sum())),
        ("up to {} corrections", int(pegs.corrected.max())),
        ("With {} of the loosest holes no bad habit", word((pegs.demonstrated == 24).sum())),
    ],
}
# fmt: on

ELSEWHERE: dict[str, dict[str, str]] = {
    "docs/comparisons.md": {
        "| friction | 0.05 | 0.1 | 0.2 | 0.3 | 0.4 |": "make sweeps",
        "| sensor noise, times the nominal one | 0 | 1 | 4 | 16 | 64 |": "make sweeps",
        "| pivot, up to so many mm from the mouth | 0 | 1.5 | 3 | 6 | 12 |": "make sweeps",
        "| stiffness of the mount, kN/m | 25 | 50 | 100 | 200 | 400 |": "make sweeps",
    },
    "docs/exports.md": {"### An imitation policy of LeRobot on the rig": "sweep"},
    "docs/first_hour.md": {"## How this page is tried": "python -m docs._tools.first_hour"},
    "docs/gymnasium.md": {
        "## Reinforcement learning beside the skill": "python -m benchmarks.rig.reinforcement --skill"
    },
    "docs/physics.md": {
        "insert 1964 and 1925 of 2000 trials in the exact engine": "benchmarks/sweeps/random_contact.yaml"
    },
    "docs/practice.md": {
        "show me: 1 of 3": "haptic-skill correct --live",
        "| inserted | 400 of 400 | 400 of 400 | | |": "haptic-skill practise --engine exact",
    },
    "docs/results.md": {"10 of 10 inserted; median": "haptic-skill demo"},
}
