"""A live session as a person has it: scripted hands give ten demonstrations in a headless Chromium, with interruptions.

    python -m benchmarks.haptics.live_session [--number 10] [--json FILE]

The script starts the real command, opens its page, presses the keys of the page and looks only at what the page shows:
it levels the peg by the dial, feeds it, and retracts it a little where the contact load is high. For each
demonstration it reports how it ended, its duration, the simulated over the wall-clock time, late ticks of the servo and
late contact steps of all, pictures a second, and the memory of the session and of the servo. Then, each in the middle
of a demonstration:

* the tab is closed: the session waits, and a new tab goes on;
* session and servo stand still for three seconds (SIGSTOP, SIGCONT), as on a machine that sleeps;
* the servo is killed: the demonstration is discarded, and the next one has a new servo.

At the end all recordings are read again. Linux only: memory and processes come from /proc.

Keys of the file: ``demonstrations``, a list with the columns of the table; ``inserted``, ``seconds_median``,
``rate_median``, ``late_share``, ``late_steps_share``, ``pictures_median``, ``memory_growth_mb`` (of session and servo,
from the second to the last demonstration), ``interruptions`` (what the session said to each), ``kept``, ``readable``.
"""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from statistics import median
from typing import Any

from benchmarks.extras import require_packages

if __name__ == "__main__":
    require_packages("pydrake", "yaml")

from benchmarks.command_line import argument_parser, run
from benchmarks.haptics.headless_browser import headless_browser
from interfaces.reports.result_tables import plain_table
from interfaces.terminal import console, progress, write_json
from models.scenario import load_scenario
from skill.data.demonstration import read_demonstration

LOOK_PERIOD = 0.08
"""Time between two looks of the person at the page, s."""

LEVEL = 0.12  # degrees that the person takes for level
HIGH_LOAD = 12.0  # N of contact load at which the person stops to feed, and retracts
LONGEST = 90.0  # s; then the person gives up
SLEEP = 3.0  # s
CONTACT_STEP = load_scenario("live").contact.time_step
KEPT = r"kept [0-9]+_\w+"

CONNECTED = "return typeof livePanel === 'object' && viewer.connection?.readyState === 1"
STATE = """
  const text = id => document.getElementById(id).textContent, tilt = document.getElementById("tilt");
  return {right: tilt.getAttribute("x2") / 10, away: -tilt.getAttribute("y2") / 10, status: text("status"),
    depth: parseFloat(text("depth")), load: parseFloat(text("contact-load")),
    deadlines: (text("deadlines").match(/[0-9]+/g) || []).map(Number),
    drawn: viewer.renderer.info.render.frame, now: performance.now() / 1000};
"""


class Session:
    """The command in a process of its own, and the page in a browser."""

    def __init__(self, process: subprocess.Popen[bytes], log: Path) -> None:
        self.process, self._log = process, log
        self.driver: Any = None

    def wait_for(self, pattern: str, *, count: int = 1, timeout: float = 60.0) -> str:
        """Waits until the command has printed a pattern so many times; returns the last match.

        Raises:
            RuntimeError: if it does not.
        """
        end = time.monotonic() + timeout
        while time.monotonic() < end:
            found = re.findall(pattern, self._log.read_text())
            if len(found) >= count:
                return str(found[-1])
            time.sleep(0.02)
        raise RuntimeError(f"'{pattern}' was not printed in {timeout:.0f} s:\n{self._log.read_text()}")

    def printed(self, pattern: str) -> int:
        """How often the command has printed a pattern."""
        return len(re.findall(pattern, self._log.read_text()))

    def press(self, keys: str) -> None:
        """Presses keys one after another."""
        from selenium.webdriver.common.action_chains import ActionChains

        ActionChains(self.driver).send_keys(keys).perform()

    def state(self) -> dict[str, Any]:
        """What the page shows."""
        return dict(self.driver.execute_script(STATE))

    def servo(self) -> int:
        """Process number of the servo: the child that ticks, and not the one that tracks shared memory."""
        for path in Path("/proc").glob("[0-9]*"):
            try:
                parent = int((path / "stat").read_text().rsplit(")", 1)[1].split()[1])
                command = (path / "cmdline").read_text()
            except OSError:  # it has ended
                continue
            if parent == self.process.pid and "spawn_main" in command:
                return int(path.name)
        raise RuntimeError("the session has no servo")

    def memory(self) -> float:
        """Memory of the session and of the servo, MB."""
        pids = (self.process.pid, self.servo())
        texts = [Path(f"/proc/{pid}/status").read_text() for pid in pids]
        return sum(int(re.findall(r"VmRSS:\s+(\d+)", text)[0]) for text in texts) / 1024.0

    def start(self) -> None:
        """Starts a demonstration."""
        before = self.printed("recording: ")
        self.press(" ")
        self.wait_for("recording: ", count=before + 1)

    def insert(self) -> dict[str, Any]:
        """Inserts the peg of the demonstration that has begun, by what the page shows; returns the last state."""
        from selenium.webdriver.common.keys import Keys

        end = time.monotonic() + LONGEST
        while True:
            seen = self.state()
            if "G keep as good" in seen["status"] and not seen["status"].startswith("recording"):
                return seen
            if time.monotonic() > end:
                return seen  # the verdict ends it
            keys = ""
            for tilt, less, more in (
                (seen["right"], Keys.ARROW_LEFT, Keys.ARROW_RIGHT),
                (seen["away"], Keys.ARROW_DOWN, Keys.ARROW_UP),
            ):
                keys += (less if tilt > 0 else more) * min(3, int(abs(tilt) / LEVEL))
            if seen["load"] > HIGH_LOAD:
                keys += "s"
            elif not keys or seen["depth"] < 0.0:
                keys += "w"
            self.press(keys)
            time.sleep(LOOK_PERIOD)

    def keep(self, seen: dict[str, Any]) -> None:
        """Keeps the demonstration that has ended so: as good if the peg was inserted."""
        before = self.printed(KEPT)
        self.press("g" if seen["status"].startswith("inserted") else "b")
        self.wait_for(KEPT, count=before + 1)

    def demonstrate(self) -> dict[str, Any]:
        """Performs and keeps one demonstration; returns a row of the table."""
        self.start()
        began, before = time.monotonic(), self.state()
        seen = self.insert()
        seconds = time.monotonic() - began
        pictures = (seen["drawn"] - before["drawn"]) / (seen["now"] - before["now"])
        self.keep(seen)
        late_steps, steps, late_ticks, ticks = seen["deadlines"]
        return {
            **{"ending": seen["status"].split(":")[0], "seconds": seconds, "rate": steps * CONTACT_STEP / seconds},
            **{"late_ticks": late_ticks, "ticks": ticks, "late_steps": late_steps, "steps": steps},
            **{"pictures": pictures, "memory_mb": self.memory()},
        }


@contextmanager
def live_session(folder: Path) -> Iterator[Session]:
    """Runs the command in a folder."""
    log = folder / "log.txt"
    command = [sys.executable, "-m", "scripts.record", "--live", "--out", str(folder / "out")]
    environment = {key: value for key, value in os.environ.items() if key not in ("DISPLAY", "WAYLAND_DISPLAY")}
    with log.open("wb") as stream:
        process = subprocess.Popen(
            command, stdout=stream, stderr=subprocess.STDOUT, env={**environment, "PYTHONUNBUFFERED": "1"}
        )
    try:
        yield Session(process, log)
    finally:
        process.kill()
        process.wait()


def interruptions(session: Session, address: str) -> dict[str, str]:
    """What the session said to each interruption; after each it goes on, with a demonstration that is kept."""
    found = {}
    session.start()
    session.press("www")
    session.driver.get("about:blank")
    found["tab closed"] = session.wait_for("the page was closed: .*")
    open_page(session, address)
    session.start()
    session.press("www")
    pids = (session.process.pid, session.servo())
    for pid in pids:
        os.kill(pid, signal.SIGSTOP)
    time.sleep(SLEEP)
    for pid in reversed(pids):
        os.kill(pid, signal.SIGCONT)
    seen = session.insert()
    session.keep(seen)
    found["stood still for 3 s"] = seen["status"]
    session.start()
    session.press("www")
    os.kill(session.servo(), signal.SIGKILL)
    found["servo killed"] = session.wait_for("device lost .*")
    session.start()
    seen = session.insert()
    session.keep(seen)
    found["next demonstration"] = seen["status"]
    return found


def open_page(session: Session, address: str) -> None:
    """Opens the page and waits until it is connected."""
    session.driver.get(address)
    end = time.monotonic() + 30.0
    while not session.driver.execute_script(CONNECTED):
        if time.monotonic() > end:
            raise RuntimeError("the page does not connect")
        time.sleep(0.1)
    time.sleep(1.0)


def main() -> None:
    parser = argument_parser(__doc__)
    parser.add_argument("--number", type=int, default=10, help="demonstrations (default: 10)")
    arguments = parser.parse_args()
    if arguments.number < 3:
        raise ValueError(f"--number is {arguments.number}, expected at least 3")
    with tempfile.TemporaryDirectory() as name, live_session(Path(name)) as session:
        address = session.wait_for(r"open (http\S+) in a browser")
        with headless_browser(address) as session.driver:
            open_page(session, address)
            session.wait_for("ready: press Space")
            rows = []
            with progress("demonstrations", arguments.number) as advance:
                for _ in range(arguments.number):
                    rows.append(session.demonstrate())
                    advance(rows[-1]["ending"])
            said = interruptions(session, address)
            kept = session.printed(KEPT)
            session.press("q")
            session.process.wait(30.0)
        paths = sorted((Path(name) / "out").glob("*.parquet"))
        readable = sum(len(read_demonstration(path).samples) > 1 for path in paths)
    results = summary(rows, said) | {"kept": kept, "readable": readable}
    show(results)
    if arguments.json is not None:
        write_json(arguments.json, results)


def summary(rows: list[dict[str, Any]], said: dict[str, str]) -> dict[str, Any]:
    """The figures over all demonstrations."""
    total = {key: sum(row[key] for row in rows) for key in ("late_ticks", "ticks", "late_steps", "steps")}
    return {
        **{"demonstrations": rows, "inserted": sum(row["ending"] == "inserted" for row in rows)},
        **{f"{key}_median": median(row[key] for row in rows) for key in ("seconds", "rate", "pictures")},
        **{
            "late_share": total["late_ticks"] / total["ticks"],
            "late_steps_share": total["late_steps"] / total["steps"],
        },
        **{"memory_growth_mb": rows[-1]["memory_mb"] - rows[1]["memory_mb"], "interruptions": said},
    }


def show(results: dict[str, Any]) -> None:
    """Prints the results."""
    table = plain_table("demonstrations in a browser")
    for title in ("ending", "time, s", "rate", "late ticks", "late contact steps", "pictures/s", "memory, MB"):
        table.add_column(title, justify="left" if title == "ending" else "right")
    for row in results["demonstrations"]:
        late = [f"{row[f'late_{key}']} of {row[key]}" for key in ("ticks", "steps")]
        cells = [f"{row['seconds']:.1f}", f"{100 * row['rate']:.0f} %", *late, f"{row['pictures']:.0f}"]
        table.add_row(row["ending"], *cells, f"{row['memory_mb']:.0f}")
    console.print(table)
    for event, answer in results["interruptions"].items():
        console.print(f"{event}: {answer}", markup=False)
    console.print(
        f"late ticks {100 * results['late_share']:.2f} %, memory grew by {results['memory_growth_mb']:.1f} MB,"
        f" {results['kept']} recordings kept, {results['readable']} of them readable",
        markup=False,
    )


if __name__ == "__main__":
    run(main)
