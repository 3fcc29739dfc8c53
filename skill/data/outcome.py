"""How a demonstration or a rig trial ended."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class Outcome(StrEnum):
    """How a demonstration or a rig trial ended; files and tables show the value.

    A peg is inserted when its tip is as deep as `models.scenario.Scenario.full_depth`.
    """

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
        """Outcome and detail as files store them; `FAULT` and `OTHER` show only their detail, if there is one."""
        if self in (Outcome.FAULT, Outcome.OTHER) and detail:
            return detail
        return f"{self}: {detail}" if detail else str(self)


UNPHYSICAL = (Outcome.DIVERGED, Outcome.FAILED)
"""Outcomes of simulations that broke down: their last samples may hold anything."""


@dataclass(frozen=True)
class Ending:
    """How a run ended.

    Attributes:
        outcome: kind of ending.
        detail: additional text, such as an error message.
    """

    outcome: Outcome
    detail: str = ""


def parse_outcome(text: str) -> tuple[Outcome, str]:
    """Returns outcome and detail of a stored text; a text of another program is `OTHER` with the text as detail."""
    kind, _, detail = text.partition(": ")
    try:
        return Outcome(kind), detail
    except ValueError:
        return Outcome.OTHER, text
