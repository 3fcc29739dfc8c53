from dataclasses import replace
from types import SimpleNamespace

import pandas as pd

from skill.data.outcome import Outcome
from systems.reports.result_tables import result_table, state_table
from tests.systems.reports.tables import text_of
from tests.trial_results import PLAIN


def test_the_result_table_has_one_row_per_trial_and_a_summary():
    first = replace(PLAIN, seed=3, states=(0, 1, 0))
    failed = replace(
        PLAIN, seed=4, outcome=Outcome.FAILED, detail="[/x] broke", time=3.5, peak_lateral_force=20.0, penetration=40e-6
    )
    text = text_of(result_table([first, failed]))
    assert "3 +1.0 -2.0 inserted 2.50 24.7 6.0 12.0 20 0 1 (3)" in text
    assert "[/x] broke" in text
    assert "1 of 2 inserted; medians: 3.00 s, peak lateral force 16 N, overlap 30 um" in text


def test_the_names_of_states_are_not_markup():
    columns = ("visits", "dwell_s", "dwell_std_s", "phase", "P(inserted)", "desired_next")
    frame = pd.DataFrame([(2, 0.5, 0.1, 0.0, 0.9, "inserted")], columns=columns)
    skill = SimpleNamespace(graph_=SimpleNamespace(to_frame=lambda: frame), state_names=lambda: ["[/x] free"])
    assert "0 [/x] free 2 0.50 0.00 0.90 inserted" in text_of(state_table(skill))
