"""Errors, plain text and tables on the terminal."""

import io
import os
import signal
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from types import SimpleNamespace

import pandas as pd
import pytest
from rich.console import Console

from skill.data.outcome import Outcome
from skill.practice.paired_comparison import PairedChange
from systems.reports import terminal
from systems.reports.practice_report import change_table
from systems.reports.result_tables import result_table, state_table
from systems.runs.trial_result import TrialResult

RESULT = TrialResult(
    **{"seed": 3, "tilt": (0.01, -0.02), "outcome": Outcome.INSERTED, "time": 2.5, "depth": 0.0247},
    **{"peak_axial_force": 6.0, "peak_lateral_force": 12.0, "peak_moment": 0.1, "penetration": 20e-6},
    **{"steps": 20, "lost_steps": 0, "back_offs": 0, "unknown_time": 0.1, "unsupported_time": 0.0, "states": (0, 1)},
)


def text_of(table):
    console = Console(file=io.StringIO(), width=140)
    console.print(table)
    return " ".join(console.file.getvalue().split())


def raising(error):
    @terminal.report_errors
    def command():
        raise error

    return command


# ------------------------------------------------------------------ errors


@pytest.mark.parametrize(
    ("error", "message"),
    [
        (ValueError("out/[bold]x.npz: [red]not[/red] a skill"), "out/[bold]x.npz: [red]not[/red] a skill"),
        (OSError(28, "No space left", "a[/b].npz"), "[Errno 28] No space left: 'a[/b].npz'"),
        (ValueError("first line\n  second line\n"), "first line second line"),
        (ValueError(), "ValueError"),
        (ValueError(":bug: \\[x]"), ":bug: \\[x]"),
    ],
)
def test_an_error_is_one_line_on_stderr_exactly_as_it_is_written(capsys, error, message):
    with pytest.raises(SystemExit) as ended:
        raising(error)()
    assert ended.value.code == 1
    assert capsys.readouterr() == ("", f"error: {message}\n")


def test_a_long_error_is_not_wrapped(capsys):
    with pytest.raises(SystemExit):
        raising(ValueError("word " * 100))()
    assert len(capsys.readouterr().err.splitlines()) == 1


def test_an_interruption_is_one_line_with_exit_code_130(capsys):
    during_import = ImportError("initialization failed")
    during_import.__cause__ = KeyboardInterrupt()
    for error in (KeyboardInterrupt(), during_import):
        with pytest.raises(SystemExit) as ended:
            raising(error)()
        assert ended.value.code == 130
        assert capsys.readouterr() == ("", "interrupted\n")


def test_sigterm_ends_a_command_as_ctrl_c_does(capsys):
    before = signal.getsignal(signal.SIGTERM)

    @terminal.report_errors
    def command():
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(10)

    with pytest.raises(SystemExit) as ended:
        command()
    assert ended.value.code == 143
    assert capsys.readouterr() == ("", "terminated\n")
    assert signal.getsignal(signal.SIGTERM) is before


def test_a_command_runs_in_another_thread_too():
    with ThreadPoolExecutor(1) as pool:
        assert pool.submit(terminal.report_errors(lambda: 3)).result() == 3


def test_a_missing_package_of_the_simulation_names_the_extra(capsys):
    with pytest.raises(SystemExit) as ended:
        raising(ModuleNotFoundError("no pydrake", name="pydrake.geometry"))()
    assert ended.value.code == 1
    assert "install haptic-skill[sim]" in capsys.readouterr().err


@pytest.mark.parametrize("error", [KeyError("x"), ImportError("x"), ModuleNotFoundError("x", name="numpy")])
def test_a_defect_keeps_its_traceback(error):
    with pytest.raises(type(error)):
        raising(error)()


def test_a_successful_command_returns_its_value():
    assert terminal.report_errors(lambda a, *, b: a + b)(1, b=2) == 3


# -------------------------------------------------------------- plain text


def test_text_is_printed_exactly_as_it_is_written(capsys):
    text = "out/[bold]x.npz :bug: " + "word " * 50 + "."
    terminal.say(text)
    assert capsys.readouterr().out == f"{text}\n"


def test_notes_of_a_progress_bar_are_not_markup(capsys):
    with terminal.progress("[red]title", 1) as advance:
        advance("[bold]note[/x]")
    output = capsys.readouterr().out
    assert "[red]title" in output
    assert "[bold]note[/x]" in output


def test_a_status_text_is_not_markup():
    with terminal.busy("drawing [/x].parquet"):
        pass


# ------------------------------------------------------------------ tables


def test_the_result_table_has_one_row_per_trial_and_a_summary():
    failed = replace(RESULT, seed=4, outcome=Outcome.FAILED, detail="[/x] broke", time=3.5)
    text = text_of(result_table([RESULT, failed]))
    assert "3 +0.6 -1.1 inserted 2.50 24.7 6.0 12.0 20 0 1 (2)" in text
    assert "[/x] broke" in text
    assert "1 of 2 inserted; medians: 3.00 s, peak lateral force 12 N, overlap 20 um" in text


def test_the_names_of_states_are_not_markup():
    columns = ("visits", "dwell_s", "dwell_std_s", "phase", "P(inserted)", "desired_next")
    frame = pd.DataFrame([(2, 0.5, 0.1, 0.0, 0.9, "inserted")], columns=columns)
    skill = SimpleNamespace(graph_=SimpleNamespace(to_frame=lambda: frame), state_names=lambda: ["[/x] free"])
    assert "0 [/x] free 2 0.50 0.00 0.90 inserted" in text_of(state_table(skill))


def test_the_change_table_names_only_changes_that_are_large_and_certain():
    change = PairedChange(before=2.0, after=1.5, change=-0.25, lower=-0.3, upper=-0.1, p_value=0.01)
    changes = {
        "time_s": change,
        "peak_lateral_n": replace(change, upper=0.1),
        "peak_axial_n": replace(change, change=0.25, lower=0.1, upper=0.3),
    }
    text = text_of(change_table(changes, [RESULT], [RESULT]))
    assert "time (s) 2.00 1.50 -25 % -30 to -10 % 0.01" in text
    assert text.endswith("fell by at least 20 %: time; rose by at least 20 %: peak axial force")
    uncertain = {"time_s": replace(change, change=-0.19)}
    assert text_of(change_table(uncertain, [RESULT], [RESULT])).endswith("fell by at least 20 %: nothing")
