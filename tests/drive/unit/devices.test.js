import assert from "node:assert/strict";
import { test } from "node:test";

import { Dwell } from "../../../client/teleop/web/page/logic/dwell.js";
import { Gamepads, STICK_MODES, shaped, steepest } from "../../../client/teleop/web/page/logic/gamepad.js";
import { KEY_DEFAULTS, meaning, remap } from "../../../client/teleop/web/page/logic/keys.js";
import { MOTIONS, axesOf, directions } from "../../../client/teleop/web/page/logic/motions.js";
import { Confirmation } from "../../../client/teleop/web/page/logic/confirmation.js";
import { GRAMMAR, saysStop, understand } from "../../../client/teleop/web/page/logic/voice.js";

test("dwelling clicks once, and again only after the pointer left", () => {
  const dwell = new Dwell({ time: 1000, radius: 30 });
  dwell.pointer(100, 100, "hand.up", 0);
  assert.equal(dwell.tick(990), null);
  assert.equal(dwell.tick(1000), "hand.up");
  assert.equal(dwell.tick(5000), null);
  dwell.pointer(110, 100, "hand.up", 5000);
  assert.equal(dwell.tick(9000), null);
  dwell.pointer(300, 100, null, 9000);
  dwell.pointer(100, 100, "hand.up", 9100);
  assert.equal(dwell.tick(10_100), "hand.up");
});

test("straying beyond the radius begins anew; STOP is quick and forgives straying", () => {
  const dwell = new Dwell({ time: 1000, radius: 30, stop: 300 });
  dwell.pointer(0, 0, "a", 0);
  dwell.pointer(40, 0, "a", 900);
  assert.equal(dwell.tick(1000), null);
  assert.equal(dwell.tick(1900), "a");
  dwell.pointer(500, 500, "stop", 2000);
  dwell.pointer(560, 560, "stop", 2200);
  assert.equal(dwell.tick(2300), "stop");
});

test("while dwelling rests only STOP and the rest button work", () => {
  const dwell = new Dwell({ time: 500 });
  dwell.resting = true;
  dwell.pointer(0, 0, "hand.up", 0);
  assert.equal(dwell.tick(5000), null);
  dwell.pointer(0, 0, "stop", 5000);
  assert.equal(dwell.tick(5400), "stop");
  dwell.pointer(0, 0, "rest", 6000);
  assert.equal(dwell.tick(6600), "rest");
});

const pad = (more = {}) => ({ id: "Pad", index: 0, connected: true, mapping: "standard", axes: [0, 0, 0, 0],
  buttons: Array.from({ length: 17 }, () => ({ pressed: false, value: 0 })), ...more });
const with_ = (indices, more = {}) => {
  const made = pad(more);
  for (const index of indices) made.buttons[index] = { pressed: true, value: 1 };
  return made;
};

test("a gamepad that is plugged in with its stick tilted drives only after centering", () => {
  const pads = new Gamepads();
  assert.deepEqual(pads.read([pad({ axes: [0, -1, 0, 0] })]).axes.chair, [0, 0]);
  assert.deepEqual(pads.read([pad({ axes: [0, -1, 0, 0] })]).waiting, ["Pad"]);
  pads.read([pad()]);
  assert.deepEqual(pads.read([pad({ axes: [0, -1, 0, 0] })]).axes.chair, [1, 0]);
  pads.disarm();
  assert.deepEqual(pads.read([pad({ axes: [0, -1, 0, 0] })]).axes.chair, [0, 0]);
});

test("drift within the dead zone is zero, the rim is full deflection", () => {
  assert.equal(shaped(0.11), 0);
  assert.equal(shaped(1), 1);
  assert.ok(Math.abs(shaped(-0.56) + 0.5) < 1e-9);
  assert.equal(shaped(Number.NaN), 0);
});

test("a press held while plugging in, or while the page slept, is not a press", () => {
  const pads = new Gamepads();
  assert.deepEqual(pads.read([with_([0, 1])]).presses, []);
  pads.read([pad()]);
  assert.deepEqual(pads.read([with_([1])]).presses, ["stop"]);
  assert.deepEqual(pads.read([with_([1])]).presses, [], "held: once");
});

test("STOP works on a device that is not armed yet", () => {
  const pads = new Gamepads();
  pads.read([pad({ axes: [0.5, 0, 0, 0] })]);
  assert.deepEqual(pads.read([with_([1], { axes: [0.5, 0, 0, 0] })]).presses, ["stop"]);
});

test("one stick and two buttons reach every direction and the page's buttons", () => {
  const pads = new Gamepads();
  const plain = (axes, down = []) => with_(down, { mapping: "", axes });
  const reached = new Set();
  pads.read([plain([0, 0])]);
  for (let mode = 0; mode < STICK_MODES.length; mode += 1) {
    for (const axes of [[0, -1], [0, 1], [-1, 0], [1, 0]]) {
      const read = pads.read([plain(axes)]);
      directions(read.axes).forEach((name) => reached.add(name));
      if (read.menu) reached.add(`menu ${read.menu}`);
      pads.read([plain([0, 0])]);
    }
    pads.read([plain([0, 0], [0])]);
    pads.read([plain([0, 0])]);
  }
  const missing = Object.keys(MOTIONS).filter((name) => !reached.has(name));
  assert.deepEqual(missing, []);
  assert.ok(reached.has("menu next") && reached.has("menu back") && reached.has("menu take"));
});

test("an unplugged device is reported, and a remap is kept by its name", () => {
  const pads = new Gamepads({ Pad: { stop: [3] } });
  pads.read([pad()]);
  assert.deepEqual(pads.read([with_([3])]).presses, ["stop"]);
  assert.deepEqual(pads.read([null]).gone, ["Pad"]);
  assert.deepEqual(pads.read([null]).gone, []);
});

test("a step of a stick is its steepest axis beyond the half", () => {
  const pads = new Gamepads();
  pads.read([pad()]);
  assert.equal(steepest(pads.read([pad({ axes: [0.2, -0.9, 0, 0] })]).axes), "chair.forward");
  assert.equal(steepest(pads.read([pad({ axes: [0.3, 0.3, 0, 0] })]).axes), null);
});

test("STOP is recognized in any result, finished or not", () => {
  for (const words of ["stop", "Stop!", "please stop now", "no stop stop"]) assert.ok(saysStop(words), words);
  assert.ok(!saysStop("nonstop flight"));
  assert.deepEqual(understand("hand up stop"), { stop: true });
});

test("a phrase must be the whole result; talk in the room does nothing", () => {
  assert.equal(understand("hand up").step, "hand.up");
  assert.equal(understand("Hand up, please.").step, "hand.up");
  assert.equal(understand("put your hand up there"), null);
  assert.equal(understand("constructor"), null);
  assert.equal(understand(""), null);
  assert.ok(GRAMMAR.length >= 25, String(GRAMMAR.length));
});

test("no phrase starts a motion that lasts", () => {
  for (const phrase of GRAMMAR) {
    const meant = understand(phrase);
    const allowed = ["stop", "step", "again", "speed", "menu", "press", "phrase"];
    assert.ok(meant && Object.keys(meant).every((key) => allowed.includes(key)), phrase);
    if (meant.step) assert.ok(MOTIONS[meant.step], meant.step);
  }
});

test("keys: Esc stops always, keys of the browser are left alone, turning turns the hand", () => {
  const key = (code, more = {}) => ({ code, ...more });
  assert.equal(meaning(key("Escape", { ctrlKey: true }), {}, false), "stop");
  assert.equal(meaning(key("KeyR", { ctrlKey: true }), KEY_DEFAULTS, false), null);
  assert.equal(meaning(key("KeyG"), KEY_DEFAULTS, false), "hand.up");
  assert.equal(meaning(key("KeyG"), KEY_DEFAULTS, true), "turn.roll_plus");
  assert.equal(meaning(key("KeyW"), KEY_DEFAULTS, true), "chair.forward");
  for (const action of Object.values(KEY_DEFAULTS)) {
    for (const name of action.split("+")) {
      assert.ok(MOTIONS[name] || ["stop", "turning", "slower", "faster"].includes(name) || /^speed[1-5]$/.test(name), name);
    }
  }
});

test("a remapped key loses its former action, and Esc cannot be remapped", () => {
  const keys = remap(KEY_DEFAULTS, "KeyG", "KeyW", "hand.up");
  assert.equal(keys.KeyW, "hand.up");
  assert.equal(keys.KeyG, undefined);
  assert.equal(remap(keys, "KeyW", "Escape", "hand.up").Escape, undefined);
});

test("the two names of a diagonal key are both moved", () => {
  assert.deepEqual(axesOf("chair.forward+chair.left").chair, [1, 1]);
});

test("the same action pressed twice is confirmed, two different ones are not", () => {
  const confirmation = new Confirmation();
  assert.equal(confirmation.press("discard", 0), false);
  assert.equal(confirmation.press("redo", 100), false);
  assert.equal(confirmation.press("redo", 200), true);
  assert.equal(confirmation.press("redo", 300), false);
  assert.equal(confirmation.asks(300), "redo");
  assert.equal(confirmation.asks(9000), null);
});
