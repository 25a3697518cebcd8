// Keys of a keyboard: those of `wheelarm teleop`, the arrows and WASD. Pure.
// Keys are identified by position (KeyboardEvent.code), so that every layout has the same
// hand position.

export const KEY_DEFAULTS = {
  ArrowUp: "chair.forward", ArrowDown: "chair.back", ArrowLeft: "chair.left", ArrowRight: "chair.right",
  KeyW: "chair.forward", KeyS: "chair.back", KeyA: "chair.left", KeyD: "chair.right",
  KeyI: "chair.forward", Comma: "chair.back", KeyJ: "chair.left", KeyL: "chair.right",
  KeyU: "chair.forward+chair.left", KeyO: "chair.forward+chair.right",
  KeyM: "chair.back+chair.right", Period: "chair.back+chair.left",
  KeyV: "hand.forward", KeyN: "hand.back", KeyH: "hand.left", KeyF: "hand.right",
  KeyG: "hand.up", KeyB: "hand.down",
  KeyR: "grip.close", KeyY: "grip.open",
  KeyK: "stop", Space: "turning",
  Digit1: "speed1", Digit2: "speed2", Digit3: "speed3", Digit4: "speed4", Digit5: "speed5",
  Minus: "slower", Equal: "faster",
};

/** The hand keys turn the hand while "turning" is on. */
const TURNED = {
  "hand.forward": "turn.pitch_plus", "hand.back": "turn.pitch_minus",
  "hand.left": "turn.yaw_plus", "hand.right": "turn.yaw_minus",
  "hand.up": "turn.roll_plus", "hand.down": "turn.roll_minus",
};

/** Action of a key, or null. Esc always stops. With Ctrl, Alt or Meta it belongs to the browser. */
export function meaning(event, keys, turning) {
  if (event.code === "Escape") return "stop";
  if (event.ctrlKey || event.altKey || event.metaKey) return null;
  const action = keys[event.code] || null;
  return turning && TURNED[action] ? TURNED[action] : action;
}

/** Label of a key. */
export function keyName(code) {
  const names = { ArrowUp: "↑", ArrowDown: "↓", ArrowLeft: "←", ArrowRight: "→", Comma: ",", Period: ".",
    Minus: "-", Equal: "=", Space: "Space", Escape: "Esc" };
  return names[code] || code.replace(/^(Key|Digit)/, "");
}

/** Assigns the key `code` to `action` instead of `old`; the key loses its former action. */
export function remap(keys, old, code, action) {
  const made = { ...keys };
  if (old) delete made[old];
  delete made[code];
  if (code !== "Escape") made[code] = action;
  return made;
}
