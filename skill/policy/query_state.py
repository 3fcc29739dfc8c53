"""The query states in which a policy was stuck, and the file that holds them."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any, Self

from skill.data.files import is_number, one_line, read_bounded

MAX_SIZE = 10_000_000  # bytes of a file


@dataclass(frozen=True)
class QueryState:
    """Where a policy was stuck.

    The rig does not know pivot and friction; the simulation does, and a correction needs them to meet the same contact.

    Attributes:
        trial: number of the practice trial.
        time: s.
        depth: of the tip below the mouth, m.
        tilt: of the peg relative to the hole, about x and y, rad.
        clocking: the same about z, rad.
        load: measured contact load, N.
        state: name of the contact state.
        pivot_height: of the gimbal's axes above the mouth, m.
        friction: coefficient of peg and hole.
    """

    trial: int
    time: float
    depth: float
    tilt: tuple[float, float]
    clocking: float
    load: float
    state: str
    pivot_height: float
    friction: float

    def record(self) -> dict[str, Any]:
        """Returns the fields as JSON values."""
        return asdict(self) | {"tilt": list(self.tilt)}

    @classmethod
    def from_record(cls, record: Any) -> Self:
        """Inverts `record`.

        Raises:
            ValueError: if a field is missing or unknown, of the wrong type, or not finite.
        """
        names = [field.name for field in fields(cls)]
        if not isinstance(record, dict) or sorted(record) != sorted(names):
            found = sorted(record) if isinstance(record, dict) else type(record).__name__
            raise ValueError(f"a query state is {found}, expected an object with {names}")
        tilt = record["tilt"]
        if not (isinstance(tilt, list) and len(tilt) == 2):
            raise ValueError(f"tilt is {tilt!r}, expected two numbers in rad")
        for name, value in (*record.items(), ("tilt", tilt[0]), ("tilt", tilt[1])):
            if name == "state" and not isinstance(value, str):
                raise ValueError(f"state is {value!r}, expected a text")
            if name != "state" and value is not tilt and not (is_number(value) and math.isfinite(value)):
                raise ValueError(f"{name} is {value!r}, expected a finite number in SI units")
        return cls(**record | {"tilt": (float(tilt[0]), float(tilt[1]))})


def read_query_states(path: Path) -> list[QueryState]:
    """Reads a file of `write_json` with the records of query states.

    Raises:
        ValueError: if the file is missing, too large, or holds no or other query states. The message names it.
    """
    try:
        content = json.loads(read_bounded(path, MAX_SIZE))
        if not (isinstance(content, list) and content):
            raise ValueError("expected a list with at least one query state")
        return [QueryState.from_record(record) for record in content]
    except FileNotFoundError:
        raise ValueError(f"{path}: no such file; `haptic-skill correct --ask --json {path}` writes one") from None
    except (OSError, ValueError, RecursionError) as error:
        raise ValueError(f"{path}: no query states of this program ({one_line(error)})") from error
