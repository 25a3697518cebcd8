import assert from "node:assert/strict";
import { test } from "node:test";

import { Driver, LATCH_MS } from "../../../client/teleop/web/page/logic/driver.js";

/** A driver that is allowed to drive. */
function free() {
  const driver = new Driver();
  driver.locked("", "", false, 0);
  return driver;
}

/** All messages of the frames from `from` to `to`, at 60 frames a second. */
function frames(driver, from, to, shown = 100) {
  const all = [];
  for (let now = from; now < to; now += 1000 / 60) all.push(...driver.frame(now, shown));
  return all;
}
const kinds = (messages) => messages.map((message) => message.t);
const moving = (message) => message.t === "drive" && (message.chair.some(Boolean) || message.hand.some(Boolean));

test("held input is repeated, and three releases follow", () => {
  const driver = free();
  assert.equal(driver.press("key:w", "chair.forward", "keyboard", 0), "drive");
  const held = frames(driver, 0, 500);
  assert.ok(held.length >= 12 && held.length <= 16, `${held.length} messages in half a second`);
  assert.ok(held.every((message) => message.t === "drive" && message.chair[0] === 1 && message.epoch === 1));
  assert.deepEqual(held.map((message) => message.seq), held.map((_, index) => index + 1));
  driver.release("key:w");
  const after = frames(driver, 500, 600);
  assert.deepEqual(kinds(after), ["drive", "drive", "drive"]);
  assert.ok(after.every((message) => !moving(message)));
});

test("two keys add up, opposite ones cancel, and nothing exceeds one", () => {
  const driver = free();
  driver.press("a", "chair.forward", "keyboard", 0);
  driver.press("b", "chair.left", "keyboard", 0);
  driver.press("c", "chair.forward", "keyboard", 0);
  assert.deepEqual(driver.frame(0, 1)[0].chair, [1, 1]);
  driver.press("d", "chair.right", "keyboard", 1);
  assert.deepEqual(driver.frame(40, 1)[0].chair, [1, 0]);
});

test("a fresh press has a new epoch, and so has every step", () => {
  const driver = free();
  driver.press("a", "hand.up", "mouse", 0);
  assert.equal(driver.frame(0, 1)[0].epoch, 1);
  driver.release("a");
  frames(driver, 10, 200);
  driver.press("a", "hand.up", "mouse", 200);
  assert.equal(driver.frame(200, 1)[0].epoch, 2);
  driver.release("a");
  frames(driver, 210, 600);
  assert.equal(driver.step("hand.down", "switch", 600), "step");
  const [step] = driver.frame(600, 7);
  assert.deepEqual([step.t, step.epoch, step.part, step.axis, step.sign, step.mode, step.device, step.shown],
    ["step", 3, "hand", 2, -1, "step", "switch", 7]);
});

test("stop is sent three times and disables held input until it is released and pressed again", () => {
  const driver = free();
  driver.press("a", "chair.forward", "keyboard", 0);
  driver.frame(0, 1);
  driver.stop("person", "keyboard", 10);
  const after = frames(driver, 10, 400);
  assert.deepEqual(kinds(after).slice(0, 3), ["stop", "stop", "stop"]);
  assert.ok(!after.some(moving), "the key is still down and moves nothing");
  // Key repeat while it is held changes nothing.
  driver.press("a", "chair.forward", "keyboard", 400);
  assert.ok(!frames(driver, 400, 500).some(moving));
  driver.release("a");
  driver.press("a", "chair.forward", "keyboard", 500);
  assert.ok(frames(driver, 500, 600).some(moving));
});

test("stop is sent while everything is locked and without an image", () => {
  const driver = new Driver();
  driver.stop("person", "touch", 0);
  const [stop] = driver.frame(0, null);
  assert.deepEqual([stop.t, stop.shown, stop.device, stop.why], ["stop", null, "touch", "person"]);
});

test("a latch runs out after two seconds, or lives while it is renewed", () => {
  const driver = free();
  driver.toggle("chair.forward", "mouse", 0);
  const ran = frames(driver, 0, LATCH_MS + 500);
  assert.ok(ran.filter(moving).every((message) => message.ms < LATCH_MS && message.mode === "latch"));
  assert.equal(driver.latch, null);
  driver.toggle("chair.forward", "mouse", 3000);
  for (let now = 3000; now < 8000; now += 100) {
    driver.renew(now);
    driver.frame(now, 1);
  }
  assert.ok(driver.anything());
});

test("any press on any device during a latch stops, and selects nothing", () => {
  for (const act of [
    (driver) => driver.toggle("chair.forward", "mouse", 100),
    (driver) => driver.press("k", "hand.up", "keyboard", 100),
    (driver) => driver.step("hand.up", "switch", 100) === "stop" && "stop",
    (driver) => driver.intercept("touch", 100) && "stop",
  ]) {
    const driver = free();
    driver.toggle("chair.forward", "mouse", 0);
    driver.frame(0, 1);
    assert.equal(act(driver), "stop");
    const after = frames(driver, 100, 300);
    assert.deepEqual(kinds(after).slice(0, 3), ["stop", "stop", "stop"]);
    assert.ok(!after.some(moving) && !after.some((message) => message.t === "step"));
  }
});

test("any press during a goal stops it; a stick too, and it must be released first", () => {
  const driver = free();
  driver.receive({ dead: 0, seq: 0 }, { id: 1 }, true, 0);
  driver.set("gamepad", { chair: [1, 0], hand: [0, 0, 0], turn: [0, 0, 0], grip: 0 }, "gamepad", 10);
  const after = frames(driver, 10, 200);
  assert.equal(after[0].t, "stop");
  assert.ok(!after.some(moving));
  driver.set("gamepad", { chair: [0, 0], hand: [0, 0, 0], turn: [0, 0, 0], grip: 0 }, "gamepad", 200);
  driver.set("gamepad", { chair: [1, 0], hand: [0, 0, 0], turn: [0, 0, 0], grip: 0 }, "gamepad", 210);
  assert.ok(frames(driver, 210, 300).some(moving));
});

test("a switch stops a step that is under way, a keyboard makes the next one", () => {
  const driver = free();
  driver.step("hand.up", "switch", 0);
  driver.frame(0, 1);
  driver.receive({ dead: 0, seq: 0 }, null, true, 100);
  assert.equal(driver.step("hand.up", "switch", 1000), "stop");
  driver.receive({ dead: 0, seq: 0 }, null, false, 1100);
  frames(driver, 1100, 1400);
  assert.equal(driver.step("hand.up", "switch", 1500), "step");
  driver.frame(1500, 1);
  driver.receive({ dead: 0, seq: 0 }, null, true, 1600);
  assert.equal(driver.step("hand.up", "keyboard", 1800), "step");
});

test("steps never queue: a second one in the same moment is rejected", () => {
  const driver = free();
  assert.equal(driver.step("hand.up", "mouse", 0), "step");
  assert.equal(driver.step("hand.up", "mouse", 20), "refused");
  assert.equal(kinds(frames(driver, 20, 100)).filter((kind) => kind === "step").length, 1);
});

test("the gateway's dead epoch ends held motion; a situation from before the press does not", () => {
  const driver = free();
  driver.press("a", "chair.forward", "keyboard", 0);
  driver.frame(0, 1);
  driver.receive({ dead: 1, seq: 0 }, null, false, 10);
  assert.ok(frames(driver, 20, 60).some(moving), "that dead epoch is older than this motion");
  driver.receive({ dead: 1, seq: driver.seq, why: "contact" }, null, false, 100);
  assert.ok(!frames(driver, 100, 300).some(moving));
  assert.match(driver.takeNotes().at(-1).text, /contact/);
});

test("a lock stops motion, and input held before it stays dead", () => {
  const driver = free();
  driver.press("a", "chair.forward", "keyboard", 0);
  driver.frame(0, 1);
  driver.locked("The image is frozen: only STOP", "frozen", false, 50);
  const [stop] = driver.frame(50, null);
  assert.deepEqual([stop.t, stop.why], ["stop", "frozen"]);
  driver.locked("", "", false, 400);
  assert.ok(!frames(driver, 400, 600).some(moving));
});

test("with an old image only steps and goals are left", () => {
  const driver = free();
  driver.locked("", "", true, 0);
  assert.equal(driver.press("a", "chair.forward", "keyboard", 0), "refused");
  assert.equal(driver.step("chair.forward", "keyboard", 0), "step");
});

test("losing the window stops the chair at once and says why", () => {
  const driver = free();
  driver.press("a", "chair.forward", "keyboard", 0);
  driver.frame(0, 1);
  driver.guard("blur", "", 10);
  const [stop] = driver.frame(10, 1);
  assert.deepEqual([stop.t, stop.why], ["stop", "blur"]);
  // Without held input nothing is sent.
  const idle = free();
  idle.guard("blur", "", 10);
  assert.ok(!kinds(frames(idle, 10, 400)).includes("stop"));
});

test("at rest it sends four alive messages a second", () => {
  const driver = free();
  const messages = frames(driver, 0, 2000);
  assert.ok(messages.every((message) => message.t === "alive"));
  assert.ok(messages.length >= 7 && messages.length <= 9, String(messages.length));
});

test("a clutch sends its motion and has one epoch", () => {
  const driver = free();
  const axes = { chair: [0, 0], hand: [0, 0, 0], turn: [0, 0, 0], grip: 0 };
  driver.set("vr", axes, "vr", 0, { mode: "stream", clutch: { move: [0, 0, 0], turn: [0, 0, 0, 1] } });
  const [first] = driver.frame(0, 1);
  driver.set("vr", axes, "vr", 33, { mode: "stream", clutch: { move: [0.01, 0, 0], turn: [0, 0, 0, 1] } });
  const [second] = driver.frame(33, 1);
  assert.deepEqual([first.epoch, second.epoch, second.clutch.move, second.mode], [1, 1, [0.01, 0, 0], "stream"]);
  driver.set("vr", axes, "vr", 66, { mode: "stream" });
  assert.deepEqual(kinds(frames(driver, 66, 150)), ["drive", "drive", "drive"]);
});

test("a press without an operator in control requests it, and acts only while it is held", () => {
  for (const held of [true, false]) {
    const driver = new Driver();
    driver.locked("no operator is in control", "free", false, 0);
    assert.equal(driver.press("key:w", "chair.forward", "keyboard", 100), "refused");
    assert.equal(driver.controlWanted, true);
    assert.ok(!frames(driver, 100, 300).some(moving), "before control is granted nothing moves");
    if (!held) driver.release("key:w");
    driver.locked("", "", false, 300);
    assert.equal(frames(driver, 300, 500).some(moving), held);
  }
});

test("a step that asked for control is taken once, and not after a stop or a long wait", () => {
  const steps = (between, granted) => {
    const driver = new Driver();
    driver.locked("no operator is in control", "free", false, 0);
    driver.step("hand.up", "switch", 100);
    between(driver);
    driver.locked("", "", false, granted);
    return kinds(frames(driver, granted, granted + 500)).filter((kind) => kind === "step").length;
  };
  assert.equal(steps(() => {}, 400), 1);
  assert.equal(steps((driver) => driver.stop("person", "switch"), 400), 0);
  assert.equal(steps((driver) => driver.guard("blur", ""), 400), 0);
  assert.equal(steps(() => {}, 9000), 0);
});

test("a press while another person drives asks for nothing", () => {
  const driver = new Driver();
  driver.locked("ben is in control", "guard", false, 0);
  driver.press("key:w", "chair.forward", "keyboard", 100);
  assert.equal(driver.controlWanted, false);
});
