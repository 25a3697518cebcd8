// One switch alone, against the real server: a user who has only the space bar starts
// driving, turns to the mustard, points at it, takes it and finishes. The test sees only
// the screen: the visible text, the frame and the pixels of the images. Settings and times
// are those of the preset "One switch". With SLOW=4 the clocks of the page, the gateway, the
// server and the recorder run at a quarter of their speed, so that a busy machine does not
// decide: it needs a C compiler.
//   node lift.js [SEED…]     programs in ../../target/release; without seeds 0 to 11
// Of twelve seeds at least ten must succeed; of fewer, all but a sixth.

import { execFileSync, spawn } from "node:child_process";
import { mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import path from "node:path";
import { createInterface } from "node:readline";

import { preset } from "../../client/teleop/web/page/logic/profile.js";
import { launch, until } from "./browser.js";

const PROGRAM = process.env.WHEELARM || new URL("../../target/release/wheelarm", import.meta.url).pathname;
/** Serves the page from this folder instead of the program, while it is developed. */
const FILES = process.env.WHEELARM_PAGE;
const SEEDS = process.argv.length > 2 ? process.argv.slice(2) : Array.from({ length: 12 }, (_, seed) => String(seed));
/** Rounds of turning, pointing and taking until a seed counts as failed. */
const ROUNDS = 6;
/** Nearer to the edge of an image than this share of its width, the bottle may be cut off. */
const EDGE = 0.1;
/** Time of this program per time of the page's clock. */
const SLOW = Number(process.env.SLOW || 1);
const CLOCK = `{ const real = performance.now.bind(performance); performance.now = () => real() / ${SLOW}; }`;
/** Environment of the programs: their clock is slowed as that of the page. */
function slowed() {
  if (SLOW === 1) return process.env;
  const library = path.join(mkdtempSync(path.join(tmpdir(), "wheelarm-slow-")), "slow.so");
  execFileSync("cc", ["-shared", "-fPIC", "-O2", "-o", library, new URL("slow.c", import.meta.url).pathname, "-ldl"]);
  return { ...process.env, SLOW: String(SLOW), LD_PRELOAD: library };
}
const ENVIRONMENT = slowed();
/** One sweep of a line across an image, ms: `Cross` of logic/scan.js. */
const SWEEP = 8000 * SLOW;

const SETTINGS = preset("one_switch");

/** What a user sees of the page, and the one key. */
class User {
  constructor(page) {
    this.page = page;
    this.presses = 0;
  }

  /** Label of the framed button or row, or "". */
  framed() {
    return this.page.evaluate(() => {
      const one = document.querySelector(".framed");
      return one ? one.dataset.row || one.getAttribute("aria-label") || one.innerText : "";
    });
  }

  /** All visible text. */
  text() {
    return this.page.evaluate(() => document.body.innerText);
  }

  /** Stores the screen in the folder LOOK, for a look at what went wrong. */
  async look(name) {
    if (process.env.LOOK) await this.page.screenshot({ path: path.join(process.env.LOOK, `${name}.png`) });
  }

  /** The newest message, and the line of the object. */
  messages() {
    return this.page.evaluate(() => ["hint", "goal_text", "keys_state", "alarms", "chips"].map((id) => document.getElementById(id).innerText).filter(Boolean).join(" | "));
  }

  async sees(words, what, patience = 60) {
    let last = "";
    return until(async () => {
      if (process.env.TRACE) {
        const now = `${JSON.stringify(await this.framed())}: ${await this.messages()}`;
        if (now !== last) console.log(`    ${((performance.now()) / 1000).toFixed(1)} ${now.replaceAll("\n", " | ")}`);
        last = now;
      }
      const found = words.exec(await this.text());
      return found && found[0];
    }, what, patience * SLOW);
  }

  /** One press of the switch, long enough for its filter. */
  async hit() {
    this.presses += 1;
    if (process.env.TRACE) console.log(`  press ${this.presses} at ${JSON.stringify(await this.framed())}: ${(await this.messages()).replaceAll("\n", " | ")}`);
    await this.page.keyboard.down("Space");
    await this.page.waitForTimeout(SLOW * SETTINGS.scan.hold + 50);
    await this.page.keyboard.up("Space");
    await this.page.waitForTimeout(SLOW * SETTINGS.scan.debounce);
  }

  /** Presses a button when it is framed: one of a row of several is reached through the row. */
  async take(name, row = null) {
    await until(async () => {
      const label = await this.framed();
      if (label === name) return true;
      const rests = label === "" && /Press your switch to begin/.test(await this.text());
      if (rests || (row !== null && label === row) || (row === null && label === "Back")) await this.hit();
      return false;
    }, `the frame on ${name}`, 120 * SLOW);
    await this.hit();
  }

  /** The largest yellow blob of each image: {camera, u, v, size}, the largest first; 0 to 1. */
  async bottle() {
    const found = await this.page.evaluate(() => [...document.querySelectorAll("#stage figure canvas:not(.over)")].map((canvas, camera) => {
      const { width, height } = canvas;
      const { data } = canvas.getContext("2d").getImageData(0, 0, width, height);
      const yellow = (at) => {
        const [r, g, b] = [data[4 * at], data[4 * at + 1], data[4 * at + 2]];
        return r > 150 && g > 0.66 * r && g < 0.92 * r && b < 0.36 * r;
      };
      const seen = new Uint8Array(width * height);
      let best = { camera, size: 0 };
      for (let start = 0; start < width * height; start += 1) {
        if (seen[start] || !yellow(start)) continue;
        let [size, x, y] = [0, 0, 0];
        const open = [start];
        seen[start] = 1;
        while (open.length > 0) {
          const at = open.pop();
          const [column, row] = [at % width, Math.floor(at / width)];
          [size, x, y] = [size + 1, x + column, y + row];
          for (const [dx, dy] of [[1, 0], [-1, 0], [0, 1], [0, -1]]) {
            const [i, j] = [column + dx, row + dy];
            const next = j * width + i;
            if (i < 0 || j < 0 || i >= width || j >= height || seen[next] || !yellow(next)) continue;
            seen[next] = 1;
            open.push(next);
          }
        }
        if (size > best.size) best = { camera, size, u: x / size / width, v: y / size / height };
      }
      return best;
    }));
    return found.filter(({ size }) => size > 12).sort((one, other) => other.size - one.size);
  }

  /** Position of the sweeping line over an image, 0 to 1, or null; `down`: of the first one. */
  line(camera, down) {
    return this.page.evaluate(([index, isDown]) => {
      const over = document.querySelectorAll("#stage canvas.over")[index];
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
      return null;
    }, [camera, down]);
  }

  /** Presses when the line reaches a place; false when no line sweeps any more. */
  async hitAt(camera, down, place) {
    // The first line sweeps over one image after the other.
    const end = performance.now() + 3 * SWEEP;
    while (performance.now() < end) {
      const at = await this.line(camera, down);
      const away = at === null ? 0 : place - at;
      // Far enough to prepare, near enough to foresee.
      if (away > 0.02 && away < 0.2) {
        await this.page.waitForTimeout(away * SWEEP - 30 * SLOW);
        await this.hit();
        return true;
      }
      await this.page.waitForTimeout(40);
    }
    return false;
  }
}

/** Until the robot no longer moves by itself. */
const rests = (user) => until(async () => !/any press stops it/i.test(await user.text()), "the robot rests", 120 * SLOW);

/** Nearer than this to a place that was another object, a blob is that object. */
const SAME = 0.06;

async function lift(user, say) {
  // Yellow objects that are not the bottle, in the present images.
  let others = [];
  const bottle = async () => (await user.bottle()).find((one) =>
    !others.some((other) => other.camera === one.camera && Math.hypot(other.u - one.u, other.v - one.v) < SAME));
  await user.page.locator("#stage").focus();
  await user.hit();
  await user.take("Start driving");
  await user.sees(/● Recording/, "the recording runs");
  for (let round = 1; round <= ROUNDS; round += 1) {
    let seen = await bottle();
    if (!seen || Math.abs(seen.u - 0.5) > 0.5 - EDGE) {
      await user.take("Turn to the object", "Object");
      await user.sees(/any press stops it/i, "it turns", 20).catch(() => "");
      await rests(user);
      await user.page.waitForTimeout(800 * SLOW);
      others = [];
      seen = await bottle();
      say(`turned: ${JSON.stringify(seen)}`);
    }
    if (!seen || Math.abs(seen.u - 0.5) > 0.5 - EDGE) continue;
    await user.take("Choose in the image", "Object");
    if (!(await user.hitAt(seen.camera, true, seen.v))) continue;
    // While an image is frozen a press chooses nothing, and the line sweeps on.
    let text;
    do {
      if (!(await user.hitAt(seen.camera, false, seen.u))) break;
      await user.page.waitForTimeout(1500 * SLOW);
      text = await user.text();
    } while (/Click an object/.test(text));
    text = await user.text();
    if (!/mustard/.test(text.split("mustard in the hand")[1] || "") || !/\bTake\b/.test(text)) {
      say(`pointed past it: ${JSON.stringify(seen)} ${await user.messages()}`);
      others.push(seen);
      if (/\bCancel\b/.test(text)) await user.take("Cancel", "Object");
      continue;
    }
    others = [];
    await user.take("Take", "Object");
    await user.sees(/any press stops it/i, "it begins", 20).catch(() => "");
    const result = await until(async () => {
      const now = await user.text();
      if (/mustard in the hand: yes/.test(now)) return "lifted";
      return /any press stops it/i.test(now) ? "" : "ended";
    }, "it is lifted, or it ends", 180 * SLOW);
    await rests(user);
    // The object counts as held after a second in the hand.
    const isDone = result === "lifted" || /done: /.test(await user.messages());
    const held = isDone && await user.sees(/mustard in the hand: yes/, "it is in the hand", 5).catch(() => "");
    say(`round ${round}: ${result}, ${held || "not in the hand"}: ${(await user.messages()).replaceAll("\n", " | ")}`);
    if (held) break;
  }
  const lifted = /mustard in the hand: yes/.test(await user.text());
  await user.take("Finish and keep");
  const over = await user.sees(/episode over: [a-z ]+/, "the end is shown");
  await user.sees(/kept in /, "the file is kept");
  say(`${over}, ${user.presses} presses`);
  return lifted && over.includes("success");
}

async function attempt(browser, seed) {
  const began = performance.now();
  const say = (words) => console.log(`seed ${seed}  ${((performance.now() - began) / 1000 / SLOW).toFixed(1).padStart(6)} s  ${words}`);
  const out = mkdtempSync(path.join(tmpdir(), "wheelarm-lift-"));
  const drive = spawn(PROGRAM, ["drive", "--page", "127.0.0.1:0", "--task", "pick_mustard", "--seed", seed,
    "--camera", process.env.CAMERA || "320x180@10", "--out", out, ...(FILES ? ["--files", FILES] : [])], { stdio: ["ignore", "pipe", "inherit"], env: ENVIRONMENT });
  let context;
  try {
    const url = await new Promise((found, failed) => {
      createInterface({ input: drive.stdout }).on("line", (line) => line.startsWith("drive ") && found(line.slice(6)));
      drive.on("exit", (code) => failed(new Error(`wheelarm drive ended with ${code}`)));
    });
    context = await browser.newContext({ viewport: { width: 1280, height: 800 } });
    const page = await context.newPage();
    await page.addInitScript(CLOCK);
    await page.addInitScript((value) => localStorage.setItem("wheelarm.drive", JSON.stringify(value)), SETTINGS);
    await page.goto(url);
    await page.locator("#stage canvas").first().waitFor();
    say("the page is open");
    const user = new User(page);
    const done = await lift(user, say).catch(async (error) => {
      say(`failed: ${error.message}`);
      return false;
    });
    await user.look(`lift-${seed}`);
    return { done, seconds: Math.round((performance.now() - began) / 1000 / SLOW), presses: user.presses };
  } finally {
    await context?.close();
    drive.removeAllListeners("exit");
    if (drive.exitCode === null) {
      const ended = new Promise((over) => { drive.on("exit", over); });
      drive.kill("SIGINT");
      await ended;
    }
    rmSync(out, { recursive: true, force: true });
  }
}

const browser = await launch(["--disable-gpu"]);
const results = [];
try {
  for (const seed of SEEDS) results.push({ seed, ...(await attempt(browser, seed)) });
} finally {
  await browser.close();
}
console.table(results);
const lifted = results.filter(({ done }) => done).length;
const least = SEEDS.length - Math.floor(SEEDS.length / 6);
console.log(`one switch lifted the mustard in ${lifted} of ${SEEDS.length} seeds, at least ${least} are required`);
process.exitCode = lifted >= least ? 0 : 1;
