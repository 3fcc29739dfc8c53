"""What the commands share: options, so that a flag means the same in each of them, and the skill that acts unasked.

A command imports what it needs when it runs. So help and `replay` start quickly, and work where Drake is not installed.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

if TYPE_CHECKING:
    from models.scenario import Scenario

MAX_SEED = 2**32 - 1  # the largest that NumPy and scikit-learn accept everywhere
MAX_TRIALS = 100_000


def parse_text(text: str) -> str:
    """Refuses the value of an option that is not valid UTF-8: it could not be stored with the results."""
    try:
        text.encode()
    except UnicodeEncodeError:
        raise typer.BadParameter(f"{text!a} is not valid UTF-8; choose another name") from None
    return text


def parse_path(text: str | Path) -> Path:
    """Converts the value of an option to a path; an empty one would mean the current folder, and is refused."""
    if not str(text):
        raise typer.BadParameter("an empty path; expected the name of a file or folder")
    return Path(parse_text(str(text)))


def path_option(metavar: str, text: str, *, shown: str | bool = True) -> Any:
    """An option with a path and the help ``text``, which names ``shown`` as the default."""
    return typer.Option(parser=parse_path, metavar=metavar, help=text, show_default=shown)


def text_option(metavar: str, text: str, *, shown: str | bool = True) -> Any:
    """An option with a text; see `path_option`."""
    return typer.Option(parser=parse_text, metavar=metavar, help=text, show_default=shown)


SCENARIO = typer.Option(
    "--scenario",
    parser=parse_text,
    metavar="TEXT",
    help="Name of a scenario in models/scenarios, or path of a YAML file.",
)
SKILL_HELP = "Skill to read, a file that `haptic-skill train` wrote."
SKILL = typer.Option("--skill", parser=parse_path, metavar="FILE.npz", help=SKILL_HELP)
TRAINED = Path("out/skill.npz")
"""Where `haptic-skill train` and `haptic-skill demo` write the skill."""

SHIPPED = Path(__file__).resolve().parents[1] / "skill" / "default_skill.npz"
"""The skill that comes with the program, so that it acts before anything is trained."""

DEFAULT_SKILL = f"{TRAINED}, or the one that comes with the program"
SEED_HELP = "Seeds the random draws; trial k of the rig uses seed + k."
GOOD_HELP = "Number of good demonstrations: they insert gently."

Seed = Annotated[int, typer.Option("--seed", min=0, max=MAX_SEED, help=SEED_HELP)]
Verbose = Annotated[
    bool, typer.Option("--verbose", "-v", help="Print the stability margins and every table, not only the outcome.")
]
Jobs = Annotated[int, typer.Option("--jobs", min=1, max=256, help="Number of processes.")]
ScenarioName = Annotated[str, SCENARIO]
Engine = Annotated[
    Literal["drake", "exact"] | None,
    typer.Option(help="Contact: Drake's meshes or rigid bodies.", show_default="from the scenario"),
]
OptionalScenarioName = Annotated[str | None, SCENARIO]
SkillFile = Annotated[Path, SKILL]
OptionalSkillFile = Annotated[Path | None, SKILL]
DefaultSkillFile = Annotated[
    Path | None,
    typer.Option("--skill", parser=parse_path, metavar="FILE.npz", help=SKILL_HELP, show_default=DEFAULT_SKILL),
]
OutFolder = Annotated[Path, typer.Option("--out", parser=parse_path, metavar="FOLDER", help="Folder to write into.")]
OptionalOutFolder = Annotated[
    Path | None,
    typer.Option(
        "--out",
        parser=parse_path,
        metavar="FOLDER",
        help="Folder to write into.",
        show_default="out/demonstrations, with --live out/live",
    ),
]
OutFile = Annotated[
    Path, typer.Option("--out", parser=parse_path, metavar="FILE", help="File to write; replaces an existing file.")
]
Good = Annotated[int, typer.Option("--good", min=0, help=GOOD_HELP)]
OneOrMoreGood = Annotated[int, typer.Option("--good", min=1, help=GOOD_HELP)]
Bad = Annotated[
    int, typer.Option("--bad", min=0, help="Number of bad demonstrations: they jam, slam, give up or over-correct.")
]
Overwrite = Annotated[
    bool,
    typer.Option("--overwrite", help="Replace what this program wrote into the folder of --out, once all is complete."),
]
Trials = Annotated[int, typer.Option("--trials", min=1, max=MAX_TRIALS, help="Number of insertions on the rig.")]
Driver = Annotated[
    str | None, typer.Option(help="With --live: 'inverse3', 'spacemouse' or your device driver (see docs/haptics.md).")
]
Host = Annotated[
    str | None,
    typer.Option(help="With --live: address at which the page listens.", show_default="127.0.0.1: this machine"),
]
Port = Annotated[
    int | None, typer.Option(min=1, max=65535, help="With --live: port of the page.", show_default="a free one")
]


def counted(number: int, noun: str) -> str:
    """Returns a number with its noun, in the plural if need be."""
    return f"{number} {noun}{'' if number == 1 else 's'}"


def trial_numbers(first: int, count: int, option: str = "--seed") -> range:
    """Returns the numbers of trials, each of which `haptic-skill rig --seed` can repeat; ``option`` gave the first."""
    if first + count - 1 > MAX_SEED:
        raise typer.BadParameter(
            f"{option}: trials {first} to {first + count - 1}, expected numbers up to {MAX_SEED}, the largest seed"
        )
    return range(first, first + count)


def read_scenario(name: str, engine: str | None = None, *, defaults: Scenario | None = None) -> Scenario:
    """Reads the scenario of a command; says what of it follows the geometry, and why its peg may not be inserted.

    Raises:
        ValueError: see `models.scenario.load_scenario`.
        OSError: if the file cannot be read.
    """
    from interfaces.terminal import say
    from models.clearance import doubts, followed
    from models.scenario import Scenario, load_scenario

    scenario = load_scenario(name, engine, defaults=defaults)
    chosen = followed(scenario, defaults or Scenario())
    if chosen:
        say(f"follows the geometry (SI units): {chosen}")
    for doubt in doubts(scenario):
        say(f"this peg may not be inserted: {doubt}")
    return scenario


def find_skill(given: Path | None) -> Path:
    """Returns the file of the given skill; without one that of ``TRAINED``, else the one that ``SHIPPED`` names.

    Raises:
        FileNotFoundError: if no skill is given, and there is neither.
    """
    from interfaces.terminal import say

    if given is not None:
        return given
    if TRAINED.is_file():
        return TRAINED
    if not SHIPPED.is_file():
        raise FileNotFoundError(
            f"{TRAINED}: there is no such file; make one with `haptic-skill demo`, or name a --skill"
        )
    say(f"there is no {TRAINED}: the skill that comes with the program acts, {SHIPPED}")
    return SHIPPED
