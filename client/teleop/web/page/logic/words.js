// Conditions of a task and the state of the recording, in words for the person who
// drives. Pure.

/** Words of a condition that the person must reach, by the name of its predicate. */
const AIMS = {
  lifted_and_held: (object) => `${object} in the hand`,
  lifted_before: (object) => `${object} lifted`,
  inside: (object, place) => `${object} on the ${place}`,
  in_lap: (object) => `${object} in the lap`,
  upright: (object) => `${object} upright`,
  at_rest: (object) => `${object} at rest`,
  released: (object) => `${object} let go`,
  opened_by: (joint) => `${joint} open`,
  closed_to: (joint) => `${joint} closed`,
  at_mouth: (object) => `${object} at the mouth`,
};

/** Words of a condition that must only stay true. */
const RULES = {
  correct_instance: () => "only the right object lifted",
  chair_stopped: () => "chair at rest",
  nothing_knocked_over: () => "nothing knocked over",
  no_hard_collision: () => "no hard contact",
  clear_of_person: () => "nothing presses the person",
  gentle_on_face: () => "gentle on the face",
  kept_level: (object) => `${object} kept level`,
};

const plain = (name) => name.replaceAll("_", " ").trim();

/** Names of the predicates that have words. */
export const PREDICATES = [...Object.keys(AIMS), ...Object.keys(RULES)];

/**
 * A condition in words: {words, aim, holds}; `aim` when the person must reach it. A
 * condition is named as in `inside(knife, placemat)`.
 */
export function condition({ name, holds }) {
  const [, word, inner] = /^([a-z_]+)(?:\((.*)\))?$/.exec(name) || [null, name, ""];
  const names = (inner || "").split(",").map(plain);
  const aim = Object.hasOwn(AIMS, word);
  const made = aim ? AIMS[word] : Object.hasOwn(RULES, word) ? RULES[word] : () => plain(name);
  return { words: made(...names), aim, holds };
}

/** "bottle in the hand: not yet". */
export const said = ({ words, aim, holds }) => `${words}: ${holds ? "yes" : aim ? "not yet" : "NO"}`;

/** Minutes and seconds. */
export const clock = (seconds) => {
  const whole = Math.max(0, Math.floor(seconds || 0));
  return `${Math.floor(whole / 60)}:${String(whole % 60).padStart(2, "0")}`;
};

/** Bytes in words. */
export const size = (bytes) =>
  (bytes < 1e6 ? `${Math.round(bytes / 1e3)} kB` : bytes < 1e9 ? `${Math.round(bytes / 1e6)} MB` : `${(bytes / 1e9).toFixed(1)} GB`);

/** Whether an episode runs that should be recorded, and no recorder records it. */
export function unrecorded(s) {
  if (!s?.episode || s.episode.practice || !s.recorders) return false;
  return !s.recorders.some((one) => ["ready", "finishing"].includes(one.state));
}

/** State of the recording: {text, state}; state is "", "good", "careful" or "bad". */
export function recording(s) {
  const recorders = s.recorders || [];
  const missed = recorders.reduce((total, one) => total + (one.missed || 0), 0);
  if (s.episode?.practice) return { text: `Practice ${clock(s.episode.seconds)}: nothing is kept`, state: "careful" };
  if (recorders.some((one) => one.state === "failed")) return { text: "Recorder FAILED", state: "bad" };
  if (recorders.some((one) => one.silent_s)) return { text: "The recorder DOES NOT ANSWER", state: "bad" };
  if (unrecorded(s)) return { text: "NOTHING IS RECORDED", state: "bad" };
  if (missed > 0) return { text: `Recording: ${missed} samples missed`, state: "bad" };
  if (s.episode) {
    const images = recorders.reduce((total, one) => Math.max(total, one.frames || 0), 0);
    const much = s.recorded_bytes ? size(s.recorded_bytes) : `${images} images`;
    return { text: `● Recording ${clock(s.episode.seconds)}, ${much}`, state: "good" };
  }
  if (recorders.some((one) => one.state === "finishing")) return { text: "Writing the file …", state: "" };
  return recorders.length > 0 ? { text: "Not recording", state: "" } : { text: "No recorder", state: "careful" };
}
