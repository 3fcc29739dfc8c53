"""A person of the tests, who shows with the keys of a live page what a skill asks for."""

import time

from selenium.webdriver.common.action_chains import ActionChains

from tests.interfaces.live.live_session import text_of, wait_for_text

STEP = 0.1  # of a press of an arrow, degrees
TOUCH, GENTLE, ROUGH = 1.0, 6.0, 15.0  # contact load that is a touch, that is held, and that is too much, N
FASTEST = 3  # presses of an arrow in a tenth of a second
DEADLINE = 150.0  # in units of s, for a demonstration; a busy machine is slower than real time


def tap(page, keys):
    """Presses keys one after another, as fast as the browser takes them."""
    ActionChains(page.driver).send_keys(keys).perform()


BY_FEEL = """  // a person at the keys, ten times a second
  const [touch, gentle, rough, step, most] = arguments, of = id => document.getElementById(id);
  let touched = false;
  const press = code => window.dispatchEvent(new KeyboardEvent("keydown", {code}));
  const person = setInterval(() => {
    if (!of("status").textContent.includes("recording")) return clearInterval(person);
    const load = parseFloat(of("contact-load").textContent), tilt = of("tilt");
    touched ||= load > touch;
    if (load < gentle) press("KeyW");
    if (load > rough) press("KeyS");
    const right = tilt.getAttribute("x2") / 10, away = -tilt.getAttribute("y2") / 10;
    for (const [angle, less, more] of [[right, "ArrowRight", "ArrowLeft"], [away, "ArrowUp", "ArrowDown"]])
      for (let k = Math.min(most, Math.round(Math.abs(angle) / step)); touched && k > 0; k -= 1)
        press(angle < 0 ? less : more);
  }, 100);
"""


def insert_by_feel(page):
    """Starts a demonstration, feeds the tilted peg until it touches, levels it there, and feeds it to the floor.

    The person pushes gently all the time, so that the wrench shows how the peg is tilted. The page's own script presses
    the keys: a driver from outside is slower than a hand.
    """
    tap(page, " ")
    wait_for_text(page, "status", "recording")
    page.run(BY_FEEL, TOUCH, GENTLE, ROUGH, STEP, FASTEST)
    end = time.monotonic() + DEADLINE
    while "recording" in text_of(page, "status"):
        assert time.monotonic() < end, text_of(page, "status")
        time.sleep(0.1)


def push(page, load):
    """Starts a demonstration and feeds the peg as it is, until the contact load (N) is shown."""
    tap(page, " ")
    wait_for_text(page, "status", "recording")
    end = time.monotonic() + DEADLINE
    while float(text_of(page, "contact-peak").removesuffix(" N")) < load and "recording" in text_of(page, "status"):
        assert time.monotonic() < end, text_of(page, "contact-load")
        tap(page, "w")
        time.sleep(0.05)
