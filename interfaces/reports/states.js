// Draws every recording over its states, and reads its values at a cursor.
//
// The page defines `data`: groups of channels, states, names of phases, and the trials. Values are integers in units of
// the step of their group; runs of states and phases are [first sample, number]. A trial is drawn when it comes near
// the window, and its picture is dropped when it leaves.

(function () {
  const LEFT = 50, RIGHT = 10, TITLE = 17, PANEL = 104, GAP = 5, BAND = 15, AXIS = 18;  // pixels
  const TINT = 0.24, MIN_LABEL_WIDTH = 14;
  const HINT = "point at the series to read values";
  const hidden = new Set();
  const channels = [];  // {name, group, index}: in the order of the values
  data.groups.forEach(group => group.channels.forEach((name, index) => channels.push({ name, group, index })));
  const hasPhases = data.phases.length > 0;
  const height = data.groups.length * (TITLE + PANEL) + (hasPhases ? 2 : 1) * (GAP + BAND) + AXIS;

  const plots = data.trials.map((trial, number) => {
    const section = document.getElementById("trial-" + number);
    return {
      trial, sample: null, visible: false,
      element: section.querySelector(".plot"),
      canvas: section.querySelector("canvas"),
      line: section.querySelector(".cursor"),
      readout: section.querySelector(".readout"),
      end: trial.time[trial.time.length - 1],
    };
  });

  // ------------------------------------------------------------ numbers and colours

  /** Text with a fixed number of digits; never "-0". */
  function formatNumber(value, digits) {
    return (Math.abs(value) < 0.5 * 10 ** -digits ? 0 : value).toFixed(digits);
  }

  function styleColour(name) {
    return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  }

  function seriesColour(index) {
    return styleColour("--series-" + index % 6);
  }

  /** Index of the last sample at or before a time. */
  function sampleAt(times, time) {
    let low = 0, high = times.length - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (times[middle] <= time + 1e-9) low = middle; else high = middle - 1;
    }
    return low;
  }

  /** Index of the sample that is nearest to a time. */
  function nearestSample(times, time) {
    const before = sampleAt(times, time), after = Math.min(before + 1, times.length - 1);
    return time - times[before] <= times[after] - time ? before : after;
  }

  /** Number of the last run that begins at or before a sample. */
  function runAt(runs, sample) {
    let found = 0;
    while (found + 1 < runs.length && runs[found + 1][0] <= sample) found++;
    return found;
  }

  /** The smallest of 1, 2 and 5 times a power of ten that is at least a span. */
  function roundStep(span) {
    const decade = 10 ** Math.floor(Math.log10(span));
    return [1, 2, 5, 10].map(m => m * decade).find(step => step >= span * (1 - 1e-9));
  }

  /** Number of decimals that tell multiples of a step apart. */
  function digitsOf(step) {
    return Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  }

  // ------------------------------------------------------------ drawing

  function draw(plot) {
    const ratio = window.devicePixelRatio || 1;
    const width = plot.element.clientWidth;
    if (width < LEFT + RIGHT + 20) return;
    plot.canvas.width = Math.round(width * ratio);
    plot.canvas.height = Math.round(height * ratio);
    const context = plot.canvas.getContext("2d");
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.font = "11px system-ui, 'DejaVu Sans', sans-serif";
    const xOf = time => LEFT + (width - LEFT - RIGHT) * time / (plot.end || 1);
    const chart = { context, width, xOf, ink: styleColour("--ink"), faint: styleColour("--faint"), grid: styleColour("--grid") };
    let top = 0;
    for (const group of data.groups) {
      drawPanel(chart, plot, group, top + TITLE);
      top += TITLE + PANEL;
    }
    drawBand(chart, plot, "state", top + GAP, plot.trial.states, k => data.states[k].colour, k => data.states[k].ink, String);
    if (hasPhases && plot.trial.phases) {
      const colours = [styleColour("--phase-0"), styleColour("--phase-1")];
      drawBand(chart, plot, "phase", top + 2 * GAP + BAND, plot.trial.phases, k => colours[k % 2], () => chart.ink, k => data.phases[k]);
    }
    drawTimes(chart, plot, height - AXIS);
    placeLine(plot);
  }

  /** Calls `fill(left, right, label)` for each run of equal labels; a gap without samples divides it. */
  function eachRun(plot, runs, xOf, fill) {
    const time = plot.trial.time, gap = gapOf(plot.trial);
    runs.forEach(([start, label], k) => {
      const last = k + 1 < runs.length ? runs[k + 1][0] : time.length - 1;
      let begin = start;
      for (let sample = start + 1; sample <= last; sample++) {
        if (time[sample] - time[sample - 1] <= gap) continue;
        fill(xOf(time[begin]), xOf(time[sample - 1] + plot.trial.interval), label);
        begin = sample;
      }
      if (begin < last || k + 1 === runs.length) fill(xOf(time[begin]), xOf(time[last]), label);
    });
  }

  function drawPanel(chart, plot, group, top) {
    const { context, width, xOf } = chart;
    const bottom = top + PANEL;
    const yOf = value => bottom - PANEL * (value - group.low) / (group.high - group.low);
    context.globalAlpha = TINT;
    eachRun(plot, plot.trial.states, xOf, (left, right, state) => {
      context.fillStyle = data.states[state].colour;
      context.fillRect(left, top, Math.max(right - left, 0.5), PANEL);
    });
    context.globalAlpha = 1;
    const step = roundStep((group.high - group.low) / 4), digits = digitsOf(step);
    context.textAlign = "right";
    for (let k = Math.ceil(group.low / step - 1e-9); k * step <= group.high + 1e-9 * step; k++) {
      context.fillStyle = k === 0 ? chart.faint : chart.grid;
      context.fillRect(LEFT, Math.round(yOf(k * step)), width - LEFT - RIGHT, 1);
      context.fillStyle = chart.faint;
      context.fillText(formatNumber(k * step, digits), LEFT - 5, Math.min(bottom, Math.max(top + 8, yOf(k * step) + 4)));
    }
    context.textAlign = "left";
    context.fillStyle = chart.ink;
    context.fillText(group.unit ? group.name + " (" + group.unit + ")" : group.name, LEFT, top - 5);
    context.save();
    context.beginPath();
    context.rect(LEFT, top - 1, width - LEFT - RIGHT, PANEL + 2);
    context.clip();
    channels.forEach((channel, row) => {
      if (channel.group !== group || hidden.has(row)) return;
      context.strokeStyle = seriesColour(channel.index);
      drawSeries(context, plot.trial, plot.trial.values[row], xOf, value => yOf(value * group.step));
    });
    context.restore();
  }

  /** Draws a series; in a column of pixels with many samples, the line from the smallest to the largest of them. */
  function drawSeries(context, trial, values, xOf, yOf) {
    const gap = gapOf(trial);
    context.lineWidth = 1.3;
    context.lineJoin = "round";
    context.beginPath();
    let pen = false;
    for (let k = 0; k < values.length;) {
      const column = Math.floor(xOf(trial.time[k]));
      let low = k, high = k, next = k + 1;
      while (next < values.length && Math.floor(xOf(trial.time[next])) === column && trial.time[next] - trial.time[next - 1] <= gap) {
        if (values[next] < values[low]) low = next;
        if (values[next] > values[high]) high = next;
        next++;
      }
      for (const sample of [...new Set([k, Math.min(low, high), Math.max(low, high), next - 1])]) {
        const x = xOf(trial.time[sample]), y = yOf(values[sample]);
        if (pen) context.lineTo(x, y); else context.moveTo(x, y);
        pen = true;
      }
      if (next < values.length && trial.time[next] - trial.time[next - 1] > gap) pen = false;
      k = next;
    }
    context.stroke();
  }

  /** Longest time between two samples that is no gap; sets the median, `trial.interval`. */
  function gapOf(trial) {
    if (trial.interval === undefined) {
      const intervals = trial.time.slice(1).map((time, k) => time - trial.time[k]).sort((a, b) => a - b);
      trial.interval = intervals.length ? intervals[intervals.length >> 1] : 1;
    }
    return data.gap * trial.interval;
  }

  /** Draws a band of runs, with the number or name of each where it fits. */
  function drawBand(chart, plot, title, top, runs, colourOf, inkOf, nameOf) {
    const { context, xOf } = chart;
    context.textAlign = "right";
    context.fillStyle = chart.faint;
    context.fillText(title, LEFT - 5, top + 11);
    context.textAlign = "left";
    eachRun(plot, runs, xOf, (left, right, label) => {
      context.fillStyle = colourOf(label);
      context.fillRect(left, top, Math.max(right - left, 0.5), BAND);
      if (right - left < MIN_LABEL_WIDTH) return;
      context.fillStyle = inkOf(label);
      const text = shortened(context, nameOf(label), right - left - 6);
      context.fillText(text, left + 3, top + 11);
    });
  }

  /** The beginning of a text that is no wider than a width. */
  function shortened(context, text, width) {
    if (context.measureText(text).width <= width) return text;
    let length = text.length;
    while (length > 0 && context.measureText(text.slice(0, length) + "\u2026").width > width) length--;
    return length ? text.slice(0, length) + "\u2026" : "";
  }

  function drawTimes(chart, plot, top) {
    const { context, width, xOf } = chart;
    const step = roundStep((plot.end || 1) / Math.max(2, (width - LEFT) / 60)), digits = digitsOf(step);
    context.fillStyle = chart.faint;
    for (let k = 0; k * step <= plot.end; k++) {
      const x = xOf(k * step), text = k ? formatNumber(k * step, digits) : "0 s";
      context.textAlign = k && x > width - 24 ? "right" : k ? "center" : "left";
      context.fillRect(x, top, 1, 4);
      context.fillText(text, x, top + 15);
    }
  }

  // ------------------------------------------------------------ cursor

  function placeLine(plot) {
    plot.line.style.visibility = plot.sample === null ? "hidden" : "visible";
    if (plot.sample === null) return;
    const width = plot.element.clientWidth - LEFT - RIGHT;
    plot.line.style.left = LEFT + width * plot.trial.time[plot.sample] / (plot.end || 1) + "px";
  }

  /** Shows time, state, phase and values of a sample; hides the cursor for null. */
  function show(plot, sample) {
    plot.sample = sample;
    placeLine(plot);
    plot.readout.replaceChildren();
    const parts = sample === null ? [HINT] : readings(plot.trial, sample);
    parts.forEach(part => { plot.readout.appendChild(document.createElement("span")).textContent = part; });
    if (sample === null) return;
    plot.element.setAttribute("aria-valuenow", plot.trial.time[sample]);
    plot.element.setAttribute("aria-valuetext", parts.join("; "));
  }

  function readings(trial, sample) {
    const state = trial.states[runAt(trial.states, sample)][1];
    const parts = [formatNumber(trial.time[sample], 2) + " s"];
    parts.push("state " + state + ": " + data.states[state].name + " (" + trial.probability[sample] + " %)");
    if (trial.phases) parts.push("phase " + data.phases[trial.phases[runAt(trial.phases, sample)][1]]);
    for (const group of data.groups) {
      const shown = [];
      channels.forEach((channel, row) => {
        if (channel.group !== group || hidden.has(row)) return;
        shown.push(channel.name + " " + formatNumber(trial.values[row][sample] * group.step, group.digits));
      });
      if (shown.length) parts.push(shown.join("  ") + (group.unit ? " " + group.unit : ""));
    }
    return parts;
  }

  function showPointer(plot, event) {
    const box = plot.element.getBoundingClientRect();
    const time = plot.end * (event.clientX - box.left - LEFT) / (box.width - LEFT - RIGHT);
    show(plot, nearestSample(plot.trial.time, Math.max(0, Math.min(plot.end, time))));
  }

  /** The sample to which a key moves the cursor; undefined for other keys. */
  function sampleOfKey(plot, event) {
    const last = plot.trial.time.length - 1, now = plot.sample ?? 0, page = Math.max(1, Math.round(last / 20));
    const starts = plot.trial.states.map(run => run[0]), run = runAt(plot.trial.states, now);
    const forward = event.shiftKey ? starts[run + 1] ?? last : now + 1;
    const back = event.shiftKey ? starts[now > starts[run] ? run : Math.max(0, run - 1)] : now - 1;
    const targets = { ArrowRight: forward, ArrowUp: forward, ArrowLeft: back, ArrowDown: back, PageUp: now + page, PageDown: now - page, Home: 0, End: last };
    const target = targets[event.key];
    return target === undefined ? undefined : Math.max(0, Math.min(last, target));
  }

  function connect(plot) {
    plot.element.style.height = height + "px";
    plot.element.addEventListener("pointermove", event => showPointer(plot, event));
    plot.element.addEventListener("pointerdown", event => showPointer(plot, event));
    plot.element.addEventListener("pointerleave", event => {
      if (event.pointerType === "mouse" && document.activeElement !== plot.element) show(plot, null);
    });
    plot.element.addEventListener("blur", () => show(plot, null));
    plot.element.addEventListener("keydown", event => {
      const sample = sampleOfKey(plot, event);
      if (sample === undefined || event.ctrlKey || event.altKey || event.metaKey) return;
      event.preventDefault();
      show(plot, sample);
    });
    show(plot, null);
  }

  // ------------------------------------------------------------ channels, and what is in view

  function addToolbar() {
    const toolbar = document.getElementById("toolbar");
    for (const group of data.groups) {
      toolbar.appendChild(document.createElement("span")).textContent = group.name + (group.unit ? " (" + group.unit + ")" : "");
      channels.forEach((channel, row) => {
        if (channel.group !== group) return;
        const button = toolbar.appendChild(document.createElement("button"));
        button.type = "button";
        button.setAttribute("aria-pressed", "true");
        button.appendChild(document.createElement("i")).style.background = "var(--series-" + channel.index % 6 + ")";
        button.append(channel.name);
        button.addEventListener("click", () => toggle(row, button));
      });
    }
    const cut = data.groups.filter(group => group.cut).map(group => group.name);
    if (cut.length) document.getElementById("cut").textContent = " Rare peaks beyond the axis are cut: " + cut.join(", ") + ".";
  }

  function toggle(row, button) {
    if (hidden.has(row)) hidden.delete(row); else hidden.add(row);
    button.setAttribute("aria-pressed", String(!hidden.has(row)));
    redraw();
    plots.forEach(plot => { if (plot.sample !== null) show(plot, plot.sample); });
  }

  function redraw() {
    plots.filter(plot => plot.visible).forEach(draw);
  }

  const observer = new IntersectionObserver(entries => entries.forEach(entry => {
    const plot = plots.find(candidate => candidate.element === entry.target);
    plot.visible = entry.isIntersecting;
    if (plot.visible) draw(plot); else plot.canvas.width = plot.canvas.height = 0;
  }), { rootMargin: "300px" });

  addToolbar();
  plots.forEach(connect);
  plots.forEach(plot => observer.observe(plot.element));
  let lastWidth = 0;
  new ResizeObserver(() => {
    if (document.body.clientWidth === lastWidth) return;
    lastWidth = document.body.clientWidth;
    redraw();
  }).observe(document.body);
  /** Redraws when the pixels get another size, by a zoom or another screen; that may happen after the change of the width. */
  function watchResolution() {
    const query = matchMedia(`(resolution: ${window.devicePixelRatio}dppx)`);
    query.addEventListener("change", () => { redraw(); watchResolution(); }, { once: true });
  }
  watchResolution();
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
  window.addEventListener("beforeprint", () => plots.forEach(draw));
  window.statesPage = { show: (trial, time) => show(plots[trial], nearestSample(plots[trial].trial.time, time)), ready: true };
})();
