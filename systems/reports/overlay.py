"""What lies over the 3-D view of a replay: legend, read-outs, tilt dial and timeline (HTML, CSS, JavaScript).

The viewer's own animator is the only clock: the overlay starts, stops and seeks it, and shows what holds at its time.
"""

from __future__ import annotations

STYLE = """
html, body { margin: 0; height: 100%; overflow: hidden; background: #dfe4e9; }
body, button { font: 13px/1.45 system-ui, -apple-system, "Segoe UI", "DejaVu Sans", sans-serif; color: #1d2329; }
#meshcat-pane { width: 100vw; height: 100vh; overflow: hidden; }
.panel { position: absolute; background: rgba(255, 255, 255, 0.88); border: 1px solid #c6ced6;
  border-radius: 6px; box-sizing: border-box; }
#card { left: 12px; top: 12px; width: 262px; padding: 10px 14px 12px;
  max-height: calc(100vh - 124px); overflow-y: auto; }
#card h1 { font-size: 15px; margin: 0; overflow-wrap: anywhere; }
#card .about { color: #56616b; margin: 0 0 6px; }
#card h2 { font-size: 12px; margin: 9px 0 2px; color: #56616b; font-weight: 600; }
#readings { border-collapse: collapse; width: 100%; font-variant-numeric: tabular-nums; }
#readings td { padding: 0; }
#readings td + td { text-align: right; font-weight: 600; white-space: pre; }
#phases div { display: flex; align-items: center; gap: 8px; padding: 1px 4px; border-radius: 4px; }
#never { color: #7d8790; font-size: 12px; }
#phases .now { background: #1d2329; color: #fff; }
#phases .swatch { width: 13px; height: 13px; border-radius: 3px; flex: none; border: 1px solid rgba(0,0,0,.35); }
#phases .share { margin-left: auto; font-variant-numeric: tabular-nums; white-space: nowrap; }
#load-bar { height: 7px; background: #e3e7eb; border-radius: 4px; overflow: hidden; margin: 1px 0 3px; }
#load-bar div { height: 100%; background: FORCE; }
#load-bar.over div { background: #1d2329; }
.key { display: flex; align-items: center; gap: 8px; }
.key svg { flex: none; }
#dial-box { right: 12px; bottom: 110px; width: 236px; padding: 8px 8px 6px; text-align: center; }
#dial { width: 200px; height: 200px; display: block; margin: 0 auto; }
#dial-box .about { color: #56616b; font-size: 12px; line-height: 1.35; }
#bar { left: 12px; right: 12px; bottom: 12px; height: 88px; display: flex; gap: 10px; padding: 8px 10px; }
#bar button { width: 56px; border: 1px solid #aab4be; background: #fff; border-radius: 5px; cursor: pointer; }
#bar button:hover { background: #eef2f5; }
#timeline { flex: 1; min-width: 0; height: 70px; cursor: pointer; touch-action: none; }
.dg.main { opacity: 0.6; z-index: 2; }
@media (max-height: 560px) { #dial-box { display: none; } }
"""

BODY = """
<div id="card" class="panel">
  <h1 id="title"></h1>
  <p id="about" class="about"></p>
  <table id="readings">
    <tr><td>time</td><td id="reading-time"></td></tr>
    <tr><td>depth of the tip</td><td id="reading-depth"></td></tr>
    <tr><td>tilt in the hole</td><td id="reading-tilt"></td></tr>
    <tr><td>force, along the peg</td><td id="reading-axial"></td></tr>
    <tr><td>force, across</td><td id="reading-lateral"></td></tr>
    <tr><td>moment</td><td id="reading-moment"></td></tr>
    <tr class="rig"><td>load, of its limit</td><td id="reading-load"></td></tr>
    <tr class="rig"><td colspan="2"><div id="load-bar"><div></div></div></td></tr>
    <tr class="rig"><td>force guard</td><td id="reading-guard"></td></tr>
    <tr class="rig"><td>steps, pitch and yaw</td><td id="reading-steps"></td></tr>
  </table>
  <h2>colour of the peg: <span id="colouring"></span></h2>
  <div id="phases"></div>
  <div id="never"></div>
  <h2>at the tip, seen through the peg</h2>
  <div class="key"><svg width="34" height="10"><path d="M0 5H24" stroke="FORCE" stroke-width="3"/>
    <path d="M22 0L34 5L22 10Z" fill="FORCE"/></svg><span id="force-scale"></span></div>
  <div class="key"><svg width="34" height="10"><path d="M0 5H18" stroke="MOMENT" stroke-width="3"/>
    <path d="M16 0L25 5L16 10ZM25 0L34 5L25 10Z" fill="MOMENT"/></svg><span id="moment-scale"></span></div>
</div>
<div id="dial-box" class="panel">
  <canvas id="dial"></canvas>
  <div class="about">lean of the peg, magnified:<br><span id="dial-ring"></span> from ring to ring;
    <span style="color: FORCE">force across</span></div>
</div>
<div id="bar" class="panel">
  <button id="play" title="play or pause (space bar)">play</button>
  <canvas id="timeline"></canvas>
</div>
"""

SCRIPT = """
(function () {
  const animator = viewer.animator, n = data.time.length, end = data.time[n - 1];
  const byId = id => document.getElementById(id);
  const ink = "#1d2329", faint = "#8d98a3";

  // ------------------------------------------------------------ what stays
  document.title = data.title;
  byId("title").textContent = data.title;
  byId("about").textContent = data.about;
  byId("colouring").textContent = data.colouring;
  byId("force-scale").textContent = "force, 10 mm = " + data.force_scale;
  byId("moment-scale").textContent = "moment, 10 mm = " + data.moment_scale;
  if (!data.guard) document.querySelectorAll(".rig").forEach(row => row.remove());
  const counts = data.phases.map((_, k) => data.phase.filter(p => p === k).length);
  const rows = data.phases.map((name, k) => {
    const row = document.createElement("div");
    if (counts[k]) byId("phases").append(row);
    const swatch = row.appendChild(document.createElement("span"));
    swatch.className = "swatch";
    swatch.style.background = data.colours[k];
    row.appendChild(document.createElement("span")).textContent = name;
    const share = row.appendChild(document.createElement("span"));
    share.className = "share";
    share.textContent = Math.max(1, Math.round(100 * counts[k] / n)) + " %";
    return row;
  });
  const never = data.phases.filter((_, k) => !counts[k]);
  byId("never").textContent = never.length ? "never: " + never.join(", ") : "";

  // ------------------------------------------------------------ the sample that holds at a time
  function sampleAt(t) {
    let low = 0, high = n - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (data.time[middle] <= t + 1e-6) low = middle; else high = middle - 1;
    }
    return low;
  }
  const number = (v, digits) => (Math.abs(v) < 0.5 * 10 ** -digits ? 0 : v).toFixed(digits);

  function canvas(id) {
    const element = byId(id), ratio = window.devicePixelRatio || 1;
    const width = element.clientWidth, height = element.clientHeight;
    if (element.width !== Math.round(width * ratio) || element.height !== Math.round(height * ratio)) {
      element.width = Math.round(width * ratio);
      element.height = Math.round(height * ratio);
    }
    const pen = element.getContext("2d");
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    pen.clearRect(0, 0, width, height);
    pen.font = "11px system-ui, 'DejaVu Sans', sans-serif";
    return { pen, width, height };
  }
  function line(pen, points, colour, width) {
    pen.beginPath();
    points.forEach(([x, y], k) => k ? pen.lineTo(x, y) : pen.moveTo(x, y));
    pen.strokeStyle = colour;
    pen.lineWidth = width;
    pen.stroke();
  }

  // ------------------------------------------------------------ timeline
  const edge = 4;
  function drawTimeline(t) {
    const { pen, width, height } = canvas("timeline");
    if (width < 20) return;
    const strip = 12, top = 14, bottom = height - strip - 3;
    const X = s => edge + (width - 2 * edge) * s / end;
    for (let k = 0; k < n;) {
      let next = k;
      while (next < n && data.phase[next] === data.phase[k]) next++;
      const to = X(next < n ? data.time[next] : end);
      pen.fillStyle = data.colours[data.phase[k]];
      pen.fillRect(X(data.time[k]), height - strip, Math.max(to - X(data.time[k]), 0.5), strip);
      pen.globalAlpha = 0.13;
      pen.fillRect(X(data.time[k]), top, to - X(data.time[k]), bottom - top);
      pen.globalAlpha = 1;
      k = next;
    }
    if (data.guard) {
      pen.fillStyle = ink;
      data.guard.forEach((on, k) => {
        if (on) pen.fillRect(X(data.time[k]), bottom - 1, Math.max(1, X(data.time[Math.min(k + 1, n - 1)]) -
          X(data.time[k])), 4);
      });
    }
    const low = Math.min(0, ...data.depth), high = Math.max(...data.depth);
    const pushed = data.guard ? data.load : data.force, most = Math.max(...pushed, data.limit ?? 0, 1e-9);
    const height_of = f => bottom - (bottom - top) * f / most;
    if (data.limit) {
      pen.setLineDash([5, 4]);
      line(pen, [[edge, height_of(data.limit)], [width - edge, height_of(data.limit)]], data.force_colour, 1);
      pen.setLineDash([]);
    }
    const curve = (values, place, colour) => line(
      pen, values.map((v, k) => [X(data.time[k]), place(v)]), colour, 1.5);
    curve(data.depth, d => top + (bottom - top) * (d - low) / (high - low || 1), ink);
    curve(pushed, height_of, data.force_colour);
    if (data.steps) data.steps.forEach((taken, axis) => {
      pen.fillStyle = ink;  // a stroke a step, pitch above yaw, on the strip of states
      const y = height - strip + 1 + 6 * axis;
      for (let k = 1; k < n; k++) if (taken[k] !== taken[k - 1]) pen.fillRect(X(data.time[k]) - 0.75, y, 1.5, 4);
    });
    pen.textAlign = "left";
    pen.fillStyle = ink;
    const first = "depth, downwards to " + number(1e3 * high, 1) + " mm";
    pen.fillText(first, edge, 10);
    pen.fillStyle = data.force_colour;
    const second = !data.guard ? "force, up to " + number(most, 1) + " N" :
      "load, up to " + number(Math.max(...pushed), 1) + " N" + (data.limit ? " (limit " + data.limit + " N)" : "");
    pen.fillText(second, edge + pen.measureText(first).width + 18, 10);
    const marks = [data.guard && data.guard.some(Boolean) && "\\u25ac guard backs off",
      data.steps && "\\u2758 steps of pitch, above, and yaw"].filter(Boolean).join("     ");
    pen.fillStyle = ink;
    pen.fillText(marks, edge + pen.measureText(first + second).width + 36, 10);
    pen.textAlign = "right";
    pen.fillStyle = ink;
    pen.fillText(number(end, 2) + " s", width - edge, 10);
    line(pen, [[X(t), top - 3], [X(t), height]], "#000", 2);
  }

  // ------------------------------------------------------------ dial
  const tilts = data.lean.map(([x, y]) => Math.hypot(x, y) * 180 / Math.PI);
  const steps = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 45];
  const ring = steps.find(s => Math.max(...tilts) <= 3 * s) || 90;
  const strongest = Math.max(...data.lateral.map(v => Math.hypot(...v)), 1e-9);
  byId("dial-ring").textContent = ring + "\\u00b0";
  function drawDial(k) {
    const { pen, width } = canvas("dial");
    if (width < 20) return;
    const c = width / 2, reach = 0.42 * width, scale = reach / (3 * ring) * 180 / Math.PI;
    // Turned so that up on the dial is away from the camera's first place.
    const cos = Math.cos(data.azimuth), sin = Math.sin(data.azimuth);
    const place = (x, y) => [c + (-sin * x + cos * y), c + (cos * x + sin * y)];
    for (let r = 1; r <= 3; r++) {
      pen.beginPath();
      pen.arc(c, c, r * reach / 3, 0, 2 * Math.PI);
      pen.strokeStyle = r === 3 ? "#aab4be" : "#d3dae0";
      pen.lineWidth = 1;
      pen.stroke();
    }
    pen.fillStyle = faint;
    pen.textAlign = "center";
    for (const [name, x, y] of [["x", reach, 0], ["y", 0, reach]]) {
      line(pen, [[c, c], place(x, y)], "#d3dae0", 1);
      const [tx, ty] = place(1.12 * x, 1.12 * y);
      pen.fillText(name, tx, ty + 4);
    }
    const spots = data.lean.map(([x, y]) => place(scale * x, scale * y));
    for (let i = 1; i <= k; i++) line(pen, [spots[i - 1], spots[i]], data.colours[data.phase[i]], 2.5);
    const [fx, fy] = data.lateral[k], push = Math.hypot(fx, fy);
    if (push > 0.02 * strongest) {
      const [hx, hy] = place(fx * reach / strongest, fy * reach / strongest);
      const a = Math.atan2(hy - c, hx - c), head = Math.min(9, Math.hypot(hx - c, hy - c));
      line(pen, [[c, c], [hx - 0.7 * head * Math.cos(a), hy - 0.7 * head * Math.sin(a)]], data.force_colour, 2.5);
      pen.beginPath();
      pen.moveTo(hx, hy);
      for (const s of [2.7, -2.7]) pen.lineTo(hx + head * Math.cos(a + s), hy + head * Math.sin(a + s));
      pen.closePath();
      pen.fillStyle = data.force_colour;
      pen.fill();
    }
    pen.beginPath();
    pen.arc(...spots[k], 5.5, 0, 2 * Math.PI);
    pen.fillStyle = data.colours[data.phase[k]];
    pen.fill();
    pen.strokeStyle = ink;
    pen.lineWidth = 1.5;
    pen.stroke();
  }

  // ------------------------------------------------------------ what changes
  let shown = null;
  function show(t) {
    const k = sampleAt(t), across = Math.hypot(...data.lateral[k]);
    const mark = [t, k, animator.playing, window.innerWidth, window.innerHeight].join();
    if (mark === shown) return;
    shown = mark;
    byId("reading-time").textContent = number(t, 2) + " s";
    byId("reading-depth").textContent = number(1e3 * data.depth[k], 2) + " mm";
    byId("reading-tilt").textContent = number(tilts[k], 2) + " \\u00b0";
    byId("reading-axial").textContent = number(data.axial[k], 1) + " N";
    byId("reading-lateral").textContent = number(across, 1) + " N";
    byId("reading-moment").textContent = number(1e3 * data.moment[k], 1) + " N mm";
    if (data.guard) {
      const limit = data.limit ?? Math.max(...data.load);
      byId("reading-load").textContent = number(data.load[k], 1) + " of " + number(limit, 0) + " N";
      byId("load-bar").className = data.load[k] > limit ? "over" : "";
      byId("load-bar").firstChild.style.width = Math.min(100, 100 * data.load[k] / limit) + "%";
      byId("reading-guard").textContent = data.guard[k] ? "backing off" : "quiet";
      byId("reading-steps").textContent = data.steps[0][k] + ", " + data.steps[1][k];
    }
    rows.forEach((row, p) => row.classList.toggle("now", p === data.phase[k]));
    byId("play").textContent = animator.playing ? "pause" : "play";
    drawTimeline(t);
    drawDial(k);
  }

  function seek(t) {
    t = Math.max(0, Math.min(end, t));
    animator.seek(t);
    animator.display_progress(t);
  }
  function pause() { if (animator.playing) animator.pause(); }
  function play() {
    if (animator.time >= end - 1e-3) seek(0);
    animator.play();
  }
  function toggle() { if (animator.playing) pause(); else play(); }

  byId("play").addEventListener("click", toggle);
  document.addEventListener("keydown", event => {
    if (event.code === "Space" && event.target === document.body) { event.preventDefault(); toggle(); }
  });
  const timeline = byId("timeline");
  function scrub(event) {
    const box = timeline.getBoundingClientRect();
    pause();
    seek(end * (event.clientX - box.left - edge) / (box.width - 2 * edge));
  }
  timeline.addEventListener("pointerdown", event => { timeline.setPointerCapture(event.pointerId); scrub(event); });
  timeline.addEventListener("pointermove", event => { if (event.buttons) scrub(event); });

  animator.mixer.timeScale = data.speed;
  const wanted = new URLSearchParams(location.hash.slice(1)).get("t");  // page.html#t=1.5 opens still, at 1.5 s
  if (wanted !== null && isFinite(wanted)) { pause(); seek(Number(wanted)); }
  (function follow() {
    requestAnimationFrame(follow);
    show(animator.time);
  })();
  window.replay = { seek, play, pause, time: () => animator.time, end, ready: true };
})();
"""
