// What the parts of the panel share: values from the session, keys, numbers. Drake's page defines `viewer`.
const livePanel = (function () {
  const TOUCH_LOAD = 0.5;  // N; a larger contact load is a touch
  const listeners = [];
  let values = {};
  const byId = id => document.getElementById(id);
  document.title = "demonstrate an insertion";

  // Open the controls, except those of the picture, in the panel's layout.
  viewer.gui.open();
  viewer.gui.width = 300;
  viewer.gui.__folders["Scene"].close();
  viewer.gui.__folders["Animations"].domElement.parentElement.hidden = true;  // there are none
  byId("controls").append(viewer.gui.domElement);

  const isTyping = event => event.target instanceof HTMLInputElement && event.target.type === "text";

  // Keys that move the peg must neither scroll the page nor press the focused button again.
  window.addEventListener("keydown", event => {
    if (!isTyping(event) && (event.key === " " || event.key.startsWith("Arrow"))) event.preventDefault();
  });

  /** Calls `action` when the key is pressed, and when the button is clicked. */
  function onButton(id, code, action) {
    window.addEventListener("keydown", event => {
      if (event.code === code && !event.repeat && !isTyping(event)) action();
    });
    byId(id).addEventListener("click", () => {
      byId(id).blur();  // Space is to start, not to click again
      action();
    });
  }

  /** Text with a fixed number of digits; never "-0". */
  function formatNumber(value, digits) {
    return (Math.abs(value) < 0.5 * 10 ** -digits ? 0 : value).toFixed(digits);
  }

  /** Calls `listener` with all values now, if there are any, and after every change. */
  function onValues(listener) {
    listeners.push(listener);
    if (Object.keys(values).length) listener(values);
  }

  function show(changed) {
    values = {...values, ...changed};
    for (const listener of listeners) listener(values);
  }

  /** Contact load in N. */
  const contactLoad = values => values.contact ? values.contact.load : 0;

  /** Whether the peg is at its full depth; the last reading may be a little older than the end. */
  const isInserted = values => Boolean(values.depth) && values.depth.tip > values.depth.full - 5e-5;

  const server = new EventSource("values");
  server.onmessage = event => {
    const received = JSON.parse(event.data);
    show(received);
    if (received.over) server.close();
  };
  server.onerror = () => show({status: "no connection to the session", phase: "over"});

  return {TOUCH_LOAD, byId, onButton, formatNumber, onValues, contactLoad, isInserted};
})();
