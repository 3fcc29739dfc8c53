"""Buttons, sliders and gamepad of the page, with the methods of Drake's Meshcat for them.

What is not a well-formed event of a known control is ignored: a frame of a browser neither stops nor moves anything
that the page has no control for.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import umsgpack

from interfaces.live.messages import Outbox

JUNK = (umsgpack.UnpackException, LookupError, TypeError, ValueError, ArithmeticError, RecursionError)
"""Errors from a frame that is no event of a known control."""

# What the page sends; Drake's page evaluates these functions in the browser.
BUTTON = "() => this.connection.send(msgpack.encode({'type': 'button', 'name': %s}))"
SLIDER = "value => this.connection.send(msgpack.encode({'type': 'slider', 'name': %s, 'value': value}))"


@dataclass
class Slider:
    """Range, step and value of a slider, and how often a person has moved it."""

    low: float
    high: float
    step: float
    value: float
    moves: int = 0


@dataclass(frozen=True)
class Gamepad:
    """State of a gamepad; no gamepad has no axes.

    Attributes:
        index: number of the gamepad in the browser.
        axes: deflection of each axis, from -1 to 1.
    """

    index: int | None = None
    axes: tuple[float, ...] = ()


class LiveControls:
    """The controls of the page. The names of the methods are those of Drake's Meshcat.

    Args:
        outbox: receives the messages that show the controls in the browser.
    """

    def __init__(self, outbox: Outbox) -> None:
        self._outbox = outbox
        self._buttons: set[str] = set()
        self._clicked: set[str] = set()  # the buttons with a click that has not been handled
        self._sliders: dict[str, Slider] = {}
        self._gamepad = Gamepad()
        self._gamepad_browser: int | None = None
        self._after_motion: Callable[[], None] = lambda: None

    def call_after_motion(self, callback: Callable[[], None]) -> None:
        """Has a function called after each event of a slider or gamepad, in the thread that receives it."""
        self._after_motion = callback

    def AddButton(self, name: str, keycode: str) -> None:
        """Adds a button and its key."""
        self._buttons.add(name)
        self._show(name, callback=BUTTON % json.dumps(name), keycode1=keycode)

    def clicked(self, name: str) -> bool:
        """Whether a button has been clicked since the last call for it."""
        is_clicked = name in self._clicked
        self._clicked.discard(name)
        return is_clicked

    def any_waiting(self, *names: str) -> bool:
        """Whether one of the buttons has been clicked; the click still counts for `clicked`."""
        return not self._clicked.isdisjoint(names)

    def forget_clicks(self, *names: str) -> None:
        """Ignores all clicks on the buttons so far."""
        self._clicked.difference_update(names)

    def AddSlider(
        self, name: str, low: float, high: float, step: float, value: float, decrement_key: str, increment_key: str
    ) -> None:
        """Adds a slider and its keys."""
        self._sliders[name] = Slider(low, high, step, value)
        limits = {"min": low, "max": high, "step": step, "value": value}
        self._show(name, callback=SLIDER % json.dumps(name), keycode1=decrement_key, keycode2=increment_key, **limits)

    def GetSliderValue(self, name: str) -> float:
        """Returns the value of a slider."""
        return self._sliders[name].value

    def slider_moves(self, name: str) -> int:
        """Returns how often a person has moved a slider; `SetSliderValue` does not count."""
        return self._sliders[name].moves

    def SetSliderValue(self, name: str, value: float, *, source: int | None = None) -> None:
        """Moves a slider to the step nearest to ``value`` within its range, in all browsers but ``source``."""
        slider = self._sliders[name]
        slider.value = round(min(max(value, slider.low), slider.high) / slider.step) * slider.step
        message = {"type": "set_control_value", "name": name, "value": slider.value, "invoke_callback": False}
        self._outbox.put(("value", name), umsgpack.packb(message), source=source)

    def GetGamepad(self) -> Gamepad:
        """Returns the state of the gamepad."""
        return self._gamepad

    def receive(self, frame: str | bytes, browser: int) -> None:
        """Handles a frame of a browser if it is an event of a known control."""
        try:
            is_motion = self._take(umsgpack.unpackb(frame), browser)
        except JUNK:
            return
        if is_motion:
            self._after_motion()

    def forget(self, browser: int) -> None:
        """Removes the gamepad of a browser that has gone: nobody holds its sticks any more."""
        if self._gamepad_browser == browser:
            self._gamepad, self._gamepad_browser = Gamepad(), None
            self._after_motion()

    def _take(self, event: dict[str, Any], browser: int) -> bool:
        """Takes an event of the page; returns whether it is a motion. One of `JUNK` is raised if it is no event."""
        match event["type"]:
            case "button" if event["name"] in self._buttons:
                self._clicked.add(event["name"])
            case "slider" if math.isfinite(event["value"]):
                self.SetSliderValue(event["name"], event["value"], source=browser)
                self._sliders[event["name"]].moves += 1  # after the value: who sees the move sees the value too
                return True
            case "gamepad" if event["gamepad"] == {}:  # disconnected
                self.forget(browser)
            case "gamepad" if all(abs(axis) <= 1.0 for axis in event["gamepad"]["axes"]):
                pad = event["gamepad"]
                self._gamepad = Gamepad(int(pad["index"]), tuple(float(axis) for axis in pad["axes"]))
                self._gamepad_browser = browser
                return True
        return False

    def _show(self, name: str, **properties: Any) -> None:
        self._outbox.put(("control", name), umsgpack.packb({"type": "set_control", "name": name, **properties}))
