// Whether driving is allowed and why not, and the age of the loop in words. Pure.

/** Without a situation for this long the connection to the gateway counts as lost, ms. */
const SILENT_MS = 1500;

/**
 * Why driving is not allowed: {reason, why, stepsOnly}; an empty reason when it is.
 * `s` is the newest situation or null; `frozenMs` the age of the oldest painted image.
 */
export function rights({ s, silenceMs, role, lanes, frozenMs, hidden, away, alarm = false }) {
  const no = (reason, why = "guard") => ({ reason, why, stepsOnly: false });
  if (!s || silenceMs > SILENT_MS) return no("The gateway does not answer");
  if (role === "viewer") return no("You are watching: this name may not drive");
  if (lanes === 0) return no("No connection for commands");
  if (hidden) return no("The page is hidden", "hidden");
  if (s.link !== "open") return no("The gateway has no connection to the robot");
  if (!s.lease?.mine) {
    return s.lease?.holder ? no(`${s.lease.holder} is in control`) : no("No operator is in control: the first press takes it", "free");
  }
  if (away) return no("Driving is off while the settings are open");
  if (alarm) return no("Read the alarm first");
  if (s.paused) return no("Time is paused");
  if (s.control?.allow === "stop") return no(s.control.why || "Only STOP is allowed now", "frozen");
  if (frozenMs > 1000) return no("The image is frozen: only STOP", "frozen");
  return { reason: "", why: "", stepsOnly: s.control?.allow === "steps" };
}

/** The age of the loop and its effect on the speed: {text, state}. */
export function loopAge(control) {
  if (!control || control.age_ms === null || control.age_ms === undefined) return { text: "–", state: "" };
  const age = control.age_ms < 950 ? `${Math.round(control.age_ms / 10) * 10} ms` : `${(control.age_ms / 1000).toFixed(1)} s`;
  if (control.allow === "stop") return { text: `${age}, only STOP`, state: "bad" };
  if (control.allow === "steps") return { text: `${age}, only steps`, state: "careful" };
  const share = control.cap?.share ?? 1;
  if (share < 0.995) {
    return { text: `${age}, at most ${control.cap.chair.toFixed(2)} m/s`, state: "careful" };
  }
  return { text: age, state: "good" };
}
