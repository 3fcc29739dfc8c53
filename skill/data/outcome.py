"""How a demonstration or a rig trial ended."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class Outcome(StrEnum):
    """How a demonstration or a rig trial ended; the value is what files and tables show."""

    INSERTED = "inserted"
    INSERTED_ROUGHLY = "inserted roughly"
    JAMMED = "jammed"
    TIME_OVER = "time over"
    GIVEN_UP = "given up"
    STOPPED = "stopped"
    FAULT = "fault"
    DIVERGED = "diverged"
    FAILED = "failed"
    OTHER = "other"

    def text(self, detail: str = "") -> str:
        """The outcome with its detail, as files store it; a fault and a foreign outcome show their detail alone."""
        if self in (Outcome.FAULT, Outcome.OTHER) and detail:
            return detail
        return f"{self}: {detail}" if detail else str(self)


@dataclass(frozen=True)
class Ending:
    """How a run ended: its outcome, and what the outcome alone does not say."""

    outcome: Outcome
    detail: str = ""


def parse_outcome(text: str) -> tuple[Outcome, str]:
    """Outcome and detail of a stored text; a text of another program is `Outcome.OTHER` with itself as the detail."""
    kind, _, detail = text.partition(": ")
    try:
        return Outcome(kind), detail
    except ValueError:
        return Outcome.OTHER, text
