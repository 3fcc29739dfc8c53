import io
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from rich.console import Console

from interfaces.reports.result_tables import (
    discovered_table,
    phase_table,
    result_summary,
    result_table,
    state_table,
)
from skill.data.outcome import Outcome
from skill.states.phase_agreement import PhaseAgreement
from skill.states.state_summary import summarise_states
from systems.law.faults import Fault
from tests.interfaces.reports.tables import text_of
from tests.state_recordings import FORCES, MOMENTS, labelled
from tests.trial_results import PLAIN

WRENCHES = np.hstack([FORCES, MOMENTS])


def test_the_result_table_has_one_row_per_trial_and_a_summary():
    first = replace(PLAIN, seed=3, states=(0, 1, 0))
    failed = replace(
        PLAIN,
        seed=4,
        outcome=Outcome.FAILED,
        detail="[/x] broke",
        time=3.5,
        peak_load=20.0,
        peak_contact_force=45.0,
        penetration=40e-6,
    )
    text = text_of(result_table([first, failed]))
    assert "3 +1.0 -2.0 inserted 2.50 24.7 16.0 15.0 0.25 20 0 1 (3)" in text
    assert "[/x] broke" in text
    assert result_summary([first, replace(failed, trusted=False)]) == [
        "1 of 2 inserted; median 3.00 s",
        "medians: peak load 18 N, peak force of a contact 30 N, overlap 30 um",
        "physics not trusted in 1 of 2 trials: the bodies overlap",
    ]


@pytest.mark.parametrize("width", [80, 100])
def test_no_cell_of_the_widest_result_table_is_cut(width):
    visited = tuple(range(12)) * 3
    worst = replace(
        PLAIN, seed=12345, outcome=Outcome.FAULT, fault=Fault.PITCH_STEPS_LOST, peak_load=1234.5, states=visited
    )
    console = Console(file=io.StringIO(), width=width)
    console.print(result_table([replace(worst, time=10.0, peak_contact_force=1234.5, steps=12345), PLAIN]))
    text = console.file.getvalue()
    assert max(map(len, text.splitlines())) <= width
    assert "…" not in text
    words = text.split()
    for word in ("12345", "10.00", "24.7", "1234.5", "pitch", "lost", *map(str, range(12)), "(36)"):
        assert word in words


def test_the_names_of_states_are_not_markup():
    columns = ("visits", "dwell_s", "dwell_std_s", "phase", "P(inserted)", "desired_next")
    frame = pd.DataFrame([(2, 0.5, 0.1, 0.0, 0.9, "inserted")], columns=columns)
    graph = SimpleNamespace(to_frame=lambda: frame, reach_=np.array([0.9]))
    skill = SimpleNamespace(graph_=graph, state_names=lambda: ["[/x] free"])
    text = text_of(state_table(skill))
    assert "0 [/x] free 2 0.50 0.00 inserted" in text
    assert "an insertion follows a state with probability 0.90 to 0.90" in text


def test_discovered_states_have_a_table():
    states = summarise_states([labelled([0, 0, 0, 1, 2, 1], WRENCHES), labelled([0, 0, 0, 1], WRENCHES)], 4)
    text = text_of(discovered_table(states))
    assert "0 free 60 1.0 0.30 0.0 0.00 1 (100 %)" in text
    assert "1 8 N along -z 30 1.5 0.10 8.0 0.00 end (67 %), 2 (33 %)" in text
    assert "2 20 N along -z -x, 0.5 N m about +y 10 0.5 0.10 20.0 0.50 1 (100 %)" in text
    assert "3 never the most probable 0 0.0 - - - -" in text
    one_axis = summarise_states([labelled([0, 0], [[2.0]], channels=("fz",))], 1)
    assert "0 fz 2 N 100 1.0 0.20 end (100 %)" in text_of(discovered_table(one_axis))


def test_known_phases_have_a_table_and_their_names_are_not_markup():
    text = text_of(phase_table(PhaseAgreement(("[/x] reach", "press"), np.array([[3, 1], [0, 5]]), 0.875)))
    assert "[/x] reach 75 25 4" in text
    assert "press 0 100 5" in text
    assert "adjusted Rand index 0.88" in text
