// The overlay of a replay: legend, readings, tilt dial and timeline over the 3-D view.
//
// The page defines `data` (samples in SI units, and labels) and `sceneCommands` (drawing commands in base64).
// The animator of the viewer is the only clock: the overlay starts, stops and seeks it, and shows the sample that holds
// at its time.

const viewer = new MeshCat.Viewer(document.getElementById("meshcat-pane"));
for (const command of sceneCommands) {
  viewer.handle_command_bytearray(Uint8Array.from(atob(command), c => c.charCodeAt(0)));
}

(function () {
  const animator = viewer.animator;
  const sampleCount = data.time.length;
  const endTime = data.time[sampleCount - 1];
  const INK = "#1d2329", FAINT = "#8d98a3", RING = "#d3dae0", OUTER_RING = "#aab4be";
  const AXES = ["pitch", "yaw", "clocking"];
  const byId = id => document.getElementById(id);

  // ------------------------------------------------------------ numbers, lines, canvases

  /** Text with a fixed number of digits; never "-0". */
  function formatNumber(value, digits) {
    return (Math.abs(value) < 0.5 * 10 ** -digits ? 0 : value).toFixed(digits);
  }

  /** Index of the last sample at or before a time. */
  function sampleAt(time) {
    let low = 0, high = sampleCount - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (data.time[middle] <= time + 1e-6) low = middle; else high = middle - 1;
    }
    return low;
  }

  /** Clears a canvas, adapts it to the resolution of the screen, and returns its context and size. */
  function clearCanvas(id) {
    const element = byId(id), ratio = window.devicePixelRatio || 1;
    const width = element.clientWidth, height = element.clientHeight;
    if (element.width !== Math.round(width * ratio) || element.height !== Math.round(height * ratio)) {
      element.width = Math.round(width * ratio);
      element.height = Math.round(height * ratio);
    }
    const context = element.getContext("2d");
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, height);
    context.font = "11px system-ui, 'DejaVu Sans', sans-serif";
    return { context, width, height };
  }

  function drawLine(context, points, colour, width) {
    context.beginPath();
    points.forEach(([x, y], k) => k ? context.lineTo(x, y) : context.moveTo(x, y));
    context.strokeStyle = colour;
    context.lineWidth = width;
    context.stroke();
  }

  function drawText(context, text, x, y, colour) {
    context.fillStyle = colour;
    context.fillText(text, x, y);
  }

  // ------------------------------------------------------------ legend: what does not change

  function showLegend() {
    document.title = data.title;
    document.documentElement.style.setProperty("--force", data.force_colour);
    document.documentElement.style.setProperty("--moment", data.moment_colour);
    document.documentElement.style.setProperty("--contact", data.contact_colour);
    byId("title").textContent = data.title;
    byId("about").textContent = data.about;
    byId("colouring").textContent = data.colouring;
    byId("force-scale").textContent = "force on the peg, 10 mm = " + data.force_scale;
    byId("moment-scale").textContent = "moment on the peg, 10 mm = " + data.moment_scale;
    byId("dial-ring").textContent = ringStep + "\u00b0";
    byId("contact-scale").textContent = "each contact on the peg, 10 mm = " + data.force_scale;
    if (!data.back_off) document.querySelectorAll(".rig").forEach(row => row.remove());
    if (!data.contacts) document.querySelectorAll(".contacts").forEach(element => element.remove());
  }

  /** Adds one row for each phase that occurs, and lists the others; returns the rows of all phases. */
  function addPhaseRows() {
    const counts = data.phases.map((_, index) => data.phase.filter(p => p === index).length);
    const unused = data.phases.filter((_, index) => !counts[index]);
    byId("never").textContent = unused.length ? "never: " + unused.join(", ") : "";
    return data.phases.map((name, index) => {
      const row = document.createElement("div");
      if (counts[index]) byId("phases").append(row);
      const swatch = row.appendChild(document.createElement("span"));
      swatch.className = "swatch";
      swatch.style.background = data.colours[index];
      row.appendChild(document.createElement("span")).textContent = name;
      const share = row.appendChild(document.createElement("span"));
      share.className = "share";
      share.textContent = Math.max(1, Math.round(100 * counts[index] / sampleCount)) + " %";
      return row;
    });
  }

  // ------------------------------------------------------------ timeline

  const MARGIN = 4, STRIP_HEIGHT = 12, LABEL_HEIGHT = 14;  // pixels
  const push = data.back_off ? data.load : data.force;  // the curve in the colour of the force, N
  const maxPush = Math.max(...push, data.limit ?? 0, 1e-9);
  const minDepth = Math.min(0, ...data.depth), maxDepth = Math.max(...data.depth);

  function drawTimeline(time) {
    const { context, width, height } = clearCanvas("timeline");
    if (width < 20) return;
    const top = LABEL_HEIGHT, bottom = height - STRIP_HEIGHT - 3;
    const xOf = t => MARGIN + (width - 2 * MARGIN) * t / endTime;
    const chart = { context, width, height, top, bottom, xOf };
    drawPhases(chart);
    if (data.back_off) drawBackOffs(chart);
    drawCurves(chart);
    if (data.steps) drawSteps(chart);
    drawLabels(chart);
    drawLine(context, [[xOf(time), top - 3], [xOf(time), height]], "#000", 2);
  }

  /** Fills the strip below the curves, and tints the background, with the colour of the phase. */
  function drawPhases({ context, height, top, bottom, xOf }) {
    for (let start = 0; start < sampleCount;) {
      const phase = data.phase[start];
      let next = start;
      while (next < sampleCount && data.phase[next] === phase) next++;
      const left = xOf(data.time[start]), right = xOf(next < sampleCount ? data.time[next] : endTime);
      context.fillStyle = data.colours[phase];
      context.fillRect(left, height - STRIP_HEIGHT, Math.max(right - left, 0.5), STRIP_HEIGHT);
      context.globalAlpha = 0.13;
      context.fillRect(left, top, right - left, bottom - top);
      context.globalAlpha = 1;
      start = next;
    }
  }

  /** Marks the samples in which the peg is backed off and, pale, those in which the turns are reversed. */
  function drawBackOffs({ context, bottom, xOf }) {
    const mark = active => active.forEach((value, k) => {
      if (!value) return;
      const left = xOf(data.time[k]), right = xOf(data.time[Math.min(k + 1, sampleCount - 1)]);
      context.fillRect(left, bottom - 1, Math.max(1, right - left), 4);
    });
    context.fillStyle = INK;
    mark(data.back_off);
    context.globalAlpha = 0.4;
    mark(data.reversed);
    context.globalAlpha = 1;
  }

  /** Draws depth, force or load, and the limit of the load. */
  function drawCurves({ context, width, top, bottom, xOf }) {
    const yOfPush = value => bottom - (bottom - top) * value / maxPush;
    const yOfDepth = value => top + (bottom - top) * (value - minDepth) / (maxDepth - minDepth || 1);
    if (data.limit) {
      const y = yOfPush(data.limit);
      context.setLineDash([5, 4]);
      drawLine(context, [[MARGIN, y], [width - MARGIN, y]], data.force_colour, 1);
      context.setLineDash([]);
    }
    const pointsOf = (values, yOf) => values.map((value, k) => [xOf(data.time[k]), yOf(value)]);
    drawLine(context, pointsOf(data.depth, yOfDepth), INK, 1.5);
    drawLine(context, pointsOf(push, yOfPush), data.force_colour, 1.5);
  }

  /** Marks every motor step on the strip of phases, pitch above yaw above clocking. */
  function drawSteps({ context, height, xOf }) {
    const row = STRIP_HEIGHT / data.steps.length;
    context.fillStyle = INK;
    data.steps.forEach((taken, axis) => {
      const y = height - STRIP_HEIGHT + 1 + row * axis;
      for (let k = 1; k < sampleCount; k++) {
        if (taken[k] !== taken[k - 1]) context.fillRect(xOf(data.time[k]) - 0.75, y, 1.5, row - 2);
      }
    });
  }

  function drawLabels({ context, width }) {
    const depth = "depth, down to " + formatNumber(1e3 * maxDepth, 1) + " mm";
    const limit = data.limit ? " (limit " + data.limit + " N)" : "";
    const force = data.back_off ? "load, up to " + formatNumber(Math.max(...push), 1) + " N" + limit
      : "force, up to " + formatNumber(maxPush, 1) + " N";
    const marks = [];
    if (data.back_off && data.back_off.some(Boolean)) {
      marks.push("\u25ac backs off" + (data.reversed.some(Boolean) ? ", pale: turns reversed" : ""));
    }
    if (data.steps) marks.push("\u2758 steps of " + AXES.slice(0, data.steps.length).join(", "));
    context.textAlign = "left";
    drawText(context, depth, MARGIN, 10, INK);
    drawText(context, force, MARGIN + context.measureText(depth).width + 18, 10, data.force_colour);
    drawText(context, marks.join("     "), MARGIN + context.measureText(depth + force).width + 36, 10, INK);
    context.textAlign = "right";
    drawText(context, formatNumber(endTime, 2) + " s", width - MARGIN, 10, INK);
  }

  // ------------------------------------------------------------ dial: the lean of the peg, seen along the hole

  const tilts = data.lean.map(([x, y]) => Math.hypot(x, y) * 180 / Math.PI);
  const ringStep = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 45].find(step => Math.max(...tilts) <= 3 * step) || 90;  // degrees
  const maxLateralForce = Math.max(...data.lateral.map(force => Math.hypot(...force)), 1e-9);

  function drawDial(sample) {
    const { context, width } = clearCanvas("dial");
    if (width < 20) return;
    const centre = width / 2, radius = 0.42 * width;
    // Up on the dial points away from the first place of the camera.
    const cos = Math.cos(data.azimuth), sin = Math.sin(data.azimuth);
    const pointOf = (x, y) => [centre + (-sin * x + cos * y), centre + (cos * x + sin * y)];
    const dial = { context, centre, radius, pointOf };
    drawRings(dial);
    const pixelsPerRadian = radius / (3 * ringStep) * 180 / Math.PI;
    const path = data.lean.map(([x, y]) => pointOf(pixelsPerRadian * x, pixelsPerRadian * y));
    for (let k = 1; k <= sample; k++) {
      drawLine(context, [path[k - 1], path[k]], data.colours[data.phase[k]], 2.5);
    }
    drawLateralForce(dial, sample);
    context.beginPath();
    context.arc(...path[sample], 5.5, 0, 2 * Math.PI);
    context.fillStyle = data.colours[data.phase[sample]];
    context.fill();
    context.strokeStyle = INK;
    context.lineWidth = 1.5;
    context.stroke();
  }

  /** Draws three rings, and the axes x and y of the hole. */
  function drawRings({ context, centre, radius, pointOf }) {
    for (let ring = 1; ring <= 3; ring++) {
      context.beginPath();
      context.arc(centre, centre, ring * radius / 3, 0, 2 * Math.PI);
      context.strokeStyle = ring === 3 ? OUTER_RING : RING;
      context.lineWidth = 1;
      context.stroke();
    }
    context.textAlign = "center";
    for (const [name, x, y] of [["x", radius, 0], ["y", 0, radius]]) {
      drawLine(context, [[centre, centre], pointOf(x, y)], RING, 1);
      const [textX, textY] = pointOf(1.12 * x, 1.12 * y);
      drawText(context, name, textX, textY + 4, FAINT);
    }
  }

  /** Draws an arrow for the lateral force; the largest force of the motion reaches the outer ring. */
  function drawLateralForce({ context, centre, radius, pointOf }, sample) {
    const [x, y] = data.lateral[sample];
    if (Math.hypot(x, y) <= 0.02 * maxLateralForce) return;
    const [tipX, tipY] = pointOf(x * radius / maxLateralForce, y * radius / maxLateralForce);
    const angle = Math.atan2(tipY - centre, tipX - centre);
    const head = Math.min(9, Math.hypot(tipX - centre, tipY - centre));
    const shaftEnd = [tipX - 0.7 * head * Math.cos(angle), tipY - 0.7 * head * Math.sin(angle)];
    drawLine(context, [[centre, centre], shaftEnd], data.force_colour, 2.5);
    context.beginPath();
    context.moveTo(tipX, tipY);
    for (const turn of [2.7, -2.7]) {
      context.lineTo(tipX + head * Math.cos(angle + turn), tipY + head * Math.sin(angle + turn));
    }
    context.closePath();
    context.fillStyle = data.force_colour;
    context.fill();
  }

  // ------------------------------------------------------------ readings: what changes with time

  let lastDrawn = null;

  /** Shows everything that holds at a time; does nothing if nothing has changed since the last call. */
  function showTime(time) {
    const sample = sampleAt(time);
    const state = [time, sample, animator.playing, window.innerWidth, window.innerHeight].join();
    if (state === lastDrawn) return;
    lastDrawn = state;
    showReadings(time, sample);
    phaseRows.forEach((row, phase) => row.classList.toggle("now", phase === data.phase[sample]));
    byId("play").textContent = animator.playing ? "pause" : "play";
    drawTimeline(time);
    drawDial(sample);
  }

  function showReadings(time, sample) {
    byId("reading-time").textContent = formatNumber(time, 2) + " s";
    byId("reading-depth").textContent = formatNumber(1e3 * data.depth[sample], 2) + " mm";
    byId("reading-tilt").textContent = formatNumber(tilts[sample], 2) + " \u00b0";
    byId("reading-axial").textContent = formatNumber(data.axial[sample], 1) + " N";
    byId("reading-lateral").textContent = formatNumber(Math.hypot(...data.lateral[sample]), 1) + " N";
    byId("reading-moment").textContent = formatNumber(1e3 * data.moment[sample], 1) + " N mm";
    if (data.contacts) {
      byId("reading-contacts").textContent = data.contacts[sample].map(force => formatNumber(force, 1)).join(", ") + " N";
    }
    if (!data.back_off) return;
    const load = data.load[sample], limit = data.limit ?? Math.max(...data.load);
    byId("reading-load").textContent = formatNumber(load, 1) + " of " + formatNumber(limit, 0) + " N";
    byId("load-bar").className = load > limit ? "over" : "";
    byId("load-bar").firstChild.style.width = Math.min(100, 100 * load / limit) + "%";
    byId("reading-back-off").textContent = data.back_off[sample] ? "backing off"
      : data.reversed[sample] ? "turns reversed" : "inactive";
    byId("reading-steps").textContent = data.steps.map((taken) => taken[sample]).join(", ");
  }

  // ------------------------------------------------------------ controls

  function seek(time) {
    const inside = Math.max(0, Math.min(endTime, time));
    animator.seek(inside);
    animator.display_progress(inside);
  }

  function pause() {
    if (animator.playing) animator.pause();
  }

  /** Plays on from the current time; starts again at the end. */
  function play() {
    if (animator.time >= endTime - 1e-3) seek(0);
    animator.play();
  }

  function togglePlay() {
    if (animator.playing) pause(); else play();
  }

  function seekToPointer(event) {
    const box = byId("timeline").getBoundingClientRect();
    pause();
    seek(endTime * (event.clientX - box.left - MARGIN) / (box.width - 2 * MARGIN));
  }

  function connectControls() {
    byId("play").addEventListener("click", togglePlay);
    document.addEventListener("keydown", event => {
      if (event.code !== "Space" || event.target !== document.body) return;
      event.preventDefault();
      togglePlay();
    });
    byId("timeline").addEventListener("pointerdown", event => {
      byId("timeline").setPointerCapture(event.pointerId);
      seekToPointer(event);
    });
    byId("timeline").addEventListener("pointermove", event => {
      if (event.buttons) seekToPointer(event);
    });
  }

  /** Opens the page paused at the time in its address: page.html#t=1.5 shows 1.5 s. */
  function seekToAddress() {
    const time = new URLSearchParams(location.hash.slice(1)).get("t");
    if (time === null || !isFinite(time)) return;
    pause();
    seek(Number(time));
  }

  showLegend();
  const phaseRows = addPhaseRows();
  connectControls();
  animator.mixer.timeScale = data.speed;
  seekToAddress();
  (function drawFrame() {
    requestAnimationFrame(drawFrame);
    showTime(animator.time);
  })();
  window.replay = { seek, play, pause, time: () => animator.time, end: endTime, ready: true };
})();
