// Buttons and pads for fingers. They press the same keys as a keyboard; what is held repeats.
(function () {
  const {byId, press, onValues} = livePanel;
  const DELAY = 150, PERIOD = 40;  // ms until what is held repeats, and between two looks at it
  const BUTTON_RATE = 15;  // presses per second of a held button
  const PAD_RATE = 25;  // presses per second at the rim of a pad
  const CENTRE = 0.15;  // share of a pad's radius that does nothing

  /**
   * Calls `rates(event)`, {code: presses per second}, while a finger is down and whenever it moves, and presses the
   * keys so often; a touch presses at once.
   */
  function hold(element, rates, release) {
    let held = {}, due = {}, timer = null;

    function repeat() {
      for (const code in held) {
        due[code] = code in due ? due[code] + held[code] * PERIOD / 1000 : 1;
        for (; due[code] >= 1; due[code] -= 1) press(code);
      }
    }
    element.addEventListener("pointerdown", event => {
      element.setPointerCapture(event.pointerId);
      clearInterval(timer);
      [held, due] = [rates(event), {}];
      repeat();
      timer = setTimeout(() => timer = setInterval(repeat, PERIOD), DELAY);
    });
    element.addEventListener("pointermove", event => {
      if (timer !== null) held = rates(event);
    });
    for (const end of ["pointerup", "pointercancel", "lostpointercapture"]) {
      element.addEventListener(end, () => {
        clearInterval(timer);
        timer = null;
        release();
      });
    }
    element.addEventListener("contextmenu", event => event.preventDefault());  // of a long touch
  }

  for (const button of document.querySelectorAll("button[data-key]")) {
    const code = button.dataset.key;
    if ("repeats" in button.dataset) hold(button, () => ({[code]: BUTTON_RATE}), () => {});
    else button.addEventListener("click", () => {
      button.blur();
      press(code);
    });
  }

  for (const pad of document.querySelectorAll(".pad")) {
    const [left, right, down, up] = pad.dataset.keys.split(" "), knob = pad.querySelector("i");
    const place = (x, y) => knob.style.transform = `translate(${x}px, ${y}px)`;
    hold(pad, event => {
      const box = pad.getBoundingClientRect(), radius = box.width / 2;
      let x = (event.clientX - box.left) / radius - 1, y = (event.clientY - box.top) / radius - 1;
      const length = Math.max(1, Math.hypot(x, y));
      [x, y] = [x / length, y / length];
      place(0.6 * radius * x, 0.6 * radius * y);
      const rates = {};
      if (Math.abs(x) > CENTRE) rates[x > 0 ? right : left] = PAD_RATE * Math.abs(x);
      if (Math.abs(y) > CENTRE) rates[y > 0 ? down : up] = PAD_RATE * Math.abs(y);
      return rates;
    }, () => place(0, 0));
  }

  // In a session with a device the controls do not move the peg.
  onValues(({motion}) => byId("overlay").classList.toggle("motionless", motion === false));
})();
