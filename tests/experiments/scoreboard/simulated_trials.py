"""Folders of results as `haptic-skill sweep` writes them, with simulated trials."""

import json

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from experiments.sweep.trial_files import SCHEMA, partition

PLAIN = {
    **{"factors": "{}", "demonstration_set": None, "demonstrations": None, "skill": "s0", "train_s": None},
    **{"states": 6, "query_ms": None, "tilt_x_deg": 1.0, "tilt_y_deg": -2.0, "time_s": 2.5, "depth_mm": 24.7},
    **{"penetration_um": 3.0, "peak_contact_n": 15.0, "peak_load_n": 16.0, "mean_load_n": 8.0, "steps": 20},
    **{"seconds_above_20n": 0.0, "wedged_s": 0.0, "path_mm": 27.7, "jerk_ms3": 4.0, "field_score": 99.0},
    **{"lost_steps": 0, "back_offs": 0, "trusted": True, "outcome": "inserted", "fault": "", "reason": "inserted"},
    **{"inserted": True, "cpu_s": 2.0, "clearance": 0.005, "time_limit_s": 10.0, "scenario": "seed: 0\n"},
    **{"versions": "{}", "code": "c0de0001", "began": "2026-01-31T12:00:00+00:00"},
}
FAILED = {"inserted": False, "outcome": "time over", "reason": "time over", "time_s": 10.0, "field_score": 45.0}
LEARNT = "CA states, contexts + LWR"
OTHER = "LWR without 'states'"
LAW = "straight push <b>"


def write_trials(folder, rows, *, policy=LEARNT, trial_set="usual", engine="drake", block="0000"):
    """Writes rows, each a dictionary of what differs from a plain insertion, as one file; returns its path."""
    place = partition(folder, policy, trial_set, engine)
    place.mkdir(parents=True, exist_ok=True)
    path = place / f"{block}.parquet"
    full = []
    for number, row in enumerate(rows):
        trial = row.get("trial", number)
        factors, code = row.get("factors", "{}"), row.get("code", PLAIN["code"])
        key = f"{policy}/{trial_set}/{engine}/{factors}/{row.get('demonstration_set')}/{trial}/{code}"
        full.append({**PLAIN, "trial": trial, "key": key, **row})
    pq.write_table(pa.Table.from_pylist(full, schema=SCHEMA), path)
    return path


def write_sweep(folder, name="nominal", title="Nominal trials"):
    path = folder / "sweeps" / f"{name}.yaml"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"# what is varied\ntitle: {title}\ntrials: 20\n")
    return path


def draw(rng, count, share, **same):
    """Rows of simulated trials, of which a share inserts."""
    rows = []
    for k in range(count):
        row = {
            "trial": k,
            "time_s": round(float(rng.uniform(1.8, 3.5)), 3),
            "peak_contact_n": round(float(rng.uniform(8, 40)), 1),
            "peak_load_n": round(float(rng.uniform(8, 35)), 1),
            "mean_load_n": round(float(rng.uniform(4, 9)), 2),
            "seconds_above_20n": round(float(rng.exponential(0.1)), 3),
            "wedged_s": round(float(rng.choice([0.0, 0.0, 0.0, 0.3])), 3),
            "field_score": round(float(rng.uniform(97, 100)), 2),
            "back_offs": int(rng.poisson(0.7)),
            "lost_steps": int(rng.choice([0, 0, 0, 4])),
            "trusted": bool(rng.random() > 0.1),
            "cpu_s": round(float(rng.uniform(1, 3)), 3),
        }
        if rng.random() > share:
            row |= FAILED
            row |= rng.choice([{}, {"outcome": "jammed"}, {"outcome": "fault", "fault": "motor stalled"}])
        rows.append({**row, **same})
    return rows


def write_results(folder, *, count=40, frictions=(0.1, 0.2, 0.3), engines=("drake",), sets=4):
    """A folder with three policies, a factor with three values, and both sets of trials; returns the folder."""
    rng = np.random.default_rng(7)
    write_sweep(folder)
    for policy, share in ((LEARNT, 0.97), (OTHER, 0.8), (LAW, 0.4)):
        learns = {} if policy == LAW else {"demonstrations": 30, "train_s": 12.5, "query_ms": 0.35}
        for engine in engines:
            for trial_set, loss in (("usual", 0.0), ("hard", 0.2)):
                rows = []
                for friction in frictions if trial_set == "usual" else ():
                    factors = json.dumps({"contact.friction": friction})
                    rows += draw(rng, count, share - friction / 2, factors=factors, **learns)
                rows += draw(rng, count, share - loss, **learns)
                if learns:
                    rows = [{**row, "demonstration_set": row["trial"] % sets} for row in rows]
                write_trials(folder, rows, policy=policy, trial_set=trial_set, engine=engine)
    return folder
