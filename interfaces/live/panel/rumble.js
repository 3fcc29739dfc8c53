// The gamepad that moves the peg rumbles with the contact load: as strongly as it can at the limit of the rig's guard.
(function () {
  const {onValues, contactLoad, TOUCH_LOAD} = livePanel;
  const PERIOD = 50, DURATION = 200;  // ms between two effects, and of one: it ends by itself if the values stop
  const WEAKEST = 0.1;  // share of the light motor at a touch
  let actuator = null, due = 0;  // the actuator that rumbles, and when it gets its next effect

  /** The actuator of the first gamepad, which is the one whose sticks count; undefined without one. */
  const connected = () => [...navigator.getGamepads()].find(pad => pad && pad.connected)?.vibrationActuator;

  function rest() {
    actuator?.reset().catch(() => {});  // of a gamepad that has been disconnected
    actuator = null;
  }

  function rumble(share) {
    const found = connected(), now = performance.now();
    if (found !== actuator) rest();
    if (!found || found === actuator && now < due) return;
    [actuator, due] = [found, now + PERIOD];
    const weakMagnitude = WEAKEST + (1 - WEAKEST) * share;
    found.playEffect("dual-rumble", {duration: DURATION, strongMagnitude: share, weakMagnitude}).catch(() => {});
  }

  if (!navigator.getGamepads) return;  // not in a secure context
  onValues(values => {
    const load = values.phase === "recording" && values.hand && values.motion !== false ? contactLoad(values) : 0;
    if (load > TOUCH_LOAD) rumble(Math.min(load / values.contact.limit, 1)); else rest();
  });
})();
