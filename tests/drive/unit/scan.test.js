import assert from "node:assert/strict";
import { test } from "node:test";

import { Cross, Cursor, Scanner } from "../../../client/teleop/web/page/logic/scan.js";

const ROWS = [
  { id: "row:chair", label: "Chair", items: [{ id: "f", label: "F" }, { id: "b", label: "B" }] },
  { id: "row:hand", label: "Hand", items: [{ id: "u", label: "U" }, { id: "d", label: "D" }] },
  { id: "row:one", label: "One", items: [{ id: "x", label: "X" }] },
];
const SETTINGS = { interval: 1000, first: 500, loops: 2, hold: 250, debounce: 400 };

/** A scanner with a clock; `press` holds the switch long enough. */
function rig(more = {}) {
  const scanner = new Scanner({ ...SETTINGS, ...more });
  scanner.items(ROWS, 0);
  const clock = { now: 0, framed: [], taken: [] };
  clock.run = (ms) => {
    for (const end = clock.now + ms; clock.now < end; clock.now += 10) {
      const taken = scanner.tick(clock.now);
      if (taken) clock.taken.push(taken);
      const framed = scanner.framed()?.id;
      if (framed !== clock.framed.at(-1)) clock.framed.push(framed);
    }
  };
  clock.press = (ms = 300, which = 1) => {
    scanner.press(which, clock.now);
    clock.run(ms);
    scanner.release(which, clock.now);
  };
  return { scanner, clock };
}

test("it rests until a press, then STOP comes first in every cycle", () => {
  const { clock, scanner } = rig();
  clock.run(3000);
  assert.ok(scanner.resting);
  clock.press();
  clock.run(12_000);
  assert.deepEqual(clock.framed.slice(0, 6), ["stop", "row:chair", "row:hand", "x", "stop", "row:chair"]);
  assert.deepEqual(clock.taken, []);
});

test("a press chooses the row, another the item in it; STOP is first there too", () => {
  const { clock, scanner } = rig();
  clock.press();
  clock.run(1600);
  assert.equal(scanner.framed().id, "row:chair");
  clock.press();
  assert.equal(scanner.framed().id, "stop");
  clock.run(1500);
  assert.equal(scanner.framed().id, "f");
  clock.press();
  assert.deepEqual(clock.taken, ["f"]);
  assert.equal(scanner.framed().id, "f", "it stays framed, to be taken again");
  clock.run(500);
  clock.press();
  assert.deepEqual(clock.taken, ["f", "f"]);
});

test("a tremor does not press: short presses and presses in a row are filtered", () => {
  const { clock, scanner } = rig();
  clock.press(100);
  assert.equal(scanner.resting, true, "shorter than the filter");
  clock.press();
  assert.equal(scanner.resting, false);
  clock.press(260);
  assert.deepEqual(clock.taken, [], "within the debounce time");
});

test("a press that starts and ends between two frames counts when it was long enough", () => {
  for (const [hold, resting] of [[0, false], [20, false], [40, true]]) {
    const scanner = new Scanner({ ...SETTINGS, hold });
    scanner.items(ROWS, 0);
    scanner.press(1, 100);
    scanner.release(1, 130);
    scanner.tick(140);
    assert.equal(scanner.resting, resting, `filter ${hold} ms`);
  }
});

test("a held switch counts once", () => {
  const { clock } = rig({ kind: "linear" });
  clock.press();
  clock.run(1500);
  clock.press(3000);
  assert.equal(clock.taken.length, 1);
});

test("after its loops it goes back from a row, and then rests", () => {
  const { clock, scanner } = rig();
  clock.press();
  clock.run(1600);
  clock.press();
  assert.equal(scanner.row, "row:chair");
  clock.run(2 * 4 * 1000 + 2 * 500 + 200);
  assert.equal(scanner.row, null);
  clock.run(2 * 4 * 1000 + 2 * 500 + 200);
  assert.equal(scanner.resting, true);
});

test("with two switches nothing moves by itself", () => {
  const { clock, scanner } = rig({ kind: "two" });
  clock.press(300, 1);
  assert.equal(scanner.framed().id, "stop");
  clock.run(60_000);
  assert.equal(scanner.framed().id, "stop");
  clock.press(300, 1);
  assert.equal(scanner.framed().id, "f");
  clock.run(500);
  clock.press(300, 2);
  assert.deepEqual(clock.taken, ["f"]);
});

test("a press that stopped the robot does not select", () => {
  const { clock, scanner } = rig({ kind: "linear" });
  clock.press();
  clock.run(1500);
  scanner.spend(1, clock.now);
  clock.run(700);
  scanner.release(1, clock.now);
  assert.deepEqual(clock.taken, []);
});

test("the frame stays on its item when others appear and vanish", () => {
  const { clock, scanner } = rig({ kind: "linear" });
  clock.press();
  clock.run(3300);
  const { id } = scanner.framed();
  scanner.items([{ id: "row:new", label: "New", items: [{ id: "n", label: "N" }] }, ...ROWS], clock.now);
  assert.equal(scanner.framed().id, id);
  scanner.items([], clock.now);
  assert.equal(scanner.framed().id, "stop");
});

test("a point in an image takes two presses, and both cameras are swept", () => {
  const cross = new Cross(0, [1, 0], 8000);
  assert.deepEqual(cross.at(2000), { camera: 1, u: null, v: 0.25 });
  assert.deepEqual(cross.at(10_000), { camera: 0, u: null, v: 0.25 });
  assert.deepEqual(cross.at(18_000), { camera: 1, u: null, v: 0.25 });
  assert.equal(cross.over(48_000), false, "three sweeps of each image");
  assert.equal(cross.over(48_001), true);
  assert.equal(cross.press(10_000), null);
  assert.deepEqual(cross.press(14_000), { camera: 0, u: 0.5, v: 0.25 });
  assert.equal(cross.over(10_000 + 24_001), true);
});

test("the chosen point is the position of the line at the press", () => {
  const { scanner } = rig();
  scanner.press(1, 2000);
  assert.deepEqual(scanner.presses(2200), []);
  const [press] = scanner.presses(2250);
  assert.deepEqual(press, { which: 1, at: 2000 });
  const cross = new Cross(0, [0], 8000);
  cross.press(press.at, 2250);
  assert.deepEqual(cross.at(2250), { camera: 0, u: 0, v: 0.25 });
});

test("a cursor goes round, STOP first, and stays on its item", () => {
  const cursor = new Cursor();
  cursor.items(ROWS);
  assert.equal(cursor.framed().id, "stop");
  cursor.move(-1);
  assert.equal(cursor.framed().id, "x");
  cursor.items(ROWS.slice(2));
  assert.equal(cursor.framed().id, "x");
});
