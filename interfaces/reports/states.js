// Reads the values of a recording at a cursor, which the pointer or the arrow keys move.

document.querySelectorAll(".plot").forEach(plot => {
  const curves = [...plot.querySelectorAll("path[data-name]")];
  const line = plot.querySelector(".cursor"), readout = plot.nextElementSibling;
  const probability = plot.dataset.probability.split(" ");
  const bands = [...plot.querySelectorAll(".band")];
  let times, values, sample = 0;  // times in 0.1 ms; values in steps, with the sign of the drawing

  /** Takes the numbers from the drawing when they are needed first. */
  function read() {
    const numbers = curves.map(curve => curve.getAttribute("d").match(/-?\d+/g).map(Number));
    times = numbers[0].filter((_, k) => k % 2 === 0);
    values = numbers.map(all => all.filter((_, k) => k % 2));
  }

  /** The run of a band that holds a sample. */
  const runAt = (band, k) => [...band.children].findLast(run => run.dataset.first <= k);

  function reading(curve, k) {
    const { step, digits } = curve.ownerSVGElement.dataset;
    const value = -values[curves.indexOf(curve)][k] * step;
    return curve.dataset.name + " " + (Math.abs(value) < 0.5 * 10 ** -digits ? 0 : value).toFixed(digits);
  }

  /** Shows time, state, phase and values of a sample. */
  function show(k) {
    sample = Math.max(0, Math.min(times.length - 1, k));
    const parts = [(times[sample] / 1e4).toFixed(2) + " s", ...bands.map(band => runAt(band, sample).title)];
    parts[1] += " (" + probability[sample] + " %)";
    for (const panel of plot.querySelectorAll("svg")) {
      const texts = curves.filter(curve => curve.ownerSVGElement === panel).map(curve => reading(curve, sample));
      parts.push(texts.join("  ") + " " + panel.dataset.unit);
    }
    line.style.left = 100 * times[sample] / times[times.length - 1] + "%";
    readout.textContent = parts.join(" | ");
    plot.setAttribute("aria-valuenow", times[sample] / 1e4);
    plot.setAttribute("aria-valuetext", readout.textContent);
  }

  plot.addEventListener("pointermove", event => {
    if (!times) read();
    const box = plot.getBoundingClientRect();
    const time = times[times.length - 1] * (event.clientX - box.left) / box.width;
    show(times.reduce((best, other, k) => Math.abs(other - time) < Math.abs(times[best] - time) ? k : best, 0));
  });
  plot.addEventListener("keydown", event => {
    if (!times) read();
    const starts = [...bands[0].children].map(run => Number(run.dataset.first));
    const next = starts.find(first => first > sample) ?? times.length, before = starts.findLast(first => first < sample) ?? 0;
    const targets = { ArrowRight: event.shiftKey ? next : sample + 1, ArrowLeft: event.shiftKey ? before : sample - 1, Home: 0, End: times.length };
    if (!(event.key in targets)) return;
    event.preventDefault();
    show(targets[event.key]);
  });
});
