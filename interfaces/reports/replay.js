// Moves the time of a replay: readings, legend, dial and timeline show the sample that holds at the time of the viewer.
//
// The page defines `data` (what changes from sample to sample) and `sceneCommands` (drawing commands in base64).
// The animator of the viewer is the only clock.

const viewer = new MeshCat.Viewer(document.getElementById("meshcat-pane"));
for (const command of sceneCommands) {
  viewer.handle_command_bytearray(Uint8Array.from(atob(command), c => c.charCodeAt(0)));
}

// Lines where faces of the block meet at more than 30 degrees, found in mm: three.js joins corners closer than 1e-4.
const block = viewer.scene_tree.find(["meshcat", "hole", "body", "<object>"]).object;
const edges = new MeshCat.THREE.EdgesGeometry(block.geometry.clone().scale(1e3, 1e3, 1e3), 30);
const lines = new MeshCat.THREE.LineSegments(edges, new MeshCat.THREE.LineBasicMaterial({ color: 0x3a4148 }));
lines.scale.setScalar(1e-3);
block.add(lines);

(function () {
  const animator = viewer.animator, end = data.time.at(-1);
  const byId = id => document.getElementById(id);
  const cells = document.querySelectorAll(".reading"), rows = document.querySelectorAll("[data-phase]");
  const peg = viewer.scene_tree.find(["meshcat", "peg", "body", "<object>"]).object.material;
  const EMITTED = 0.25;  // share of the peg's colour, so that shading does not hide it
  const cursor = document.querySelector(".cursor"), timeline = byId("timeline");
  let lastShown = null;

  /** Shows everything that holds at a time; does nothing if nothing has changed since the last call. */
  function showTime(time) {
    const state = [time, animator.playing].join();
    if (state === lastShown) return;
    lastShown = state;
    const sample = Math.max(0, data.time.findLastIndex(other => other <= time + 1e-6));
    byId("time").textContent = time.toFixed(2) + " s";
    byId("play").textContent = animator.playing ? "pause" : "play";
    cells.forEach((cell, k) => { cell.textContent = data.readings[k][sample]; });
    rows.forEach(row => row.classList.toggle("now", Number(row.dataset.phase) === data.phase[sample]));
    cursor.style.left = 100 * time / end + "%";
    const colour = data.colours[data.phase[sample]];
    peg.color.set(colour);
    peg.emissive.set(colour).multiplyScalar(EMITTED);
    viewer.set_dirty();
    const [[x, y], [endX, endY]] = [data.lean[sample], data.lateral[sample]];
    const shown = { dot: { cx: x, cy: y, fill: colour }, lateral: { x2: endX, y2: endY } };
    for (const id in shown) for (const name in shown[id]) byId(id).setAttribute(name, shown[id][name]);
    byId("lateral").style.visibility = Math.hypot(endX, endY) > 0.02 ? "visible" : "hidden";
  }

  function seek(time) {
    const inside = Math.max(0, Math.min(end, time));
    animator.seek(inside);
    animator.display_progress(inside);
  }

  function pause() {
    if (animator.playing) animator.pause();
  }

  /** Plays on from the current time, or pauses; starts again at the end. */
  function togglePlay() {
    if (animator.playing) return pause();
    if (animator.time >= end - 1e-3) seek(0);
    animator.play();
  }

  function seekToPointer(event) {
    const box = timeline.getBoundingClientRect();
    pause();
    seek(end * (event.clientX - box.left) / box.width);
  }

  byId("play").addEventListener("click", togglePlay);
  document.addEventListener("keydown", event => {
    if (event.code !== "Space" || event.target !== document.body) return;
    event.preventDefault();
    togglePlay();
  });
  timeline.addEventListener("pointerdown", event => {
    timeline.setPointerCapture(event.pointerId);
    seekToPointer(event);
  });
  timeline.addEventListener("pointermove", event => {
    if (event.buttons) seekToPointer(event);
  });
  animator.mixer.timeScale = data.speed;
  const start = new URLSearchParams(location.hash.slice(1)).get("t");  // page.html#t=1.5: paused at 1.5 s
  if (start !== null && isFinite(start)) {
    pause();
    seek(Number(start));
  }
  (function drawFrame() {
    requestAnimationFrame(drawFrame);
    showTime(animator.time);
  })();
  window.replay = { seek, pause, time: () => animator.time, end, ready: true };
})();
