// A page of the fake gateway in Chromium, for tests and for the guide's images.

import { chromium } from "playwright-core";

import { Gateway } from "./gateway.js";

export const EXECUTABLE = process.env.CHROMIUM || "/usr/bin/chromium";
// Playwright disables the throttling of hidden pages; these tests need it.
const AWAKE = ["--disable-background-timer-throttling", "--disable-backgrounding-occluded-windows", "--disable-renderer-backgrounding"];

// The page's clock runs at a third of its speed: its limits of a second and less
// are then no race on a machine that has other work. Tests check order alone.
const SLOW = "{ const real = performance.now.bind(performance); performance.now = () => real() / 3; }";

/** The headset's tests need WebGL. */
const WEBGL = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader"];

/** Starts Chromium once for all tests of a file. */
export const launch = (graphics = WEBGL) => chromium.launch({
  executablePath: EXECUTABLE, ignoreDefaultArgs: AWAKE,
  args: ["--no-sandbox", ...graphics, "--use-fake-device-for-media-stream", "--use-fake-ui-for-media-stream"],
});

/**
 * A gateway and a page of it: {gateway, page, context, close}. `settings` are those
 * of the browser, `scripts` run before the page's.
 */
export async function open(browser, { user = "anna", drive = true, size = { width: 1280, height: 800 }, dark = false, touch = false,
  settings, scripts = [], reduced = false, codec = "auto", episode = false, slow = true } = {}) {
  const gateway = await new Gateway().start();
  gateway.codec = codec;
  const context = await browser.newContext({ viewport: size, hasTouch: touch, isMobile: false,
    colorScheme: dark ? "dark" : "light", reducedMotion: reduced ? "reduce" : "no-preference" });
  const page = await context.newPage();
  const problems = [];
  page.on("pageerror", (error) => problems.push(String(error)));
  page.on("console", (line) => {
    if (line.type() === "error" && !line.text().includes("401")) problems.push(line.text());
  });
  for (const script of [...(slow ? [SLOW] : []), ...scripts]) await page.addInitScript(script);
  if (settings) await page.addInitScript((value) => localStorage.setItem("wheelarm.drive", JSON.stringify(value)), settings);
  await page.goto(gateway.url);
  const close = async () => {
    await context.close();
    gateway.stop();
    if (problems.length > 0) throw new Error(`the page had errors: ${problems.join("; ")}`);
  };
  if (user) {
    await page.locator("#user").fill(user);
    await page.locator("#password").fill("abc");
    await page.locator('[data-item="login"]').evaluate((one) => one.form.requestSubmit());
    await page.locator("#drive:not([hidden])").waitFor();
    await page.locator("#stage canvas").first().waitFor();
    if (drive) {
      gateway.holder = user;
      // A busy machine may show nothing for a second at the start.
      await until(() => gateway.acks.filter((ack) => ack.painted).length > 6, "images are painted");
      await page.waitForFunction(() => document.body.classList.contains("mine") && !document.body.classList.contains("locked"));
    }
    if (episode) gateway.episode = { number: 4, label: "mustard-seed3-1", instruction: "Bring the mustard to the person.", seconds: 12 };
  }
  return { gateway, page, context, close, problems };
}

/** Waits until `test` holds; tests by order, never by time. */
export async function until(test, what, patience = 30) {
  for (let tries = 0; tries < (patience * 40); tries += 1) {
    const value = await test();
    if (value) return value;
    await new Promise((done) => { setTimeout(done, 25); });
  }
  throw new Error(`it never came: ${what}`);
}

/** Waits for so many animation frames of the page. */
export const painted = (page, frames = 3) => page.evaluate((count) => new Promise((done) => {
  const next = (left) => (left === 0 ? done() : requestAnimationFrame(() => next(left - 1)));
  next(count);
}), frames);
