// Settings of a person: presets, their changes, and the file for another
// browser. Pure. A file from outside is checked value by value.

import { DWELL_DEFAULTS } from "./dwell.js";
import { DEADZONE } from "./gamepad.js";
import { KEY_DEFAULTS } from "./keys.js";
import { MOTIONS, PADS } from "./motions.js";
import { SCAN_DEFAULTS } from "./scan.js";

export const MODES = ["hold", "latch", "step"];
export const THEMES = ["auto", "light", "dark"];
const SIZES = { least: 64, most: 160 };

const BASE = {
  version: 1,
  preset: "keyboard",
  mode: "hold",
  speed: 3,
  theme: "auto",
  sound: true,
  keysOn: true,
  keys: KEY_DEFAULTS,
  scan: { ...SCAN_DEFAULTS, on: false },
  dwell: { ...DWELL_DEFAULTS, on: false },
  voice: { on: false, local: true },
  gamepad: { deadzone: DEADZONE, maps: {} },
  pads: Object.keys(PADS).map((name) => ({ name, size: 72, hidden: false })),
  tabs: "narrow",
};

/** The presets: labels, and their differences from the base. */
export const PRESETS = {
  keyboard: { label: "Keyboard", words: "Keys drive while they are held.", change: {} },
  touch: {
    label: "Touch screen or mouse", words: "Buttons drive while they are held.",
    change: { pads: BASE.pads.map((pad) => ({ ...pad, size: 84 })) },
  },
  gamepad: {
    label: "Gamepad or joystick", words: "A stick drives; one button goes on, one stops.",
    change: {},
  },
  one_switch: {
    label: "One switch", words: "A frame goes round; the switch chooses the framed item. Every press moves one step.",
    change: { mode: "step", scan: { ...BASE.scan, on: true, kind: "rows" }, keysOn: false, tabs: "never",
      pads: BASE.pads.map((pad) => ({ ...pad, size: 80 })) },
  },
  two_switches: {
    label: "Two switches", words: "The first switch (Space) moves the frame, the second one (Enter) chooses.",
    change: { mode: "step", scan: { ...BASE.scan, on: true, kind: "two" }, keysOn: false, tabs: "never" },
  },
  dwell: {
    label: "Eye tracker or head mouse", words: "Resting the pointer on a button presses it. Every press moves one step.",
    change: { mode: "step", dwell: { ...BASE.dwell, on: true }, keysOn: false,
      pads: BASE.pads.map((pad) => ({ ...pad, size: 112 })) },
  },
  voice: {
    label: "Voice", words: "Press to talk, then say one phrase. Every phrase moves one step.",
    change: { mode: "step", voice: { ...BASE.voice, on: true } },
  },
};

/** The settings of a preset. */
export function preset(name) {
  const { change } = PRESETS[name];
  return structuredClone({ ...BASE, ...change, preset: name });
}

const number = (value, least, most, usual) =>
  (typeof value === "number" && Number.isFinite(value) ? Math.min(most, Math.max(least, value)) : usual);
const among = (value, list, usual) => (list.includes(value) ? value : usual);
const flag = (value, usual) => (typeof value === "boolean" ? value : usual);
const object = (value) => (value && typeof value === "object" && !Array.isArray(value) ? value : {});

const ACTIONS = new Set([...Object.keys(MOTIONS), ...Object.values(KEY_DEFAULTS)]);

/** Validated settings; missing or invalid values are those of the preset. */
export function checked(from) {
  const given = object(from);
  const usual = preset(among(given.preset, Object.keys(PRESETS), "keyboard"));
  const scan = object(given.scan);
  const dwell = object(given.dwell);
  const pads = Array.isArray(given.pads) ? given.pads.map(object) : [];
  const known = pads.filter((pad, index) =>
    Object.hasOwn(PADS, pad.name) && pads.findIndex((other) => other.name === pad.name) === index);
  const missing = usual.pads.filter((pad) => !known.some((other) => other.name === pad.name));
  const keys = Object.entries(object(given.keys)).filter(([code, action]) =>
    /^[A-Za-z0-9]{1,20}$/.test(code) && ACTIONS.has(action));
  return {
    version: 1,
    preset: usual.preset,
    mode: among(given.mode, MODES, usual.mode),
    speed: Math.round(number(given.speed, 1, 5, usual.speed)),
    theme: among(given.theme, THEMES, usual.theme),
    sound: flag(given.sound, usual.sound),
    keysOn: flag(given.keysOn, usual.keysOn),
    keys: keys.length > 0 ? Object.fromEntries(keys) : usual.keys,
    scan: {
      on: flag(scan.on, usual.scan.on),
      kind: among(scan.kind, ["rows", "linear", "two"], usual.scan.kind),
      interval: number(scan.interval, 500, 5000, usual.scan.interval),
      first: number(scan.first, 0, 3000, usual.scan.first),
      loops: Math.round(number(scan.loops, 1, 20, usual.scan.loops)),
      hold: number(scan.hold, 0, 2000, usual.scan.hold),
      debounce: number(scan.debounce, 0, 3000, usual.scan.debounce),
    },
    dwell: {
      on: flag(dwell.on, usual.dwell.on),
      time: number(dwell.time, 300, 3000, usual.dwell.time),
      radius: number(dwell.radius, 5, 60, usual.dwell.radius),
      stop: number(dwell.stop, 200, 1000, usual.dwell.stop),
    },
    voice: { on: flag(object(given.voice).on, usual.voice.on), local: flag(object(given.voice).local, true) },
    gamepad: {
      deadzone: number(object(given.gamepad).deadzone, 0.02, 0.6, usual.gamepad.deadzone),
      maps: gamepadMaps(object(object(given.gamepad).maps)),
    },
    pads: [...known, ...missing].map((pad) => ({
      name: pad.name,
      size: number(pad.size, SIZES.least, SIZES.most, 72),
      hidden: flag(pad.hidden, false),
    })),
    tabs: among(given.tabs, ["narrow", "always", "never"], usual.tabs),
  };
}

const MAP_NAMES = ["axes", "second", "stop", "next", "close", "open", "down", "up", "take", "slower", "faster"];

function gamepadMaps(maps) {
  const index = (value) => Number.isInteger(value) && value >= 0 && value < 64;
  return Object.fromEntries(Object.entries(maps).slice(0, 32).map(([id, map]) => [
    id.slice(0, 200),
    Object.fromEntries(Object.entries(object(map)).filter(([name, list]) =>
      MAP_NAMES.includes(name) && Array.isArray(list) && list.every(index)
      // A device without STOP may not drive.
      && (name !== "stop" || list.length > 0) && (name !== "axes" || list.length === 2))),
  ]));
}

/** Moves a pad one position on (1) or back (-1). */
export function movePad(pads, name, by) {
  const made = [...pads];
  const from = made.findIndex((pad) => pad.name === name);
  const to = Math.max(0, Math.min(made.length - 1, from + by));
  made.splice(to, 0, ...made.splice(from, 1));
  return made;
}

/** Enlarges or shrinks a pad by a number of pixels. */
export function sizePad(pads, name, by) {
  return pads.map((pad) => (pad.name === name
    ? { ...pad, size: Math.max(SIZES.least, Math.min(SIZES.most, pad.size + by)) } : pad));
}
