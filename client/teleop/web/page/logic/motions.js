// The directions in which the robot can be moved, and sums of them. Pure.

/** A direction: part of the robot, index of its axis, label and symbol of the button. */
const motion = (part, axis, sign, label, words, glyph) => ({ part, axis, sign, label, words, glyph });

export const MOTIONS = {
  "chair.forward": motion("chair", 0, 1, "Forward", "chair forward", "▲"),
  "chair.back": motion("chair", 0, -1, "Back", "chair back", "▼"),
  "chair.left": motion("chair", 1, 1, "Turn left", "chair turn left", "↺"),
  "chair.right": motion("chair", 1, -1, "Turn right", "chair turn right", "↻"),
  "hand.forward": motion("hand", 0, 1, "Forward", "hand forward", "▲"),
  "hand.back": motion("hand", 0, -1, "Back", "hand back", "▼"),
  "hand.left": motion("hand", 1, 1, "Left", "hand left", "◀"),
  "hand.right": motion("hand", 1, -1, "Right", "hand right", "▶"),
  "hand.up": motion("hand", 2, 1, "Up", "hand up", "⤒"),
  "hand.down": motion("hand", 2, -1, "Down", "hand down", "⤓"),
  "turn.roll_plus": motion("turn", 0, 1, "Roll right", "hand: roll right", "⟳"),
  "turn.roll_minus": motion("turn", 0, -1, "Roll left", "hand: roll left", "⟲"),
  "turn.pitch_plus": motion("turn", 1, 1, "Tip down", "hand: tip down", "⤵"),
  "turn.pitch_minus": motion("turn", 1, -1, "Tip up", "hand: tip up", "⤴"),
  "turn.yaw_plus": motion("turn", 2, 1, "Swing left", "hand: swing left", "↰"),
  "turn.yaw_minus": motion("turn", 2, -1, "Swing right", "hand: swing right", "↱"),
  "grip.open": motion("grip", 0, 1, "Open", "gripper: open", "◁▷"),
  "grip.close": motion("grip", 0, -1, "Close", "gripper: close", "▷◁"),
};

/** The pads of the page: a name, a label, and the positions of the buttons in three columns. */
export const PADS = {
  chair: { label: "Chair", rows: [["", "chair.forward", ""], ["chair.left", "chair.back", "chair.right"]] },
  hand: {
    label: "Hand",
    rows: [["hand.up", "hand.forward", "hand.down"], ["hand.left", "hand.back", "hand.right"]],
  },
  turn: {
    label: "Turn hand",
    rows: [["turn.roll_minus", "turn.pitch_minus", "turn.roll_plus"],
      ["turn.yaw_plus", "turn.pitch_plus", "turn.yaw_minus"]],
  },
  grip: { label: "Gripper", rows: [["grip.open"], ["grip.close"]] },
};

/** All axes at rest. */
export const still = () => ({ chair: [0, 0], hand: [0, 0, 0], turn: [0, 0, 0], grip: 0 });

/** The axes of one direction, or of several at once ("chair.forward+chair.left"). */
export function axesOf(names, amount = 1) {
  const axes = still();
  for (const name of names.split("+")) {
    const { part, axis, sign } = MOTIONS[name];
    if (part === "grip") axes.grip += sign * amount;
    else axes[part][axis] += sign * amount;
  }
  return axes;
}

const clamp = (value) => Math.max(-1, Math.min(1, value));

/** The sum of several axes, each within -1 to 1. */
export function sum(parts) {
  const total = still();
  for (const axes of parts) {
    for (const part of ["chair", "hand", "turn"]) {
      (axes[part] || []).forEach((value, index) => { total[part][index] += value; });
    }
    total.grip += axes.grip || 0;
  }
  for (const part of ["chair", "hand", "turn"]) total[part] = total[part].map(clamp);
  total.grip = clamp(total.grip);
  return total;
}

/** Whether every axis is zero. */
export const isStill = (axes) =>
  ["chair", "hand", "turn"].every((part) => (axes[part] || []).every((value) => value === 0)) && !axes.grip;

/** The names of the directions in which these axes point. */
export function directions(axes) {
  return Object.keys(MOTIONS).filter((name) => {
    const { part, axis, sign } = MOTIONS[name];
    const value = part === "grip" ? axes.grip : axes[part][axis];
    return value * sign > 0;
  });
}
