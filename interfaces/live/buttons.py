"""The buttons of a live session and their keys."""

from __future__ import annotations

from interfaces.live.controls import LiveControls

START, GOOD, BAD, DISCARD, QUIT = "start (Space)", "keep as good (G)", "keep as bad (B)", "discard (X)", "quit (Q)"
KEYS = {START: "Space", GOOD: "KeyG", BAD: "KeyB", DISCARD: "KeyX", QUIT: "KeyQ"}

# Help for the console: (keys, what they do). On the page the name of each control has its keys.
MOTION_HELP = [
    (["W", "S"], "feed, retract"),
    (["←", "→", "↑", "↓"], "tilt the peg"),
    (["J", "L", "I", "K"], "move sideways"),
]
SESSION_HELP = [
    (["Space"], "start"),
    (["G"], "keep as good"),
    (["B"], "keep as bad"),
    (["X"], "discard"),
    (["Q"], "quit"),
    (["1", "2", "3"], "views"),
]


class Buttons:
    """The buttons of `KEYS`; every click is handled once.

    Args:
        controls: controls of the page, to which the buttons are added.
    """

    def __init__(self, controls: LiveControls) -> None:
        self._controls = controls
        for label, key in KEYS.items():
            controls.AddButton(label, key)
        self._handled = {label: controls.GetButtonClicks(label) for label in KEYS}

    def clicked(self, label: str) -> bool:
        """Whether a button has been clicked since the last call for it."""
        clicks = self._controls.GetButtonClicks(label)
        if clicks == self._handled[label]:
            return False
        self._handled[label] = clicks
        return True

    def any_waiting(self, *labels: str) -> bool:
        """Whether one of the buttons has been clicked; the click still counts for `clicked`."""
        return any(self._controls.GetButtonClicks(label) != self._handled[label] for label in labels)

    def forget_clicks(self, *labels: str) -> None:
        """Ignores all clicks so far: on the given buttons, or on all if none is given."""
        for label in labels or KEYS:
            self.clicked(label)
