// Guides a first demonstration in three steps. Each step is recognised from the values of the session.
(function () {
  const {byId, onButton, onValues, formatNumber, contactLoad, isInserted, TOUCH_LOAD} = livePanel;
  const LEVEL = 0.3;  // degrees; a smaller tilt is level, and goes in without a high load
  const ENTERED = 5e-4;  // m; a peg this deep has found the mouth without a touch
  const HIGH = 0.6;  // share of the limit above which the load is high
  const SEEN = "live-guide-seen";  // kept by the browser
  const STEPS = ["touch", "level", "insert", "keep"];
  let step = null;  // one of STEPS, or null while the guide is hidden
  let values = {}, wasInserted = false;

  const tiltOf = ({tilt}) => tilt ? Math.hypot(tilt.right, tilt.away) : 0;

  /** The keys that tilt the peg back to the centre of the dial. */
  function levelling({right, away}) {
    return [[right, "←", "→"], [away, "↓", "↑"]].filter(([angle]) => Math.abs(angle) > LEVEL / 2)
      .map(([angle, less, more]) => angle > 0 ? less : more);
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
    return step === "level" && tiltOf(values) < LEVEL ? "insert" : step;
  }

  /** What to do now: [text, keys that do it]. */
  function advice() {
    if (step === "keep") {
      if (isInserted(values)) return ["Inserted. Keep it as good or as bad, or discard it.", ["G", "B", "X"]];
      return ["Not inserted. Discard it, and start again.", ["X"]];
    }
    if (values.phase !== "recording") return ["Start a demonstration.", ["Space"]];
    if (step === "touch") return ["Feed down until the tip of the peg touches.", ["W"]];
    if (step === "level") return ["Level the peg: bring the orange line of the dial to the centre.", levelling(values.tilt)];
    const {contact, depth} = values;
    const isHigh = contact && contact.load > HIGH * contact.limit;
    if (contact && (isHigh || contact.held) && tiltOf(values) > LEVEL / 2) {
      return ["The load is high: level the peg first, or retract a little.", [...levelling(values.tilt), "S"]];
    }
    if (isHigh) return ["The load is high: retract a little, then feed in slowly.", ["S"]];
    return [`Feed in to the full depth: ${formatNumber(1e3 * Math.max(depth.full - depth.tip, 0), 1)} mm to go.`, ["W"]];
  }

  /** Goes to a step, and shows it with what to do. */
  function show(newStep) {
    if (step !== null && newStep === null) localStorage.setItem(SEEN, "yes");
    step = newStep;
    byId("guide").hidden = step === null || values.phase === "busy";
    if (byId("guide").hidden) return;
    byId("guide").querySelectorAll("li").forEach((item, k) => {
      item.className = k < STEPS.indexOf(step) ? "done" : k === STEPS.indexOf(step) ? "current" : "";
    });
    const [text, keys] = advice();
    byId("guide-text").textContent = text;
    byId("guide-keys").replaceChildren(...keys.map(key => {
      const cap = document.createElement("kbd");
      cap.textContent = key;
      return cap;
    }));
  }

  onButton("guide-show", "KeyH", () => show("touch"));
  onButton("guide-skip", "Escape", () => show(null));
  onValues(received => {
    values = received;
    if (step !== null && values.depth) show(next());
  });
  if (!localStorage.getItem(SEEN)) show("touch");
})();
