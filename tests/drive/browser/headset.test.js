// A headset that IWER emulates: clutch, stick, stop, lost pose, end, panels.

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { after, before, test } from "node:test";

import { launch, open, until } from "../browser.js";

const IWER = readFileSync(new URL("../node_modules/iwer/build/iwer.min.js", import.meta.url), "utf8");
const DEVICE = `window.headset = new IWER.XRDevice(IWER.metaQuest3); headset.installRuntime({ forceInstall: true });`;

let browser;
before(async () => { browser = await launch(); });
after(() => browser.close());

const item = (page, name) => page.locator(`[data-item="${name}"]`);
const moved = (gateway) => gateway.taken.filter((message) => message.clutch);
const on = (name, body) => test(name, async () => {
  const one = await open(browser, { codec: "jpeg", scripts: [IWER, DEVICE] });
  try {
    await item(one.page, "xr").click();
    await until(() => one.page.evaluate(() => Boolean(headset.activeSession)), "a session");
    await body(one);
  } finally {
    await one.close();
  }
});
const hand = (page, x, y, z) => page.evaluate(([a, b, c]) => headset.controllers.right.position.set(a, b, c), [x, y, z]);
const squeeze = (page, on_) => page.evaluate((value) => headset.controllers.right.updateButtonValue("squeeze", value), on_ ? 1 : 0);

on("the clutch engages without a jump, follows, and holds when it is released", async ({ gateway, page }) => {
  await hand(page, 0.3, 1.1, -0.4);
  await page.waitForTimeout(300);
  const before_ = [...gateway.hand];
  await squeeze(page, true);
  await until(() => moved(gateway).length >= 3, "it is engaged");
  assert.ok(moved(gateway).every(({ clutch }) => Math.hypot(...clutch.move) < 0.001), "less than a millimetre");
  assert.ok(Math.hypot(...gateway.hand.map((value, axis) => value - before_[axis])) < 0.001);
  const { device, mode, epoch } = moved(gateway)[0];
  assert.deepEqual([device, mode], ["vr", "stream"]);
  await hand(page, 0.3, 1.1, -0.6);
  await until(() => Math.abs(moved(gateway).at(-1).clutch.move[0] - 0.2) < 0.005, "200 mm ahead");
  assert.ok(Math.abs(gateway.hand[0] - before_[0] - 0.2) < 0.005);
  assert.equal(moved(gateway).at(-1).epoch, epoch, "one engagement is one epoch");
  await squeeze(page, false);
  await until(() => gateway.held === null, "it holds");
  const held = [...gateway.hand];
  await hand(page, 0.6, 1.4, -0.1);
  await page.waitForTimeout(500);
  assert.deepEqual(gateway.hand, held);
  await squeeze(page, true);
  await until(() => moved(gateway).at(-1).epoch > epoch, "engaged anew");
  assert.ok(Math.hypot(...gateway.hand.map((value, axis) => value - held[axis])) < 0.001, "and again without a jump");
});

on("a lost controller holds, and needs a fresh squeeze", async ({ gateway, page }) => {
  await squeeze(page, true);
  await until(() => moved(gateway).length >= 3, "it is engaged");
  await page.evaluate(() => { headset.controllers.right.connected = false; });
  await until(() => gateway.held === null, "it holds");
  await page.evaluate(() => { headset.controllers.right.connected = true; });
  const { epoch } = moved(gateway).at(-1);
  await page.waitForTimeout(600);
  assert.ok(moved(gateway).every((message) => message.epoch === epoch), "still squeezed: nothing moves");
  await squeeze(page, false);
  await page.waitForTimeout(200);
  await squeeze(page, true);
  await until(() => moved(gateway).some((message) => message.epoch > epoch), "a fresh squeeze engages");
});

on("the stick drives the chair, the trigger closes, A stops", async ({ gateway, page }) => {
  await page.evaluate(() => headset.controllers.left.updateAxes("thumbstick", 0, -1));
  await until(() => gateway.taken.some((message) => message.chair?.[0] === 1 && message.device === "vr"), "the chair drives");
  await page.evaluate(() => headset.controllers.right.updateButtonValue("a-button", 1));
  await until(() => gateway.taken.filter((message) => message.t === "stop").length === 3, "A stops");
  await until(() => gateway.held === null, "the stick that is still tilted moves nothing");
  await page.evaluate(() => { headset.controllers.left.updateAxes("thumbstick", 0, 0); headset.controllers.right.updateButtonValue("a-button", 0); });
  await page.waitForTimeout(300);
  await page.evaluate(() => headset.controllers.right.updateButtonValue("trigger", 1));
  await until(() => gateway.taken.some((message) => message.grip === -1), "the gripper closes");
});

on("the end of the session and a hidden session release everything", async ({ gateway, page }) => {
  await squeeze(page, true);
  await until(() => moved(gateway).length >= 3, "it is engaged");
  await page.evaluate(() => headset.updateVisibilityState("hidden"));
  await until(() => gateway.held === null, "hidden: it holds");
  await page.evaluate(() => headset.updateVisibilityState("visible"));
  await squeeze(page, false);
  await page.waitForTimeout(200);
  await squeeze(page, true);
  await until(() => gateway.held !== null, "engaged again");
  await page.evaluate(() => headset.activeSession.end());
  await until(() => gateway.held === null, "ended: it holds");
  // The flat page still drives.
  await squeeze(page, false);
  await page.locator("#stage").focus();
  await page.keyboard.down("KeyW");
  await until(() => gateway.taken.some((message) => message.device === "keyboard" && message.chair?.[0] === 1), "keys drive");
  await page.keyboard.up("KeyW");
});

on("both panels and the words under them are rendered", async ({ gateway, page }) => {
  await until(() => gateway.acks.filter((ack) => ack.painted).length > 10, "images are painted in the headset");
  const shot = await page.evaluate(() => new Promise((done) => {
    // Read right after the headset's frame, before the browser discards the image.
    headset.activeSession.requestAnimationFrame(() => queueMicrotask(() => {
      const gl = headset.activeSession.renderState.baseLayer.context;
      const [w, h] = [gl.drawingBufferWidth, gl.drawingBufferHeight];
      const colours = (u, v, size) => {
        const bytes = new Uint8Array(size * size * 4);
        gl.readPixels(Math.round(u * w) - size / 2, Math.round(v * h) - size / 2, size, size, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
        const colors = new Set();
        for (let at = 0; at < bytes.length; at += 4) colors.add(bytes.slice(at, at + 3).map((value) => value >> 4).join());
        return colors.size;
      };
      done([[0.28, 0.56], [0.72, 0.56], [0.45, 0.36], [0.5, 0.9]].map(([u, v]) => colours(u, v, 96)));
    }));
  }));
  const [left, right, words, nothing] = shot;
  assert.ok(left > 4 && right > 4 && words > 4, JSON.stringify(shot));
  assert.equal(nothing, 1, "beside them is nothing");
});
