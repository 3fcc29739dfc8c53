"""One HTML page about a batch of rig trials: summary, distributions, every trial, the scenario; it opens from disk."""

from __future__ import annotations

import html
from collections.abc import Mapping, Sequence

import numpy as np
from scipy.stats import binomtest

from skill.states.state_style import state_colours
from systems.reports.histogram import histogram
from systems.runs.trial_result import TrialResult

PAGE = """<!DOCTYPE html>
<html lang="en">
<head><meta charset="utf-8"><meta name="viewport" content="width=device-width">
<title>{title}</title><link rel="icon" href="data:,"><style>{style}</style></head>
<body>
<header><h1>{title}</h1><p class="about">{about}</p></header>
<section id="summary">{tiles}</section>
<section id="distributions">{histograms}</section>
<p class="about">Line: median. Red: not inserted.</p>
<section id="worst">{worst}</section>
<section>
<h2>Trials</h2>
<p class="about">A click on a heading sorts by it. Unknown: in no contact state; unlike: like nothing remembered.
States are those visited, in order, coloured as in the replays.</p>
<div class="scroll"><table id="trials"><thead><tr>{headings}</tr></thead><tbody>
{rows}
</tbody></table></div>
<p class="key">{key}</p>
</section>
<section><h2>What made it</h2>
<dl>{made_by}</dl>
<details><summary>scenario</summary><pre>{scenario}</pre></details>
</section>
<script>{script}</script>
</body>
</html>
"""

STYLE = """
:root { --ink: #1d2329; --faint: #56616b; --line: #d3dae0; --good: #0072b2; --bad: #c1121f; }
body { margin: 0 auto; max-width: 1180px; padding: 18px 22px 40px; background: #f5f7f9; color: var(--ink);
  font: 14px/1.45 system-ui, -apple-system, "Segoe UI", "DejaVu Sans", sans-serif; }
h1 { font-size: 22px; margin: 0; } h2 { font-size: 16px; margin: 26px 0 4px; }
.about { color: var(--faint); margin: 2px 0 10px; font-size: 13px; }
#summary, #distributions { display: grid; gap: 12px; }
#summary { grid-template-columns: repeat(auto-fit, minmax(180px, 1fr)); margin: 14px 0 12px; }
#distributions { grid-template-columns: repeat(auto-fit, minmax(260px, 1fr)); }
.tile, .panel, #worst { background: #fff; border: 1px solid var(--line); border-radius: 7px; padding: 10px 14px; }
.tile b { display: block; font-size: 24px; line-height: 1.2; font-variant-numeric: tabular-nums; }
.tile span { color: var(--faint); font-size: 12.5px; }
.panel h3 { font-size: 13px; margin: 0 0 4px; font-weight: 600; } .panel svg { display: block; width: 100%; }
#worst { margin-top: 8px; } a { color: var(--good); }
.scroll { overflow-x: auto; background: #fff; border: 1px solid var(--line); border-radius: 7px; }
table { border-collapse: collapse; width: 100%; font-variant-numeric: tabular-nums; font-size: 13px; }
th, td { padding: 3px 9px; text-align: right; white-space: nowrap; border-bottom: 1px solid #edf0f3; }
th { cursor: pointer; font-weight: 600; vertical-align: bottom; user-select: none; background: #fff; }
th small { display: block; color: var(--faint); font-weight: 400; }
th[aria-sort=ascending] small::after { content: " \\25b4"; }
th[aria-sort=descending] small::after { content: " \\25be"; }
td.text, th.text { text-align: left; }
tr.failed td { background: #fdecec; } tr.failed td.outcome { color: var(--bad); font-weight: 600; }
tbody tr:hover td { background: #eef4f9; }
.visits { display: inline-flex; flex-wrap: wrap; gap: 1px; max-width: 200px; vertical-align: middle; }
.visits i, .key i { display: inline-block; width: 7px; height: 13px; border-radius: 1px; }
.key { font-size: 13px; } .key span { margin-right: 16px; white-space: nowrap; }
.key i { vertical-align: -2px; margin-right: 5px; }
dl { display: grid; grid-template-columns: max-content 1fr; gap: 2px 14px; margin: 4px 0 10px; font-size: 13px; }
dt { color: var(--faint); } dd { margin: 0; overflow-wrap: anywhere; }
pre { background: #fff; border: 1px solid var(--line); border-radius: 7px; padding: 10px 14px; overflow-x: auto;
  font-size: 12px; }
"""

SCRIPT = """
const body = document.querySelector("#trials tbody");
document.querySelectorAll("#trials th").forEach((heading, column) => heading.addEventListener("click", () => {
  const up = heading.getAttribute("aria-sort") !== "ascending";
  document.querySelectorAll("#trials th").forEach(h => h.removeAttribute("aria-sort"));
  heading.setAttribute("aria-sort", up ? "ascending" : "descending");
  const key = row => row.cells[column].dataset.key ?? row.cells[column].textContent;
  const order = (a, b) => {
    const [p, q] = [key(a), key(b)], [x, y] = [Number(p), Number(q)];
    return isNaN(x) || isNaN(y) ? p.localeCompare(q) : x - y;
  };
  [...body.rows].sort((a, b) => (up ? 1 : -1) * order(a, b)).forEach(row => body.append(row));
}));
"""

COLUMNS = (
    *(("trial", ""), ("tilt", "deg"), ("outcome", ""), ("time", "s"), ("depth", "mm"), ("peak along", "N")),
    *(("peak across", "N"), ("moment", "N m"), ("overlap", "um"), ("steps", ""), ("lost", ""), ("back-offs", "")),
    *(("unknown", "s"), ("unlike", "s"), ("states", "")),
)
TEXT_COLUMNS = ("outcome", "states")


def worst_trial(results: Sequence[TrialResult]) -> TrialResult:
    """Of those not inserted the shallowest; where all inserted, the one with the greatest peak force across."""
    failed = [r for r in results if not r.inserted]
    return min(failed, key=lambda r: r.depth) if failed else max(results, key=lambda r: r.peak_lateral_force)


def batch_report(
    results: Sequence[TrialResult],
    *,
    title: str,
    state_names: Sequence[str],
    replay: str,
    made_by: Mapping[str, str],
    scenario: str,
) -> str:
    """The page as text; it needs nothing beside it but the replay that it links.

    Args:
        results: at least one.
        title: of the page.
        state_names: of the contact states.
        replay: address of the page that replays the worst trial, relative to this one.
        made_by: what decided the results, by name: skill, seeds, versions.
        scenario: as YAML text.
    """
    worst = worst_trial(results)
    colours = state_colours(len(state_names))
    return PAGE.format(
        title=html.escape(title),
        about=_about(results),
        style=STYLE,
        script=SCRIPT,
        tiles="".join(f'<div class="tile"><b>{value}</b><span>{note}</span></div>' for value, note in _tiles(results)),
        histograms="".join(_panel(results, *quantity) for quantity in QUANTITIES),
        worst=_worst(worst, replay),
        headings="".join(
            f'<th class="{"text" if name in TEXT_COLUMNS else ""}">{name}<small>{unit or "&nbsp;"}</small></th>'
            for name, unit in COLUMNS
        ),
        rows="\n".join(_row(r, colours, replay if r is worst else None) for r in results),
        key="".join(
            f'<span><i style="background: {colour}"></i>{k} {html.escape(name)}</span>'
            for k, (name, colour) in enumerate(zip(state_names, colours, strict=True))
        ),
        made_by="".join(f"<dt>{html.escape(k)}</dt><dd>{html.escape(v)}</dd>" for k, v in made_by.items()),
        scenario=html.escape(scenario),
    )


QUANTITIES = (
    ("time", "s", "time"),
    ("peak force across the peg", "N", "peak_lateral_force"),
    ("peak force along the peg", "N", "peak_axial_force"),
    ("steps of both motors", "", "steps"),
)


def _about(results: Sequence[TrialResult]) -> str:
    tilts = np.degrees(np.abs([r.tilt for r in results]))
    return (
        f"trials {results[0].seed} to {results[-1].seed}, from tilts of up to {tilts.max():.1f} degrees on an axis;"
        " times and forces over all trials, inserted or not"
    )


def _tiles(results: Sequence[TrialResult]) -> list[tuple[str, str]]:
    n, inserted = len(results), sum(r.inserted for r in results)
    interval = binomtest(inserted, n).proportion_ci(method="wilson")
    times = np.array([r.time for r in results])
    across = np.array([r.peak_lateral_force for r in results])
    lost, backs = sum(r.lost_steps for r in results), sum(r.back_offs for r in results)
    return [
        (
            f"{inserted} of {n}",
            f"inserted; 95 % Wilson interval {100 * interval.low:.1f} to {100 * interval.high:.1f} %",
        ),
        (f"{np.median(times):.2f} s", f"median time; nine in ten within {np.quantile(times, 0.9):.2f} s"),
        (
            f"{np.median(across):.1f} N",
            f"median peak force across; 95th percentile {np.quantile(across, 0.95):.1f} N,"
            f" largest {across.max():.1f} N",
        ),
        (str(backs), f"back-offs, in {sum(r.back_offs > 0 for r in results)} of the trials; {lost} steps lost"),
    ]


def _panel(results: Sequence[TrialResult], name: str, unit: str, field: str) -> str:
    values = np.array([getattr(r, field) for r in results], dtype=float)
    drawn = histogram(values, np.array([r.inserted for r in results]), unit=unit)
    return f'<div class="panel"><h3>{name}{f" ({unit})" if unit else ""}</h3>{drawn}</div>'


def _worst(worst: TrialResult, replay: str) -> str:
    why = (
        "every trial inserted; this one pushed hardest across the peg"
        if worst.inserted
        else "not inserted, and of those the shallowest"
    )
    return (
        f'<b>Worst trial: <a href="{html.escape(replay)}">replay of trial {worst.seed}</a></b> &ndash; {why}:'
        f" {html.escape(worst.reason)} after {worst.time:.2f} s at {1e3 * worst.depth:.1f} mm,"
        f" {worst.peak_lateral_force:.1f} N across, {worst.peak_axial_force:.1f} N along"
    )


def _row(r: TrialResult, colours: Sequence[str], replay: str | None) -> str:
    number = str(r.seed) if replay is None else f'<a href="{html.escape(replay)}">{r.seed}</a>'
    visits = "".join(f'<i style="background: {colours[k]}" title="{k}"></i>' for k in r.states)
    tilt = np.degrees(r.tilt)
    cells = (
        *((r.seed, number), (float(np.linalg.norm(tilt)), f"{tilt[0]:+.1f} {tilt[1]:+.1f}")),
        *((r.reason, html.escape(r.reason)), (r.time, f"{r.time:.2f}"), (r.depth, f"{1e3 * r.depth:.1f}")),
        *((r.peak_axial_force, f"{r.peak_axial_force:.1f}"), (r.peak_lateral_force, f"{r.peak_lateral_force:.1f}")),
        *((r.peak_moment, f"{r.peak_moment:.2f}"), (r.penetration, f"{1e6 * r.penetration:.0f}")),
        *((r.steps, str(r.steps)), (r.lost_steps, str(r.lost_steps)), (r.back_offs, str(r.back_offs))),
        *((r.unknown_time, f"{r.unknown_time:.2f}"), (r.unsupported_time, f"{r.unsupported_time:.2f}")),
        (len(r.states), f'<span class="visits">{visits}</span>'),
    )
    row = "".join(
        f'<td class="{f"text {name}" if name in TEXT_COLUMNS else ""}" data-key="{html.escape(str(key))}">{text}</td>'
        for (name, _), (key, text) in zip(COLUMNS, cells, strict=True)
    )
    return f'<tr class="{"" if r.inserted else "failed"}">{row}</tr>'
