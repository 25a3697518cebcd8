import assert from "node:assert/strict";
import { readdirSync, readFileSync, statSync } from "node:fs";
import { join } from "node:path";
import { test } from "node:test";
import { fileURLToPath } from "node:url";

import { Clutch, times, toChair } from "../../../client/teleop/web/page/xr/clutch.js";
import { PRESETS, checked, movePad, preset, sizePad } from "../../../client/teleop/web/page/logic/profile.js";
import { facing, hit } from "../../../client/teleop/web/page/xr/panels.js";

const PAGE = fileURLToPath(new URL("../../../client/teleop/web/page", import.meta.url));

test("every preset passes its own check and survives a file", () => {
  for (const name of Object.keys(PRESETS)) {
    assert.deepEqual(checked(JSON.parse(JSON.stringify(preset(name)))), preset(name), name);
  }
});

test("presets share no mutable state", () => {
  const one = preset("keyboard");
  one.pads[0].size = 111;
  one.keys.KeyW = "stop";
  assert.equal(preset("keyboard").pads[0].size, 72);
  assert.equal(preset("touch").keys.KeyW, "chair.forward");
});

test("scanning, dwelling and voice move by steps", () => {
  for (const name of ["one_switch", "two_switches", "dwell", "voice"]) assert.equal(preset(name).mode, "step", name);
});

test("an invalid file cannot produce invalid settings", () => {
  const wrong = {
    version: 1, preset: "__proto__", mode: "fly", speed: 99, theme: 7, keys: { KeyW: "launch", "<b>": "stop" },
    scan: { interval: -5, loops: "many", on: "yes" }, dwell: { time: Number.NaN },
    pads: [{ name: "chair", size: 1e9 }, { name: "chair" }, { name: "rocket" }, null],
    gamepad: { deadzone: 9, maps: { Pad: { stop: [], next: [2], axes: [1], evil: [1], close: ["x"] } } },
  };
  const read = checked(wrong);
  assert.deepEqual([read.preset, read.mode, read.speed, read.theme, read.scan.interval, read.scan.on, read.dwell.time],
    ["keyboard", "hold", 5, "auto", 500, false, 1000]);
  assert.deepEqual(read.keys, preset("keyboard").keys);
  assert.deepEqual(read.pads.map((pad) => pad.name), ["chair", "hand", "turn", "grip"]);
  assert.equal(read.pads[0].size, 160);
  assert.deepEqual(read.gamepad.maps, { Pad: { next: [2] } });
  for (const odd of [null, 3, "x", [], [[]]]) assert.deepEqual(checked(odd), preset("keyboard"));
});

test("pads move and grow within bounds", () => {
  const { pads } = preset("keyboard");
  assert.deepEqual(movePad(pads, "hand", -1).map((pad) => pad.name), ["hand", "chair", "turn", "grip"]);
  assert.deepEqual(movePad(pads, "chair", -1), pads);
  assert.equal(sizePad(pads, "chair", 1000)[0].size, 160);
  assert.equal(sizePad(pads, "chair", -1000)[0].size, 64);
});

const IDENTITY = [0, 0, 0, 1];
const at = (x, y, z, orientation = IDENTITY) => ({ position: [x, y, z], orientation });

test("engaging the clutch moves nothing, and moving is in the axes of the chair", () => {
  const clutch = new Clutch();
  assert.deepEqual(clutch.frame(true, at(0.3, 1.1, -0.4), IDENTITY).move.map(Math.abs), [0, 0, 0]);
  const { move } = clutch.frame(true, at(0.3, 1.2, -0.6), IDENTITY);
  assert.ok(Math.abs(move[0] - 0.2) < 1e-9 && Math.abs(move[1]) < 1e-9 && Math.abs(move[2] - 0.1) < 1e-9, String(move));
  const right = clutch.frame(true, at(0.4, 1.1, -0.4), IDENTITY).move;
  assert.ok(Math.abs(right[1] + 0.1) < 1e-9, "right is minus left");
});

test("the pose is latched anew at every squeeze", () => {
  const clutch = new Clutch();
  clutch.frame(true, at(0, 1, 0), IDENTITY);
  clutch.frame(true, at(0, 1, -0.5), IDENTITY);
  assert.equal(clutch.frame(false, at(0, 1, -0.5), IDENTITY), null);
  clutch.frame(false, at(1, 1, 1), IDENTITY);
  assert.deepEqual(clutch.frame(true, at(1, 1, 1), IDENTITY).move.map(Math.abs), [0, 0, 0]);
});

test("a lost pose releases until the squeeze is fresh", () => {
  const clutch = new Clutch();
  clutch.frame(true, at(0, 1, 0), IDENTITY);
  assert.equal(clutch.frame(true, null, IDENTITY), null);
  assert.equal(clutch.frame(true, at(0, 1, -1), IDENTITY), null, "still squeezed: not engaged again");
  clutch.frame(false, at(0, 1, -1), IDENTITY);
  assert.ok(clutch.frame(true, at(0, 1, -1), IDENTITY));
});

test("ahead is where the person looks, whatever the axes of the room", () => {
  const half = Math.SQRT1_2;
  const left = [0, half, 0, half];
  const clutch = new Clutch();
  clutch.frame(true, at(0, 1, 0), left);
  const { move } = clutch.frame(true, at(-0.2, 1, 0), left);
  assert.ok(Math.abs(move[0] - 0.2) < 1e-9 && Math.abs(move[1]) < 1e-9, String(move));
});

test("a turn of the controller is the same turn in the axes of the chair", () => {
  const clutch = new Clutch();
  clutch.frame(true, at(0, 1, 0), IDENTITY);
  const angle = 0.3;
  const { turn } = clutch.frame(true, at(0, 1, 0, [0, Math.sin(angle / 2), 0, Math.cos(angle / 2)]), IDENTITY);
  assert.ok(Math.abs(turn[2] - Math.sin(angle / 2)) < 1e-9 && Math.abs(turn[3] - Math.cos(angle / 2)) < 1e-9, String(turn));
  assert.deepEqual(times(IDENTITY, [0, 0, 0, 1]), IDENTITY);
  assert.deepEqual(toChair([0, 0, -1]).map((value) => value + 0), [1, 0, 0]);
});

test("a ray meets a panel where it points, and nothing behind it", () => {
  const panel = facing([0, 1.6, 0], IDENTITY, 0, 0, 1.5, [1, 0.5]);
  const middle = hit(panel, [0, 1.6, 0], IDENTITY);
  assert.ok(Math.abs(middle.u - 0.5) < 1e-9 && Math.abs(middle.v - 0.5) < 1e-9);
  const right = hit(panel, [0.25, 1.6, 0], IDENTITY);
  assert.ok(Math.abs(right.u - 0.75) < 1e-9);
  assert.equal(hit(panel, [0, 1.6, 0], [0, 1, 0, 0]), null);
  assert.equal(hit(panel, [2, 1.6, 0], IDENTITY), null);
});

/** All files of the page, with their paths. */
function files(folder = "") {
  return readdirSync(join(PAGE, folder), { withFileTypes: true }).flatMap((one) => {
    const path = join(folder, one.name);
    return one.isDirectory() ? files(path) : [path];
  });
}

test("the page without what a headset needs is at most 175 kB", () => {
  const size = files().filter((path) => !path.startsWith("xr/")).reduce((total, path) => total + statSync(join(PAGE, path)).size, 0);
  assert.ok(size <= 175_000, `${size} bytes`);
});

test("logic is independent of the browser, and no content is loaded from another origin", () => {
  for (const path of files()) {
    const text = readFileSync(join(PAGE, path), "utf8");
    const code = text.replace(/\/\*[\s\S]*?\*\//g, "").replace(/(^|\s)\/\/.*$/gm, "");
    if (path.startsWith("logic/")) {
      assert.doesNotMatch(code, /\b(document|window|navigator|localStorage|performance|Date|setTimeout|setInterval|fetch)\b/, path);
    }
    assert.doesNotMatch(code.replaceAll("http://www.w3.org/2000/svg", ""), /https?:\/\//, path);
    assert.doesNotMatch(code, /innerHTML|outerHTML|insertAdjacentHTML|\beval\b|document\.write/, path);
    if (path.endsWith(".html")) {
      assert.doesNotMatch(code, /\son[a-z]+=|<style|style=/, "the policy forbids what stands inline");
      assert.doesNotMatch(code, /<script(?![^>]*src=)/);
    }
  }
});
