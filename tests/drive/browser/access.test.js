// Accessibility of every state that look.js shows, by axe and by measuring; and the
// page on a phone, at 400 %, with reduced motion, by Tab.

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { after, before, test } from "node:test";

import { preset } from "../../../client/teleop/web/page/logic/profile.js";
import { launch, open, until } from "../browser.js";
import { LOOKS } from "../look.js";

const AXE = readFileSync(new URL("../node_modules/axe-core/axe.min.js", import.meta.url), "utf8");

let browser;
before(async () => { browser = await launch(); });
after(() => browser.close());

/** Violations that axe finds, in words. */
async function violations(page) {
  // By the debugger: the page's policy rightly forbids foreign scripts.
  const found = await page.evaluate(async () => (await window.axe.run(document, {
    runOnly: ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa", "best-practice"],
  })).violations.map((one) => `${one.id}: ${one.nodes.map((node) => `${node.target} ${node.any.concat(node.all).map((check) => check.message).join(" ")}`).slice(0, 3).join(" | ")}`));
  return found;
}

/** The targets that are smaller than required. */
const small = (page) => page.evaluate(() => {
  const least = (one) => (one.id === "stop" ? 96 : one.closest(".pad .grid") ? 64 : 44);
  return [...document.querySelectorAll("button, input:not([type=range]), select, textarea, summary, a[href]")]
    .filter((one) => one.checkVisibility())
    .map((one) => ({ one, box: one.getBoundingClientRect() }))
    .filter(({ one, box }) => Math.min(box.width, box.height) < least(one) - 0.5)
    .map(({ one, box }) => `${one.dataset.item || one.id || one.tagName} ${box.width.toFixed(0)}x${box.height.toFixed(0)}`);
});

/** Visible texts below 16 CSS pixels. */
const fine = (page) => page.evaluate(() => {
  const texts = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  const found = new Set();
  while (texts.nextNode()) {
    const { parentElement: one, data } = texts.currentNode;
    if (!data.trim() || one.tagName === "SCRIPT" || !one.checkVisibility()) continue;
    if (parseFloat(getComputedStyle(one).fontSize) < 15.99) found.add(`${data.trim().slice(0, 30)}: ${getComputedStyle(one).fontSize}`);
  }
  return [...found];
});

for (const [name, look] of Object.entries(LOOKS)) {
  for (const dark of [false, true]) {
    test(`${name}, ${dark ? "dark" : "light"}: axe finds nothing, targets and texts are large enough`, async () => {
      const one = await open(browser, { codec: "jpeg", ...look, dark, scripts: [...(look.scripts || []), AXE] });
      try {
        if (look.after) await look.after(one);
        assert.deepEqual(await violations(one.page), []);
        if (!dark) assert.deepEqual(await small(one.page), []);
        if (!dark) assert.deepEqual(await fine(one.page), []);
      } finally {
        await one.close();
      }
    });
  }
}

test("a phone of 360 px and a page at 400 % never scroll sideways; STOP is in sight", async () => {
  for (const size of [{ width: 360, height: 740 }, { width: 320, height: 256 }]) {
    const one = await open(browser, { codec: "jpeg", size, touch: true, settings: preset("touch"), episode: true });
    const view = async (name) => {
      const wide = await one.page.evaluate(() => document.documentElement.scrollWidth - window.innerWidth);
      assert.ok(wide <= 0, `${name} at ${size.width} px is ${wide} px too wide`);
      const box = await one.page.locator("#stop").boundingBox();
      assert.ok(box.x >= 0 && box.y >= 0 && box.x + box.width <= size.width + 0.5 && box.y + box.height <= size.height + 0.5, JSON.stringify(box));
    };
    await view("driving");
    await one.page.evaluate(() => window.scrollTo(0, 5000));
    await view("the end of the page");
    await one.page.locator('[data-item="more"]').click();
    await view("more");
    await one.page.locator('[data-item="settings"]').click();
    await view("settings");
    await one.close();
  }
});

test("on a phone images, instruction, pads and STOP are on one screen", async () => {
  const one = await open(browser, { codec: "jpeg", size: { width: 360, height: 740 }, touch: true, settings: preset("touch"), episode: true });
  const bar = await one.page.locator("#bar").boundingBox();
  for (const what of ["#stage canvas >> nth=0", "#instruction", '[data-item="chair.left"]']) {
    const box = await one.page.locator(what).boundingBox();
    assert.ok(box.y >= 0 && box.y + box.height <= bar.y + 1, `${what} ${JSON.stringify(box)} above ${bar.y}`);
  }
  await one.close();
});

test("Tab reaches every button in the order of the page, and the focus is never hidden", async () => {
  const one = await open(browser, { codec: "jpeg" });
  await one.page.locator('[data-item="settings"]').focus();
  const visited = ["settings"];
  for (let tries = 0; tries < 120; tries += 1) {
    await one.page.keyboard.press("Tab");
    const state = await one.page.evaluate(() => {
      const focused = document.activeElement;
      if (!focused || focused === document.body) return null;
      const box = focused.getBoundingClientRect();
      const points = [[0.1, 0.5], [0.5, 0.5], [0.9, 0.5], [0.5, 0.1], [0.5, 0.9]];
      const inSight = points.some(([u, v]) => {
        const over = document.elementFromPoint(box.left + box.width * u, box.top + box.height * v);
        return over && (focused.contains(over) || over.contains(focused));
      });
      return { name: focused.dataset.item || focused.id, inSight };
    });
    if (!state) break;
    assert.ok(state.inSight, `${state.name} has the focus and is hidden`);
    if (visited.includes(state.name)) break;
    visited.push(state.name);
  }
  const order = ["settings", "stage", "pick", "chair.forward", "start", "stop"].map((name) => visited.indexOf(name));
  assert.ok(order.every((at, index) => at >= 0 && (index === 0 || at > order[index - 1])), JSON.stringify(visited));
  await one.close();
});

test("with reduced motion nothing moves by itself", async () => {
  const one = await open(browser, { codec: "jpeg", reduced: true });
  const moving = await one.page.evaluate(() => [...document.querySelectorAll("*")].filter((each) => {
    const style = getComputedStyle(each);
    return (style.transitionDuration !== "0s" && style.transitionProperty !== "none") || style.animationName !== "none";
  }).map((each) => each.tagName));
  assert.deepEqual(moving, []);
  await one.close();
});

test("events are announced: a refusal is in the live region", async () => {
  const one = await open(browser, { codec: "jpeg" });
  one.gateway.refuse("the command answers a state that is 1.2 s old");
  await until(() => one.page.evaluate(() => document.querySelector("#announcement").textContent.includes("1.2 s old")), "the live region contains it");
  await one.close();
});
