// Shows the values of the session; `LivePage.show` lists their names and units.
(function () {
  const {byId, formatNumber, onValues} = livePanel;
  const SLOW = 0.95;  // simulated over wall-clock time, below which the page warns; a reading of real time varies by 4 %
  const SCALE = 0.8;  // share of the bar of the contact load at which its limit is

  // Text of each value by the id of its element.
  const formats = {
    force: force => formatNumber(force, 2) + " N",
    moment: moment => formatNumber(1e3 * moment, 1) + " N mm",
    depth: depth => formatNumber(1e3 * depth.tip, 2) + " of " + formatNumber(1e3 * depth.full, 1) + " mm",
    rate: rate => formatNumber(100 * rate, 0) + " %",
    deadlines: d => d.late_steps + " of " + d.steps + " contact steps, " + d.late_ticks + " of " + d.ticks + " servo ticks",
    energy: energy => formatNumber(1e3 * energy, 2) + " mJ",
    min_energy: energy => formatNumber(1e3 * energy, 2) + " mJ",
    kept: count => String(count),
    status: message => message,
  };

  /** Shows the load of the device in the colour of the force. */
  function showLoad({load, colour}) {
    const percent = formatNumber(100 * load, 0) + " % of the device limit";
    byId("gauge-fill").style.width = 100 * Math.min(load, 1) + "%";
    byId("gauge-fill").style.background = colour;
    byId("card").classList.toggle("saturated", load >= 1);
    byId("gauge-text").textContent = load >= 1 ? "saturated: " + percent : percent;
  }

  /** Shows the contact load beside the limit of the rig's guard; null shows nothing. */
  function showContact(contact, isHand) {
    byId("contact").hidden = !contact;
    if (!contact) return;
    const place = load => 100 * Math.min(SCALE * load / contact.limit, 1) + "%";
    const newtons = load => formatNumber(load, load < 99.95 ? 1 : 0) + " N";
    const state = contact.load > contact.limit ? "above" : contact.held ? "held" : "below";
    byId("contact").dataset.state = state;
    byId("contact-fill").style.width = place(contact.load);
    byId("contact-peak-mark").style.left = place(contact.peak);
    byId("contact-limit-mark").style.left = place(contact.limit);
    byId("contact-load").textContent = newtons(contact.load);
    byId("contact-peak").textContent = newtons(contact.peak);
    byId("contact-peak").classList.toggle("bad", contact.peak > contact.limit);
    byId("contact-limit").textContent = formatNumber(contact.limit, 0) + " N";
    const would = isHand ? "would " : "", s = isHand ? "" : "s";
    const notes = {above: `the rig ${would}stop${s} here`, held: `the rig ${would}slow${s} the feed`, below: "\u00a0"};
    byId("contact-note").textContent = notes[state];
  }

  /** Shows the tilt of the peg; a ring of the dial has 10 units. */
  function showTilt(tilt) {
    const x = 10 * tilt.right, y = -10 * tilt.away;
    byId("tilt").setAttribute("x2", x);
    byId("tilt").setAttribute("y2", y);
    byId("tilt-end").setAttribute("cx", x);
    byId("tilt-end").setAttribute("cy", y);
  }

  /** Shows the contact state that the skill sees, and what it would do; null shows nothing. */
  function showSkill(skill) {
    byId("skill").hidden = !skill;
    byId("skill-turn").setAttribute("visibility", skill ? "visible" : "hidden");
    if (!skill) return;
    byId("skill-state").textContent = skill.state + (skill.known ? "" : " (unlike any demonstration)");
    byId("skill-state").style.setProperty("--state", skill.colour);
    byId("skill-feed").textContent = formatNumber(-1e3 * skill.feed, 1) + " mm/s";
    byId("skill-rate").textContent = formatNumber(180 / Math.PI * skill.turn, 1) + " °/s";
    for (const [end, tilt] of [["1", skill.tilt], ["2", skill.turned]]) {
      byId("skill-turn").setAttribute("x" + end, 10 * tilt.right);
      byId("skill-turn").setAttribute("y" + end, -10 * tilt.away);
    }
  }

  /** Warns while a demonstration is recorded below real time, and before one if the self-test was below it. */
  function showSlowness({rate, pace, phase}) {
    const found = {recording: rate, ready: pace}[phase];
    const isSlow = found > 0 && found < SLOW;
    byId("slow").hidden = !isSlow;
    if (isSlow) {
      byId("slow").firstElementChild.textContent = `SLOW: ${formatNumber(100 * found, 0)} % of real time`;
    }
  }

  onValues(values => {
    for (const id in formats) if (id in values) byId(id).textContent = formats[id](values[id]);
    if ("load" in values) showLoad(values);
    if ("hand" in values) byId("overlay").classList.toggle("no-hand", !values.hand);
    if ("contact" in values) showContact(values.contact, values.hand !== false);
    if ("tilt" in values) showTilt(values.tilt);
    if ("skill" in values) showSkill(values.skill);
    showSlowness(values);
  });
})();
