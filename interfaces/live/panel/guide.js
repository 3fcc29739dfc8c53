// Guides a first demonstration in three steps. Each step is recognised from the values of the session.
(function () {
  const {byId, onButton, onValues, formatNumber, contactLoad, isInserted, TOUCH_LOAD} = livePanel;
  const LEVEL = 0.3;  // degrees; a smaller tilt is level, and goes in without a high load
  const ENTERED = 5e-4;  // m; a peg this deep has found the mouth without a touch
  const HIGH = 0.6;  // share of the limit above which the load is high
  const SEEN = "live-guide-seen";  // kept by the browser
  const STEPS = ["touch", "level", "insert"];
  // The cap of a key by its code.
  const CAPS = {
    Space: "Space", KeyW: "W", KeyS: "S", ArrowLeft: "←", ArrowRight: "→", ArrowUp: "↑", ArrowDown: "↓",
    KeyG: "G", KeyB: "B", KeyX: "X",
  };
  let step = null;  // one of STEPS, "keep", or null while the guide is hidden
  let values = {}, wasInserted = false;

  const tiltOf = ({tilt}) => tilt ? Math.hypot(tilt.right, tilt.away) : 0;

  /** The keys that tilt the peg back to the centre of the dial. */
  function levelling({tilt}) {
    const codes = [];
    if (Math.abs(tilt.right) > LEVEL / 2) codes.push(tilt.right > 0 ? "ArrowLeft" : "ArrowRight");
    if (Math.abs(tilt.away) > LEVEL / 2) codes.push(tilt.away > 0 ? "ArrowDown" : "ArrowUp");
    return codes;
  }

  /** The step after `step`, given the values. */
  function next() {
    if (values.phase === "over") return null;
    if (values.phase === "ready") return step === "keep" && wasInserted ? null : "touch";
    if (values.phase === "verdict") {
      wasInserted = isInserted(values);
      return "keep";
    }
    if (values.phase !== "recording") return step;
    if (step === "keep") return "touch";
    if (step === "touch" && (contactLoad(values) > TOUCH_LOAD || values.depth.tip > ENTERED)) return "level";
    if (step === "level" && tiltOf(values) < LEVEL) return "insert";
    return step;
  }

  /** What to do now: [text, codes of the keys that do it]. */
  function advice() {
    if (step === "keep") {
      if (isInserted(values)) return ["Inserted. Keep it as good or as bad, or discard it.", ["KeyG", "KeyB", "KeyX"]];
      return ["Not inserted. Discard it, and start again.", ["KeyX"]];
    }
    if (values.phase !== "recording") return ["Start a demonstration.", ["Space"]];
    if (step === "touch") return ["Feed down until the tip of the peg touches.", ["KeyW"]];
    if (step === "level") {
      return ["Level the peg: bring the orange line of the dial to the centre.", levelling(values)];
    }
    const {contact, depth} = values;
    const isHigh = contact && contact.load > HIGH * contact.limit;
    if (contact && (isHigh || contact.held) && tiltOf(values) > LEVEL / 2) {
      return ["The load is high: level the peg first, or retract a little.", [...levelling(values), "KeyS"]];
    }
    if (isHigh) return ["The load is high: retract a little, then feed in slowly.", ["KeyS"]];
    const left = formatNumber(1e3 * Math.max(depth.full - depth.tip, 0), 1);
    return [`Feed in to the full depth: ${left} mm to go.`, ["KeyW"]];
  }

  /** Shows the keys. */
  function showHints(codes) {
    byId("guide-keys").replaceChildren(...codes.map(code => {
      const cap = document.createElement("kbd");
      cap.textContent = CAPS[code];
      return cap;
    }));
  }

  function show() {
    const isHidden = step === null || values.phase === "busy";
    byId("guide").hidden = isHidden;
    if (isHidden) return showHints([]);
    const number = STEPS.includes(step) ? STEPS.indexOf(step) : STEPS.length;
    byId("guide").querySelectorAll("li").forEach((item, k) => {
      item.className = k < number ? "done" : k === number ? "current" : "";
    });
    const [text, codes] = advice();
    byId("guide-text").textContent = text;
    showHints(codes);
  }

  function begin() {
    step = "touch";
    show();
  }

  function end() {
    step = null;
    localStorage.setItem(SEEN, "yes");
    show();
  }

  onButton("guide-show", "KeyH", begin);
  onButton("guide-skip", "Escape", end);
  onValues(received => {
    values = received;
    if (step === null || !values.depth) return;
    step = next();
    if (step === null) end(); else show();
  });
  if (!localStorage.getItem(SEEN)) begin();
})();
