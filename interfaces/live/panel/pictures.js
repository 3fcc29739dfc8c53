// Draws the pictures of the scene coarser where they take too long, as without a graphics card.
(function () {
  const SAMPLES = 15;  // pictures whose median time is looked at
  const SLOW = 26, TARGET = 21;  // ms from a picture to the next frame of the browser
  const COARSEST = 0.4;  // of the screen's resolution
  const PAUSE = 250;  // ms; a longer gap is no slow picture, but a hidden page
  let isDrawn = false, last = null, share = 1, times = [];

  const render = viewer.render;
  viewer.render = function () {
    render.call(viewer);
    isDrawn = true;
  };

  function watch(now) {
    if (last !== null && now - last < PAUSE) times.push(now - last);
    last = isDrawn ? now : null;
    isDrawn = false;
    if (times.length >= SAMPLES) {
      const time = times.sort((a, b) => a - b)[SAMPLES >> 1];  // a single delay does not count
      times = [];
      if (time > SLOW && share > COARSEST) {
        share = Math.max(COARSEST, share * Math.sqrt(TARGET / time));  // the time grows with the number of pixels
        viewer.renderer.setPixelRatio(share * window.devicePixelRatio);
        viewer.set_3d_pane_size();
        viewer.render();  // at once: the canvas is empty
      }
    }
    requestAnimationFrame(watch);
  }
  requestAnimationFrame(watch);
})();
