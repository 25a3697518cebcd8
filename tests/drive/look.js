// Images of the page as each person sees it: node look.js FOLDER [NAME…]
// As JPEG for the guides with JPEG=1, in light colors alone with LIGHT=1.

import { mkdirSync } from "node:fs";

import { preset } from "../../client/teleop/web/page/logic/profile.js";
import { launch, open } from "./browser.js";

const PHONE = { width: 360, height: 740 };
const wait = (page, ms) => page.waitForTimeout(ms);

export const LOOKS = {
  login: { user: null },
  keyboard: { settings: preset("keyboard"), episode: true, after: async ({ page, gateway }) => {
    gateway.faults.blocked = { "hand.up": "limit", "chair.forward": "contact" };
    await page.keyboard.down("KeyN");
    await wait(page, 300);
  } },
  touch: { settings: preset("touch"), size: PHONE, touch: true, episode: true },
  switch: { settings: preset("one_switch"), episode: true, after: async ({ page }) => {
    for (const pause of [700, 3600]) {
      await page.keyboard.down("Space");
      await wait(page, 400);
      await page.keyboard.up("Space");
      await wait(page, pause);
    }
  } },
  dwell: { settings: preset("dwell"), episode: true, after: async ({ page }) => {
    const box = await page.locator('[data-item="chair.forward"]').boundingBox();
    await page.mouse.move(box.x + 40, box.y + 60);
    await wait(page, 600);
  } },
  idle: { drive: false },
  more: { episode: true, after: async ({ page }) => page.locator('[data-item="more"]').click() },
  phone_more: { size: PHONE, touch: true, settings: preset("touch"), episode: true, after: async ({ page }) => page.locator('[data-item="more"]').click() },
  phone_alarm: { size: PHONE, touch: true, settings: preset("touch"), after: async ({ gateway, page }) => {
    gateway.recorders = [];
    await page.locator('[data-item="start"]').click();
    await wait(page, 500);
  } },
  phone_switch: { size: PHONE, settings: preset("one_switch"), episode: true, after: async ({ page }) => {
    await page.keyboard.down("Space");
    await wait(page, 400);
    await page.keyboard.up("Space");
    await wait(page, 4000);
  } },
  norecorder: { after: async ({ gateway, page }) => {
    gateway.recorders = [];
    await page.locator('[data-item="start"]').click();
    await wait(page, 500);
  } },
  wide: { size: { width: 1920, height: 1080 }, episode: true },
  laptop: { size: { width: 1366, height: 768 }, settings: preset("touch"), episode: true },
  gamepad: { settings: preset("gamepad"), scripts: ["navigator.getGamepads = () => [{ id: 'Xbox Adaptive Controller', index: 0, connected: true, mapping: 'standard', axes: [0,0,0,0], buttons: Array.from({length:17},()=>({pressed:false,value:0})) }]"] },
  voice: { settings: preset("voice") },
  spectator: { user: "vera", drive: false },
  other: { drive: false, after: async ({ gateway, page }) => {
    gateway.holder = "ben";
    await wait(page, 300);
    await page.locator('[data-item="take"]').click();
    await wait(page, 300);
  } },
  menu: { episode: true, after: async ({ page }) => {
    await page.locator("#stage canvas").first().click({ position: { x: 150, y: 40 } });
    await wait(page, 400);
  } },
  frozen: { after: async ({ gateway, page }) => {
    gateway.frozen = true;
    await wait(page, 1800);
  } },
  alarm: { settings: preset("one_switch"), episode: true, size: { width: 1280, height: 800 }, after: async ({ gateway, page }) => {
    gateway.alarms = ["THE TASK IS LOST (dropped). Finish, discard or redo this episode", "recorder disk failed: the disk is full"];
    await wait(page, 400);
  } },
  settings: { after: async ({ page }) => {
    await page.locator('[data-item="settings"]').click();
  } },
  arrange: { after: async ({ page }) => {
    await page.locator('[data-item="settings"]').click();
    await page.locator('[data-item="arrange"]').click();
  } },
  zoom: { size: { width: 320, height: 256 } },
};

if (import.meta.url === `file://${process.argv[1]}`) {
  const [folder, ...names] = process.argv.slice(2);
  mkdirSync(folder, { recursive: true });
  const browser = await launch();
  for (const [name, look] of Object.entries(LOOKS)) {
    if (names.length > 0 && !names.includes(name)) continue;
    for (const dark of process.env.LIGHT ? [false] : [false, true]) {
      const one = await open(browser, { codec: "jpeg", slow: false, ...look, dark });
      await wait(one.page, 800);
      if (look.after) await look.after(one);
      await wait(one.page, 300);
      const jpeg = process.env.JPEG ? { type: "jpeg", quality: 72 } : {};
      await one.page.screenshot({ path: `${folder}/${name}-${dark ? "dark" : "light"}.${process.env.JPEG ? "jpg" : "png"}`, ...jpeg });
      await one.close().catch((error) => console.log(name, error.message));
    }
  }
  await browser.close();
}
