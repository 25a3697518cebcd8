// Gamepads, joysticks, adaptive controllers: buttons and axes in, directions and
// presses out. Pure: its input is the result of `navigator.getGamepads()`.
//
// One stick and two buttons are enough: one selects the next pad, one stops.

import { MOTIONS, still } from "./motions.js";

export const DEADZONE = 0.12;

/** Axes of the main stick, in the order of the "next" button: [up/down, left/right]. */
export const STICK_MODES = [
  { name: "chair", label: "Chair", axes: [["chair", 0], ["chair", 1]] },
  { name: "hand", label: "Hand", axes: [["hand", 0], ["hand", 1]] },
  { name: "height", label: "Hand up and down, swing", axes: [["hand", 2], ["turn", 2]] },
  { name: "tip", label: "Tip and roll the hand", axes: [["turn", 1, -1], ["turn", 0, -1]] },
  { name: "grip", label: "Gripper", axes: [["grip", 0], null] },
  // The stick moves a frame over the buttons of the page: down goes on, right presses.
  { name: "menu", label: "Buttons of the page", axes: [null, null] },
];

/** Button and axis numbers of the standard layout. */
export const STANDARD = {
  axes: [0, 1], second: [2, 3],
  stop: [1, 8], next: [0], close: [4], open: [5], down: [6], up: [7], take: [2], slower: [14], faster: [15],
};
/** For a device with an unknown layout: the first stick, the first two buttons. */
export const PLAIN = {
  axes: [0, 1], second: [], stop: [1], next: [0], close: [], open: [], down: [], up: [], take: [],
  slower: [], faster: [],
};

/** Removes the dead zone; full deflection at the rim. */
export function shaped(value, deadzone = DEADZONE) {
  const size = Math.abs(value);
  if (!(size > deadzone)) return 0;
  return Math.sign(value) * Math.min(1, (size - deadzone) / (1 - deadzone));
}

const pressed = (button) => Boolean(button) && (button.pressed || button.value > 0.5);

export class Gamepads {
  /** `maps`: device id -> a map like STANDARD, as the person saved it. */
  constructor(maps = {}, deadzone = DEADZONE) {
    this.maps = maps;
    this.deadzone = deadzone;
    this.pads = new Map();
    this.mode = 0;
  }

  /** Buttons and axes of this device. */
  map(pad) {
    return { ...(pad.mapping === "standard" ? STANDARD : PLAIN), ...this.maps[pad.id] };
  }

  /**
   * Reads all devices. Returns {axes, presses, arrived, gone, waiting, menu, stick}: presses are
   * names of the map that were pressed since the last call; `gone` are ids of devices
   * that were unplugged; `waiting` are those that were not centered yet.
   */
  read(list) {
    const out = { axes: still(), presses: [], arrived: [], gone: [], waiting: [], menu: null, stick: [0, 0] };
    const present = new Set();
    for (const pad of list) {
      if (!pad || !pad.connected) continue;
      const key = `${pad.index}:${pad.id}`;
      present.add(key);
      let known = this.pads.get(key);
      if (!known) {
        known = { id: pad.id, armed: false, down: new Set() };
        this.pads.set(key, known);
        out.arrived.push(pad.id);
      }
      this.one(pad, known, out);
    }
    for (const [key, known] of this.pads) {
      if (present.has(key)) continue;
      this.pads.delete(key);
      out.gone.push(known.id);
    }
    return out;
  }

  /** After blur, stop or plugging in, all devices must return to the center before they count. */
  disarm() {
    for (const known of this.pads.values()) known.armed = false;
  }

  one(pad, known, out) {
    const map = this.map(pad);
    const stick = (index) => shaped(pad.axes[index] ?? 0, this.deadzone);
    const sticks = [...map.axes, ...map.second].map(stick);
    const down = new Set();
    for (const name of ["stop", "next", "close", "open", "down", "up", "take", "slower", "faster"]) {
      if (map[name].some((index) => pressed(pad.buttons[index]))) down.add(name);
    }
    // STOP also works on a device that is not armed; its edge counts.
    const fresh = [...down].filter((name) => !known.down.has(name));
    const first = known.down.size === 0 && !known.sampled;
    known.sampled = true;
    known.down = down;
    if (!known.armed) {
      if (fresh.includes("stop") && !first) out.presses.push("stop");
      if (sticks.every((value) => value === 0) && down.size === 0) known.armed = true;
      else out.waiting.push(pad.id);
      return;
    }
    for (const name of fresh) out.presses.push(name);
    if (fresh.includes("next")) this.mode = (this.mode + 1) % STICK_MODES.length;
    const [x, y] = [stick(map.axes[0]), stick(map.axes[1])];
    if (x !== 0 || y !== 0) out.stick = [x, y];
    const [ahead, across] = STICK_MODES[this.mode].axes;
    if (!ahead && !across) out.menu = out.menu || this.menu(known, x, y);
    else known.tilted = true;
    this.add(out.axes, ahead, -y);
    this.add(out.axes, across, -x);
    if (map.second.length === 2) {
      out.axes.hand[0] += -stick(map.second[1]);
      out.axes.hand[1] += -stick(map.second[0]);
    }
    if (down.has("up")) out.axes.hand[2] += 1;
    if (down.has("down")) out.axes.hand[2] -= 1;
    if (down.has("open")) out.axes.grip += 1;
    if (down.has("close")) out.axes.grip -= 1;
  }

  /** A tilt of the stick in the menu: "next", "back" or "take", once each. */
  menu(known, x, y) {
    const tilted = Math.max(Math.abs(x), Math.abs(y)) > 0.5;
    const fresh = tilted && !known.tilted;
    if (tilted || Math.max(Math.abs(x), Math.abs(y)) < 0.25) known.tilted = tilted;
    if (!fresh) return null;
    if (Math.abs(y) >= Math.abs(x)) return y > 0 ? "next" : "back";
    return x > 0 ? "take" : "back";
  }

  add(axes, where, value) {
    if (!where || value === 0) return;
    const [part, axis, sign = 1] = where;
    if (part === "grip") axes.grip += value * sign;
    else axes[part][axis] += value * sign;
  }
}

/** The direction of the most tilted axis beyond the half, or null: one step of a stick. */
export function steepest(axes) {
  let best = null;
  let most = 0.5;
  for (const [name, { part, axis, sign }] of Object.entries(MOTIONS)) {
    const value = (part === "grip" ? axes.grip : axes[part][axis]) * sign;
    if (value > most) [best, most] = [name, value];
  }
  return best;
}
