// One switch alone, against the real server: a user who has only the space bar
// takes control, starts an episode, turns towards the table, points at the mustard, starts
// the skill that takes it and finishes. The test reads what the user sees from the pixels of
// the page: the frame, the yellow of the bottle, the sweeping line.
//   node lift.js [SEED]      programs in ../../target/release

import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { mkdtempSync, readdirSync } from "node:fs";
import { tmpdir } from "node:os";
import path from "node:path";
import { createInterface } from "node:readline";

import { preset } from "../../client/teleop/web/page/logic/profile.js";
import { launch, until } from "./browser.js";

const PROGRAM = process.env.WHEELARM || new URL("../../target/release/wheelarm", import.meta.url).pathname;
const out = mkdtempSync(path.join(tmpdir(), "wheelarm-lift-"));
const seed = process.argv[2] || "3";
const began = performance.now();
const say = (words) => console.log(`${((performance.now() - began) / 1000).toFixed(1).padStart(6)} s  ${words}`);

const drive = spawn(PROGRAM, ["drive", "--page", "127.0.0.1:0", "--task", "pick_mustard", "--seed", seed,
  "--pictures", "320x180@10", "--out", out], { stdio: ["ignore", "pipe", "inherit"] });
const url = await new Promise((found, failed) => {
  createInterface({ input: drive.stdout }).on("line", (line) => line.startsWith("drive ") && found(line.slice(6)));
  drive.on("exit", (code) => failed(new Error(`wheelarm drive ended with ${code}`)));
});
const browser = await launch();
let presses = 0;
try {
  // The scanning times are the defaults.
  const settings = { ...preset("one_switch"), speed: 5, sound: false };
  const page = await (await browser.newContext({ viewport: { width: 1280, height: 800 } })).newPage();
  await page.addInitScript((value) => localStorage.setItem("wheelarm.drive", JSON.stringify(value)), settings);
  await page.goto(url);
  await page.locator("#stage canvas").first().waitFor();
  const situation = async () => (await page.context().request.get(new URL("/situation", url).href)).json();

  const framed = () => page.evaluate(() => {
    const one = document.querySelector(".framed");
    return one && (one.dataset.item || `row:${one.dataset.row}`);
  });
  const hit = async () => {
    presses += 1;
    await page.keyboard.down("Space");
    await page.waitForTimeout(settings.scan.hold + 50);
    await page.keyboard.up("Space");
    await page.waitForTimeout(settings.scan.debounce);
  };
  const take = async (...names) => {
    for (const name of names) {
      await until(async () => (await framed()) === name, `the frame on ${name}`, 60);
      await hit();
    }
  };
  const rests = async () => {
    await until(async () => !(await situation()).robot.moving, "the robot rests");
    await page.waitForTimeout(500);
  };
  /** Middle of the yellow pixels in the first image, 0 to 1; null when there are few. */
  const bottle = () => page.evaluate(() => {
    const canvas = document.querySelector("#stage canvas");
    const { width, height } = canvas;
    const { data } = canvas.getContext("2d").getImageData(0, 0, width, height);
    let [count, x, y] = [0, 0, 0];
    for (let at = 0; at < data.length; at += 4) {
      const [r, g, b] = data.slice(at, at + 3);
      if (r > 150 && g > 0.68 * r && g < 0.95 * r && b < 0.35 * r) {
        count += 1;
        x += (at / 4) % width;
        y += Math.floor(at / 4 / width);
      }
    }
    return count > 12 ? { u: x / count / width, v: y / count / height, count } : null;
  });
  /** Position of the sweeping line, 0 to 1: `down` is the one across the image. */
  const line = (down) => page.evaluate((isDown) => {
    // In the chair camera's image, which shows the bottle; the line also sweeps over the others.
    for (const over of document.querySelectorAll("#stage figure:first-of-type canvas.over")) {
      const { width, height } = over;
      const { data } = over.getContext("2d").getImageData(0, 0, width, height);
      const bright = (x, y) => { const at = 4 * (y * width + x); return data[at] === 255 && data[at + 1] === 225 && data[at + 2] === 77; };
      const [long, short] = isDown ? [height, width] : [width, height];
      for (let i = 0; i < long; i += 1) {
        let all = true;
        for (let k = 1; k < 4 && all; k += 1) {
          const j = Math.floor((short * k) / 4) + 3;
          all = isDown ? bright(j, i) : bright(i, j);
        }
        if (all) return (i + 1) / long;
      }
    }
    return null;
  }, down);

  await page.locator("#stage").focus();
  await hit();
  if (process.env.LOOK) {
    console.log(await page.evaluate(() => [...document.querySelectorAll("[data-row]")].map((row) => `${row.dataset.row}: ${[...row.querySelectorAll("[data-item]")].filter((e) => e.offsetParent).map((e) => e.dataset.item)}`).join("\n")));
    await page.screenshot({ path: process.env.LOOK });
  }
  await take("ask");
  await until(async () => (await situation()).people.some((one) => one.control), "the page is in control");
  await take("row:Episode", "start");
  await until(async () => (await situation()).episode, "the episode runs");
  say("an episode runs");
  await take("back", "row:Chair");
  for (let turns = 0; turns < 30; turns += 1) {
    const found = await bottle();
    if (found && found.u > 0.25 && found.u < 0.75) break;
    await take("chair.right");
    await rests();
    say(`turned, ${JSON.stringify(await bottle())}`);
  }
  await take("back");
  for (let tries = 0; ; tries += 1) {
    assert.ok(tries < 4, "the mustard was not met in four tries");
    const found = await bottle();
    say(`points at ${JSON.stringify(found)}`);
    await take("pick");
    await until(async () => Math.abs((await line(true) ?? 9) - found.v) < 0.012, "the line across is over it", 30);
    await hit();
    await until(async () => Math.abs((await line(false) ?? 9) - found.u) < 0.008, "the line down is over it", 30);
    await hit();
    const answer = await until(() => page.evaluate(() => document.querySelector("#goal_text").textContent), "an answer");
    await page.waitForTimeout(600);
    const names = await page.evaluate(() => [...document.querySelectorAll('[data-item^="goal:"]')].map((e) => e.dataset.item));
    say(`${answer} ${names}`);
    if (names.includes("goal:take")) break;
  }
  if (process.env.LOOK) await page.screenshot({ path: process.env.LOOK.replace(".", "-goal.") });
  await take("row:Choose in the image", "goal:take");
  await until(async () => (await situation()).evaluation?.success, "it is lifted and held", 120);
  say("lifted and held");
  await until(async () => !(await situation()).goal, "the goal is over", 60);
  await take("row:Episode", "finish");
  await until(async () => !(await situation()).episode, "the episode is over");
  await until(() => readdirSync(out).some((name) => name.endsWith(".h5")), "the file is written", 60);
  say(`finished with ${presses} presses of one switch: ${path.join(out, readdirSync(out).find((name) => name.endsWith(".h5")))}`);
  if (process.env.LOOK) await page.screenshot({ path: process.env.LOOK.replace(".", "-end.") });
} finally {
  await browser.close();
  drive.removeAllListeners("exit");
  drive.kill("SIGINT");
}
