"""Buttons, sliders and gamepad of the page, with the methods of Drake's Meshcat for them.

Frames from a browser are not trusted: whatever is not a well-formed event of a known control is ignored.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeGuard

import umsgpack

from interfaces.live.messages import Outbox

MAX_FRAME = 4096  # in units of bytes; the largest event, of a gamepad, has a few hundred
MAX_AXES = 32  # axes of a gamepad
UNREADABLE = (umsgpack.UnpackException, OverflowError, RecursionError)  # from a date, and from deep nesting
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

    def set(self, value: float) -> None:
        """Changes the value to the nearest step within the range."""
        self.value = round(min(max(value, self.low), self.high) / self.step) * self.step


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
        self._clicks: dict[str, int] = {}
        self._handled: dict[str, int] = {}
        self._sliders: dict[str, Slider] = {}
        self._gamepad = Gamepad()
        self._gamepad_browser: int | None = None
        self._after_motion: Callable[[], None] = lambda: None

    def call_after_motion(self, callback: Callable[[], None]) -> None:
        """Has a function called after each event of a slider or gamepad, in the thread that receives it."""
        self._after_motion = callback

    def AddButton(self, name: str, keycode: str) -> None:
        """Adds a button and its key."""
        self._clicks[name] = self._handled[name] = 0
        self._show(name, callback=BUTTON % json.dumps(name), keycode1=keycode)

    def GetButtonClicks(self, name: str) -> int:
        """Returns the number of clicks since the button was added."""
        return self._clicks[name]

    def clicked(self, name: str) -> bool:
        """Whether a button has been clicked since the last call for it: every click is handled once."""
        before, self._handled[name] = self._handled[name], self._clicks[name]
        return self._handled[name] != before

    def any_waiting(self, *names: str) -> bool:
        """Whether one of the buttons has been clicked; the click still counts for `clicked`."""
        return any(self._clicks[name] != self._handled[name] for name in names)

    def forget_clicks(self, *names: str) -> None:
        """Ignores all clicks on the buttons so far."""
        for name in names:
            self.clicked(name)

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
        """Moves a slider to the step nearest to ``value``, in all browsers but ``source``."""
        slider = self._sliders[name]
        slider.set(value)
        message = {"type": "set_control_value", "name": name, "value": slider.value, "invoke_callback": False}
        self._outbox.put(("value", name), umsgpack.packb(message), source=source)

    def GetGamepad(self) -> Gamepad:
        """Returns the state of the gamepad."""
        return self._gamepad

    def receive(self, frame: str | bytes, browser: int) -> bool:
        """Handles a frame of a browser; returns whether it was an event of a known control, and ignores it if not."""
        if not isinstance(frame, bytes) or len(frame) > MAX_FRAME:
            return False
        try:
            event = umsgpack.unpackb(frame)
        except UNREADABLE:
            return False
        if not isinstance(event, dict):
            return False
        name, value = event.get("name"), event.get("value")
        match event.get("type"):
            case "button" if isinstance(name, str) and name in self._clicks:
                self._clicks[name] += 1
                return True
            case "slider" if isinstance(name, str) and name in self._sliders and _is_number(value):
                self.SetSliderValue(name, value, source=browser)
                self._sliders[name].moves += 1  # after the value: who sees the move sees the value too
                self._after_motion()
                return True
            case "gamepad":
                return self._receive_gamepad(event.get("gamepad"), browser)
        return False

    def forget(self, browser: int) -> None:
        """Removes the gamepad of a browser that has gone: nobody holds its sticks any more."""
        if self._gamepad_browser == browser:
            self._gamepad, self._gamepad_browser = Gamepad(), None
            self._after_motion()

    def _receive_gamepad(self, pad: Any, browser: int) -> bool:
        if pad == {}:  # disconnected
            self.forget(browser)
            return True
        if not isinstance(pad, dict):
            return False
        index, axes = pad.get("index"), pad.get("axes")
        if type(index) is not int or not isinstance(axes, list) or len(axes) > MAX_AXES:
            return False
        if not all(_is_number(axis) and abs(axis) <= 1.0 for axis in axes):
            return False
        self._gamepad, self._gamepad_browser = Gamepad(index, tuple(float(axis) for axis in axes)), browser
        self._after_motion()
        return True

    def _show(self, name: str, **properties: Any) -> None:
        self._outbox.put(("control", name), umsgpack.packb({"type": "set_control", "name": name, **properties}))


def _is_number(value: Any) -> TypeGuard[float]:
    """Whether a value is a finite number that fits a float."""
    try:
        return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
    except OverflowError:
        return False
