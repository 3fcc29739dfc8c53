// Sound on request: the contact load drives pitch and volume of a tone; touch and full insertion have short sounds.
(function () {
  const {byId, onButton, onValues, contactLoad, isInserted, TOUCH_LOAD} = livePanel;
  const LOW = 160, OCTAVES = 1.5;  // Hz without load, and octaves up to the limit
  const QUIET = 0.03, LOUD = 0.15;  // volume at a touch and at the limit
  const ALARM = 0.06, PULSES = 9;  // volume and Hz of the rough tone above the limit
  const SMOOTHING = 0.03;  // s
  let voices = null;  // made on request: browsers allow no sound before a gesture
  let isOn = false, hasTouched = false, wasRecording = false;

  /** A tone that lasts; returns its frequency and its volume. */
  function makeTone(context, output, type) {
    const oscillator = new OscillatorNode(context, {type, frequency: LOW});
    const volume = new GainNode(context, {gain: 0});
    oscillator.connect(volume).connect(output);
    oscillator.start();
    return {frequency: oscillator.frequency, volume: volume.gain};
  }

  function makeVoices() {
    const context = new AudioContext();
    const analyser = new AnalyserNode(context, {fftSize: 8192, smoothingTimeConstant: 0});
    analyser.connect(context.destination);
    const pulsed = new GainNode(context, {gain: 0.5});
    pulsed.connect(analyser);
    const pulse = new OscillatorNode(context, {type: "square", frequency: PULSES});
    pulse.connect(new GainNode(context, {gain: 0.5})).connect(pulsed.gain);
    pulse.start();
    return {context, analyser, soft: makeTone(context, analyser, "triangle"),
      rough: makeTone(context, pulsed, "sawtooth")};
  }

  /** A short sound of one note after another, Hz. */
  function ring(notes, duration, volume) {
    const {context, analyser} = voices;
    notes.forEach((frequency, number) => {
      const start = context.currentTime + number * duration, end = start + 2 * duration;
      const note = new OscillatorNode(context, {frequency});
      const level = new GainNode(context, {gain: 0});
      level.gain.setValueAtTime(volume, start);
      level.gain.exponentialRampToValueAtTime(1e-4, end);
      note.connect(level).connect(analyser);
      note.start(start);
      note.stop(end);
    });
  }

  function approach(parameter, value) {
    parameter.setTargetAtTime(value, voices.context.currentTime, SMOOTHING);
  }

  function playTones(load, limit) {
    const share = Math.min(load / limit, 1), isAbove = load > limit;
    for (const tone of [voices.soft, voices.rough]) approach(tone.frequency, LOW * 2 ** (OCTAVES * share));
    approach(voices.soft.volume, load > TOUCH_LOAD && !isAbove ? QUIET + (LOUD - QUIET) * share : 0);
    approach(voices.rough.volume, isAbove ? ALARM : 0);
  }

  onValues(values => {
    const isRecording = values.phase === "recording", load = contactLoad(values);
    const touches = isRecording && load > TOUCH_LOAD && !hasTouched;
    const inserts = wasRecording && !isRecording && isInserted(values);
    hasTouched = isRecording && (hasTouched || touches);
    wasRecording = isRecording;
    if (!isOn) return;
    playTones(isRecording ? load : 0, values.contact ? values.contact.limit : 1);
    if (touches) ring([880], 0.05, 0.2);
    if (inserts) ring([523, 784], 0.12, 0.2);
  });

  onButton("sound", "KeyM", () => {
    isOn = !isOn;
    voices ??= makeVoices();
    livePanel.analyser = voices.analyser;
    if (isOn) voices.context.resume(); else voices.context.suspend();
    byId("sound-state").textContent = isOn ? "sound on" : "sound off";
    byId("sound").setAttribute("aria-pressed", isOn);
  });
})();
