"""The command haptic-skill as a whole: help, versions, exit codes, and what it runs without."""

import os
import platform
import sys
import tomllib
from importlib.metadata import version

import pytest
from typer.main import get_command

from haptic_skill import main
from scripts import haptic_skill
from skill.data.rig_run import write_rig_run
from tests.scripts.commands import HAPTIC_SKILL, ROOT, error_line, invoke, run_python
from tests.trajectories import make_rig_run

COMMANDS = {*get_command(haptic_skill.app).commands} - {"export", "import"}

BLOCKED = """
import sys
for name in ("pydrake", "yaml"):
    sys.modules[name] = None
from scripts.haptic_skill import app
try:
    app()
finally:
    print(*{m.split(".")[0] for m, module in sys.modules.items() if module}, file=sys.stderr)
"""


# -------------------------------------------------------------------- help


def test_the_help_lists_every_command_and_that_of_each_says_what_it_writes_with_an_example():
    text = " ".join(invoke("-h").stdout.split())
    for code in ("0 success", "1 error", "2 wrong usage", "130 interrupted", "143 ended"):
        assert code in text
    for name in COMMANDS:
        assert f"{name} " in text
        help_of_command = " ".join(invoke(name, "--help").stdout.split())
        assert "Reads a" in help_of_command or "Reads the" in help_of_command, name
        assert "Writes " in help_of_command, name
        assert f"haptic-skill {name} " in help_of_command.split("For example", 1)[1], name


def test_the_same_option_means_the_same_in_every_command():
    texts = {}
    for name, command in get_command(haptic_skill.app).commands.items():
        for option in command.params:
            texts.setdefault(option.opts[0], {})[name] = option.help
    for flag in ("--seed", "--jobs", "--scenario", "--skill", "--trials", "--good", "--bad"):
        assert len(set(texts[flag].values())) == 1, texts[flag]
    assert set(texts["--seed"]) == {"demo", "record", "train", "correct", "rig", "practise", "states", "twin"}
    assert "trial k of the rig uses seed + k" in texts["--seed"]["rig"]
    for name, text in texts["--out"].items():
        assert text.startswith(("Folder to write into", "File to write", "HTML page to write")), name


def test_no_option_is_required():
    for name, command in get_command(haptic_skill.app).commands.items():
        required = [option.name for option in command.params if option.required]
        expected = {"part": ["peg", "hole"], "scoreboard": ["results"], "states": ["files"], "sweep": ["specification"]}
        assert required == expected.get(name, [])


def test_the_versions_are_printed():
    done = invoke("--version")
    assert done.exit_code == 0
    assert done.stdout.split() == [
        *("haptic-skill", f"{version('haptic-skill')},"),
        *("Python", f"{platform.python_version()},"),
        *("Drake", version("drake")),
    ]


# -------------------------------------------------------------- exit codes


@pytest.mark.parametrize(
    "arguments", [("bogus",), ("record", "--port", 7000), ("rig", "--trials", 0), ("rig", "--x", 3)]
)
def test_wrong_usage_has_exit_code_2(arguments):
    assert invoke(*arguments).exit_code == 2


@pytest.mark.slow
@pytest.mark.parametrize("command", [HAPTIC_SKILL, (ROOT / "haptic_skill.py",)])
def test_a_failed_command_prints_one_line_in_a_separate_process(tmp_path, command):
    done = run_python(*command, "train", "--demonstrations", tmp_path / "nowhere", "--out", tmp_path / "skill.npz")
    assert done.returncode == 1
    assert done.stderr.startswith("error: ")
    assert len(done.stderr.splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


def test_a_bracket_in_a_file_name_is_not_markup(tmp_path):
    assert "[bold]x" in error_line(invoke("rig", "--skill", tmp_path / "[bold]x.npz", "--out", tmp_path / "other"))


# ---------------------------------------------- without Drake, and shadowed


def blocked(*arguments):
    """The command where Drake is not installed, and the names of the packages that it imported."""
    done = run_python("-c", BLOCKED, *arguments)
    *messages, imported = done.stderr.splitlines()
    return done, messages, set(imported.split())


@pytest.mark.slow
def test_a_simulation_without_drake_names_the_extra_to_install():
    done, messages, _ = blocked("record")
    assert done.returncode == 1
    assert len(messages) == 1
    assert messages[0].startswith("error: ")
    assert "install haptic-skill[sim]" in messages[0]


@pytest.mark.slow
def test_help_versions_replay_and_training_need_no_drake(demonstration_folder, tmp_path):
    run_file = tmp_path / "[bold]run.parquet"
    write_rig_run(make_rig_run(), run_file)
    train = ("train", "--demonstrations", demonstration_folder, "--out", tmp_path / "skill.npz")
    for arguments in (("rig", "-h"), ("--version",), ("replay", run_file, "--no-open"), train):
        done, messages, imported = blocked(*arguments)
        assert (done.returncode, messages) == (0, [])
        assert arguments == train or not imported & {"pydrake", "sklearn"}
    assert run_file.with_suffix(".html").is_file()


@pytest.mark.slow
@pytest.mark.parametrize("package", ["models", "scripts"])
def test_a_package_that_shadows_ours_is_one_error_with_both_paths(tmp_path, package):
    (tmp_path / package).mkdir()
    (tmp_path / package / "__init__.py").touch()
    start = f"import sys; sys.path.append({str(ROOT)!r}); import haptic_skill; haptic_skill.main()"
    done = run_python("-c", start, "rig", cwd=tmp_path, PYTHONPATH=str(tmp_path))
    assert done.returncode == 1
    assert len(done.stderr.splitlines()) == 1
    for words in ("error: ", f"another package '{package}'", str(tmp_path / package), str(ROOT / package)):
        assert words in done.stderr


@pytest.mark.parametrize(("given", "expected"), [({"OPENBLAS_NUM_THREADS": "3"}, "3"), ({}, "1")])
def test_a_command_uses_one_thread_for_matrices_unless_told_otherwise(monkeypatch, given, expected):
    monkeypatch.setattr(sys, "argv", ["haptic-skill", "--version"])
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "")
    monkeypatch.delenv("OPENBLAS_NUM_THREADS")
    for name, value in given.items():
        monkeypatch.setenv(name, value)
    with pytest.raises(SystemExit):
        main()
    assert os.environ["OPENBLAS_NUM_THREADS"] == expected


def test_the_installed_command_is_the_one_tested_here():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert project["scripts"] == {"haptic-skill": "haptic_skill:main"}
