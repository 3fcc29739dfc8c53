// Counts the pictures of the scene, and draws them coarser where they take too long, as without a graphics card.
// A scene that stands still is drawn once more with all pixels.
(function () {
  const SAMPLES = 15;  // pictures whose median time is looked at
  const SLOW = 26, TARGET = 21, FAST = 18;  // ms from a picture to the next frame of the browser
  const COARSEST = 0.4;  // of the screen's resolution
  const PAUSE = 250;  // ms; a longer gap is no slow picture, but a hidden page
  const REFINEMENT = 1.25, FIRST_PATIENCE = 2000;  // ms without a slow picture, before a finer one is tried
  const STILL = 200;  // ms without a picture
  const {byId} = livePanel;
  let drawn = 0, drawnBefore = 0, last = null;
  let times = [], drawnAt = 0, isStill = false;
  let share = 1, wasRefined = false, settled = performance.now(), patience = FIRST_PATIENCE;

  const render = viewer.render;
  viewer.render = function () {
    if (isStill) setSize(share);
    isStill = false;
    render.call(viewer);
    drawn += 1;
  };

  function setSize(share) {
    viewer.renderer.setPixelRatio(share * window.devicePixelRatio);
    viewer.set_3d_pane_size();
  }

  function drawStill() {
    setSize(1);
    render.call(viewer);
    isStill = true;
  }

  /** Draws with a share of the screen's resolution from now on. */
  function setResolution(newShare) {
    wasRefined = newShare > share;
    share = newShare;
    settled = performance.now();
    setSize(share);
    viewer.render();  // at once: the canvas is empty
  }

  /** Adapts the resolution to the time of a picture, ms, which grows with the number of pixels. */
  function adapt(time) {
    if (time > SLOW && share > COARSEST) {
      if (wasRefined) patience *= 2;
      setResolution(Math.max(COARSEST, share * Math.sqrt(TARGET / time)));
    } else if (time < FAST && share < 1 && performance.now() - settled > patience) {
      setResolution(Math.min(1, REFINEMENT * share));
    }
  }

  function watch(now) {
    if (last !== null && last.drew && now - last.time < PAUSE) times.push(now - last.time);
    last = {time: now, drew: drawn > drawnBefore};
    drawnBefore = drawn;
    if (last.drew) drawnAt = now;
    if (share < 1 && !isStill && now - drawnAt > STILL) drawStill();
    if (times.length >= SAMPLES) {
      adapt(times.sort((a, b) => a - b)[SAMPLES >> 1]);  // a single delay does not count
      times = [];
    }
    requestAnimationFrame(watch);
  }
  requestAnimationFrame(watch);

  let counted = {number: 0, time: performance.now()};
  livePanel.picturesPerSecond = 0;
  setInterval(() => {
    const now = performance.now();
    livePanel.picturesPerSecond = 1000 * (drawn - counted.number) / (now - counted.time);
    counted = {number: drawn, time: now};
    byId("pictures").textContent = livePanel.picturesPerSecond ? Math.round(livePanel.picturesPerSecond) : "–";
  }, 1000);
})();
