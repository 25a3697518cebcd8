// Sounds: a tick of the scanning frame, and texts read aloud.

let context = null;

/** A short tick; browsers allow it after the first press. */
export function tick(high = false) {
  context ||= new AudioContext();
  if (context.state === "suspended") {
    context.resume();
    return;
  }
  const tone = context.createOscillator();
  const volume = context.createGain();
  tone.frequency.value = high ? 880 : 520;
  volume.gain.setValueAtTime(0.08, context.currentTime);
  volume.gain.exponentialRampToValueAtTime(0.001, context.currentTime + 0.07);
  tone.connect(volume).connect(context.destination);
  tone.start();
  tone.stop(context.currentTime + 0.08);
}

/** Three high ticks: an alarm. */
export function alarm() {
  for (const wait of [0, 200, 400]) setTimeout(() => tick(true), wait);
}

/** Reads a text aloud; a second call while it reads ends it. Returns whether it can. */
export function readAloud(words) {
  if (!("speechSynthesis" in window)) return false;
  if (speechSynthesis.speaking) {
    speechSynthesis.cancel();
    return true;
  }
  speechSynthesis.speak(new SpeechSynthesisUtterance(words));
  return true;
}
