"""Makes pictures of the documentation, each by one command, from what `make demo` leaves in out/, in headless Chromium.

    python -m docs._tools.pictures wedge.webp jam.webp

A film shows replays at a third of their speed, two side by side. Look at a picture before you commit it.
"""

from __future__ import annotations

import io
import json
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from PIL import Image

from interfaces.gym.agents import PolicyAgent
from interfaces.reports.replay_page import write_replay
from skill.data.demonstration import read_demonstration
from skill.manipulation_skill import ManipulationSkill
from tests.browser import open_page

ROOT = Path(__file__).resolve().parents[2]
OUT, PICTURES = ROOT / "out", ROOT / "docs" / "pictures"
SIZE, WIDTH = (960, 820), 640  # of a replay, and of a film, in pixels
RATE, SLOW = 6, 3  # pictures per second; times slower than it was
LARGEST = 400_000  # bytes of a film
NARROW = "for (const part of document.querySelectorAll('#dial-box, #arrows')) part.style.display = 'none'"
"""Hides what has no place where two replays stand side by side."""


def shell(command: str) -> None:
    """Performs a command of Python in the folder of the project."""
    subprocess.run([sys.executable, "-m", *shlex.split(command)], cwd=ROOT, check=True)


def trial(trial_set: str, chosen: Callable[[dict[str, Any]], Any]) -> Path:
    """Returns the first chosen trial of the demo, or of the harder trials, which are performed if need be."""
    folder = OUT / ("rig" if trial_set == "usual" else trial_set)
    if not folder.exists():
        shell(f"haptic_skill rig --trials 20 --trials-of {trial_set} --out {shlex.quote(str(folder))}")
    results = json.loads((folder / "results.json").read_text())
    return folder / f"run_{next(number for number, result in enumerate(results) if chosen(result)):04d}.parquet"


def smooth(result: dict[str, Any]) -> bool:
    """Whether a trial is inserted without a back-off."""
    return result["inserted"] and not result["back_offs"]


def jammed() -> Path:
    """The first demonstration that ends jammed."""
    paths = sorted((OUT / "demonstrations").glob("*.parquet"))
    return next(path for path in paths if read_demonstration(path).outcome == "jammed")


def film(name: str, shown: Callable[[], dict[str, Path]], *, end: float | None = None, skill: bool = False) -> None:
    """Writes a film of recordings, by their titles; a skill names the contact states of demonstrations."""
    films, titles = [], shown()
    narrow = len(titles) > 1
    with tempfile.TemporaryDirectory() as folder:
        page_file = Path(folder) / "replay.html"
        for title, recording in titles.items():
            made = write_replay(recording, page_file, title=title, skill=OUT / "skill.npz" if skill else None)
            with open_page(page_file, size=(SIZE[0] // 2, SIZE[1]) if narrow else SIZE) as page:
                page.wait("window.replay && window.replay.ready")
                if narrow:
                    page.run(NARROW)
                films.append([])
                for moment in np.arange(0.0, end or made.time[-1], 1 / RATE / SLOW).tolist():
                    page.run("window.replay.pause(); window.replay.seek(arguments[0])", moment)
                    time.sleep(0.1)  # until it is drawn
                    films[-1].append(Image.fromarray(page.screenshot()))
    longest = max(map(len, films))  # the last picture of a shorter film stays
    films = [[*pictures, *[pictures[-1]] * (longest - len(pictures))] for pictures in films]
    pictures = [reduced(*side_by_side) for side_by_side in zip(*films, strict=True)]
    write(PICTURES / f"{name}.webp", pictures, [1000 // RATE] * len(pictures))


def reduced(*pictures: Image.Image) -> Image.Image:
    """Returns pictures side by side as one, ``WIDTH`` pixels wide."""
    together = Image.fromarray(np.hstack([np.asarray(picture) for picture in pictures]))
    return together.resize((WIDTH, round(WIDTH * together.height / together.width)), Image.Resampling.LANCZOS)


def write(path: Path, shown: Sequence[Image.Image], times: Sequence[int]) -> None:
    """Writes a film that repeats: pictures and their times, ms; the last one stays for two seconds."""
    first, *others = shown
    durations = [*times[:-1], 2000]
    for quality in (40, 25, 15):
        file = io.BytesIO()
        first.save(file, "webp", save_all=True, append_images=others, duration=durations, loop=0, quality=quality)
        if file.tell() < LARGEST:
            break
    path.write_bytes(file.getvalue())


def rendered() -> None:
    """Draws the environment of Gymnasium as `render()` returns it, when a skill has inserted half of the peg."""
    policy = ManipulationSkill.load(ROOT / "skill" / "default_skill.npz")
    env = gymnasium.make("interfaces.gym:PegInHole-v0", engine="exact", policy=policy, render_mode="rgb_array")
    agent, (observation, _) = PolicyAgent(policy), env.reset(options={"trial": 0})
    while observation["depth"][0] < 0.012:
        observation, *_ = env.step(agent.act(observation))
    Image.fromarray(env.render()).save(PICTURES / "gymnasium.png")


DIAGRAMS = "haptic_skill diagram --out docs/pictures"

COMMANDS: dict[str, Callable[[], object]] = {
    "insertion.webp": partial(film, "insertion", lambda: {"insertion": trial("usual", smooth)}),
    "jam.webp": partial(film, "jam", lambda: {"a jam: pushed without levelling": jammed()}, end=1.8, skill=True),
    "wedge.webp": partial(
        film,
        "wedge",
        lambda: {"a wedge: two contacts squeeze the peg": trial("hard", lambda result: result["wedged_s"] > 1.0)},
        end=2.4,
    ),
    "stress.webp": partial(
        film,
        "stress",
        lambda: {"a usual trial": trial("usual", smooth), "a harder trial": trial("hard", smooth)},
    ),
    "correction.webp": partial(
        film,
        "correction",
        lambda: {"a correction: shown where the skill was stuck": min((OUT / "corrections").rglob("*.parquet"))},
        skill=True,
    ),
    "insertion.png": partial(shutil.copy, OUT / "fig5_insertion.png", PICTURES / "insertion.png"),
    "demonstrations.png": partial(shutil.copy, OUT / "demonstrations" / "demonstrations.png", PICTURES),
    "gymnasium.png": rendered,
    **{name: partial(shell, DIAGRAMS) for name in ("virtual_environment.svg", "rig.svg")},
}
"""What makes each picture."""

KEPT = {"two_point_depth.svg", "jamming.svg", "wedging.svg", "force_balance.svg"}
KEPT |= {f"first_hour_{part}.webp" for part in ("show", "ask", "rig")}
"""Pictures that are kept: `docs/physics.md` and `docs/first_hour.md` name the commits that draw them."""

if __name__ == "__main__":
    for chosen in sys.argv[1:]:
        COMMANDS[chosen]()
