"""Errors and plain text on the terminal."""

import json
import os
import signal
import time
import warnings

import pytest

from interfaces import terminal


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


def test_control_characters_are_printed_as_escape_sequences(capsys):
    with pytest.raises(SystemExit):
        raising(ValueError("a\x1b[2J\r\x9bb\u202e\udcff: no [file] \nin größe"))()
    assert capsys.readouterr().err == "error: a\\x1b[2J\\r\\x9bb\\u202e\\udcff: no [file] in größe\n"
    words = "word " * 50
    terminal.say(f"a\nb\x1b[1m: 3 runs, 5 °, [bold]x.npz :bug: {words}.")
    assert capsys.readouterr().out == f"a\\nb\\x1b[1m: 3 runs, 5 °, [bold]x.npz :bug: {words}.\n"


def test_a_warning_is_one_line_on_stderr_without_the_code_that_issued_it(capsys):
    @terminal.report_errors
    def command():
        warnings.warn("groups contains\n  [one] demonstration", UserWarning, stacklevel=1)

    shown = warnings.showwarning
    command()
    assert capsys.readouterr() == ("", "warning: groups contains [one] demonstration\n")
    assert warnings.showwarning is shown


def test_an_interruption_is_one_line_with_exit_code_130(capsys):
    during_import = ImportError("initialization failed")
    during_import.__cause__ = KeyboardInterrupt()
    in_compiled_code = SystemError("returned a result with an exception set")
    in_compiled_code.__cause__ = SystemError("the same, one call deeper")
    in_compiled_code.__cause__.__cause__ = KeyboardInterrupt()
    for error in (KeyboardInterrupt(), during_import, in_compiled_code):
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


@pytest.mark.parametrize(("error", "code"), [(KeyboardInterrupt, 130), (terminal.Terminated, 143)])
def test_an_interruption_in_a_destructor_is_not_lost(error, code):
    class Fragile:
        def __del__(self):
            raise error

    @terminal.report_errors
    def command():
        Fragile()
        time.sleep(10)

    with pytest.raises(SystemExit) as ended:
        command()
    assert ended.value.code == code


@pytest.mark.parametrize(
    ("package", "extra"), [("pydrake.geometry", "sim"), ("pyarrow", "data"), ("mcap", "recordings")]
)
def test_a_missing_package_names_its_extra(capsys, package, extra):
    with pytest.raises(SystemExit) as ended:
        raising(ModuleNotFoundError(f"no {package}", name=package))()
    assert ended.value.code == 1
    assert f"install haptic-skill[{extra}]" in capsys.readouterr().err


@pytest.mark.parametrize("error", [KeyError("x"), ImportError("x"), ModuleNotFoundError("x", name="numpy")])
def test_a_defect_keeps_its_traceback(error):
    with pytest.raises(type(error)):
        raising(error)()


# --------------------------------------------------------- text and files


def test_notes_of_a_progress_bar_are_not_markup(capsys):
    with terminal.progress("[red]title", 1) as advance:
        advance("[bold]note[/x]")
    output = capsys.readouterr().out
    assert "[red]title" in output
    assert "[bold]note[/x]" in output


def test_a_value_that_json_cannot_hold_leaves_the_old_file(tmp_path):
    path = tmp_path / "new" / "results.json"
    terminal.write_json(path, {"a": [1, 2.5, None]})
    with pytest.raises(TypeError):
        terminal.write_json(path, object())
    assert json.loads(path.read_text()) == {"a": [1, 2.5, None]}
    assert path.read_text().endswith("}\n")
