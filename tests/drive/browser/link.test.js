// Behavior of the page with images, sockets, rights and errors.

import assert from "node:assert/strict";
import { after, before, test } from "node:test";

import { launch, open, painted as frames, until } from "../browser.js";

let browser;
before(async () => { browser = await launch(); });
after(() => browser.close());

const moves = (message) => message.t === "drive" && [...(message.chair || []), ...(message.hand || [])].some(Boolean);
const driven = (gateway) => gateway.taken.filter(moves);
const stops = (gateway) => gateway.taken.filter((message) => message.t === "stop");
const item = (page, name) => page.locator(`[data-item="${name}"]`);
/** Opens what is not needed at every moment. */
const more = (page) => item(page, "more").click();
const on = (name, options, body) => test(name, async () => {
  const one = await open(browser, { codec: "jpeg", ...options });
  try {
    await body(one);
  } finally {
    await one.close();
  }
});
/** Whether the middle of the first image is not black. */
const painted = (page) => page.evaluate(() => {
  const canvas = document.querySelector("#stage canvas");
  return canvas.getContext("2d").getImageData(canvas.width / 2, canvas.height / 2, 1, 1).data.slice(0, 3).some((value) => value > 20);
});

on("H.264 is decoded and painted where the decoder passes its test", { codec: "auto" }, async ({ gateway, page }) => {
  await until(() => gateway.wants.length > 0, "the page wants images");
  assert.deepEqual(gateway.wants[0].codecs, ["h264", "jpeg"]);
  await until(() => gateway.acks.filter((ack) => ack.painted).length > 10, "ten painted images");
  assert.equal(await page.evaluate(() => document.querySelector("#stage canvas").width), 64);
  assert.ok(await painted(page));
  assert.ok(gateway.inFlight <= 3);
});

const HOLDS = `window.VideoDecoder = class { static async isConfigSupported() { return { supported: true }; }
  constructor(init) { this.init = init; this.state = "unconfigured"; } configure() { this.state = "configured"; } decode() {} close() { this.state = "closed"; } };`;
for (const [name, script] of [["holds images back", HOLDS], ["is missing", "delete window.VideoDecoder;"]]) {
  on(`JPEG takes over when the decoder ${name}`, { codec: "auto", scripts: [script] }, async ({ gateway, page }) => {
    assert.deepEqual(gateway.wants[0].codecs, ["jpeg"]);
    await until(() => gateway.acks.filter((ack) => ack.painted).length > 10, "ten painted images");
    assert.ok(await painted(page));
    await page.keyboard.down("KeyW");
    await until(() => driven(gateway).length > 2, "the page drives");
    await page.keyboard.up("KeyW");
  });
}

on("a frozen image stops what moves and locks driving; STOP works; it comes back", {}, async ({ gateway, page }) => {
  await page.keyboard.down("KeyW");
  await until(() => driven(gateway).length > 2, "it drives");
  gateway.frozen = true;
  await until(() => stops(gateway).some((message) => message.why === "frozen"), "a stop for the frozen image");
  await page.getByText("The image is not live").waitFor();
  await page.keyboard.up("KeyW");
  const before_ = driven(gateway).length;
  await page.keyboard.press("KeyW");
  const former = stops(gateway).length;
  await page.keyboard.press("Escape");
  await until(() => stops(gateway).length > former, "STOP works");
  assert.equal(stops(gateway).at(-1).shown, null);
  assert.equal(driven(gateway).length, before_);
  gateway.frozen = false;
  await page.waitForFunction(() => !document.body.classList.contains("locked"));
  await page.keyboard.down("KeyW");
  await until(() => driven(gateway).length > before_, "it drives again");
  await page.keyboard.up("KeyW");
});

on("age: the speed cap is shown, old images leave steps, older ones STOP", {}, async ({ gateway, page }) => {
  Object.assign(gateway.faults, { age_ms: 480, share: 0.6 });
  await page.locator("#chips").getByText("480 ms, at most 0.21 m/s").waitFor();
  Object.assign(gateway.faults, { allow: "steps", age_ms: 1400 });
  await page.locator("#chips").getByText("1.4 s, only steps").waitFor();
  // Rights apply in the next animation frame.
  await frames(page);
  await page.keyboard.press("KeyW");
  await more(page);
  await item(page, "mode:step").click();
  await item(page, "drawer:close").click();
  await item(page, "chair.forward").click();
  await until(() => gateway.taken.some((message) => message.t === "step"), "a step is taken");
  assert.equal(driven(gateway).length, 0);
  Object.assign(gateway.faults, { allow: "stop", why: "the images are 2.3 s old", age_ms: 2300 });
  await page.getByText("Driving is off: the images are 2.3 s old.").first().waitFor();
});

on("one lane is enough; both gone stop; the page reconnects and nothing moves by itself", {}, async ({ gateway, page }) => {
  const lanes = () => [...gateway.sockets].filter((one) => one.kind === "control");
  await page.keyboard.down("KeyW");
  await until(() => driven(gateway).length > 2, "it drives");
  lanes().find((one) => one.lane === 0).socket.terminate();
  const before_ = driven(gateway).length;
  await until(() => driven(gateway).length > before_ + 5, "it drives on with the other lane");
  for (const one of [...gateway.sockets]) one.socket.terminate();
  await until(() => gateway.held === null, "the gateway brakes");
  await until(() => lanes().length === 2, "both lanes are back");
  await page.waitForFunction(() => !document.body.classList.contains("locked"));
  const dead = gateway.dead;
  const from = gateway.taken.length;
  await until(() => gateway.taken.slice(from).filter((message) => message.t === "alive").length > 2, "signs of life");
  assert.ok(!gateway.taken.slice(from).some((message) => moves(message) && message.epoch > dead), "the key that is still down moves nothing");
  await page.keyboard.up("KeyW");
  await page.keyboard.down("KeyW");
  await until(() => gateway.held !== null, "a fresh press drives");
  await page.keyboard.up("KeyW");
});

on("click on an object, take it, and any press stops the goal", {}, async ({ gateway, page }) => {
  await page.locator("#stage canvas").first().click({ position: { x: 190, y: 60 } });
  await item(page, "goal:take").waitFor();
  const pick = gateway.asks.find((ask) => ask.ask === "pick");
  assert.ok(pick.camera === 0 && pick.tick > 0 && pick.tick <= gateway.tick && pick.u > 0.2 && pick.u < 0.4, JSON.stringify(pick));
  await item(page, "goal:other").click();
  await item(page, "goal:put").waitFor();
  await item(page, "goal:other").click();
  await item(page, "goal:take").click();
  await until(() => gateway.goal?.action === "take", "the goal runs");
  await page.getByText("mustard bottle: the hand goes near (2 of 4)").waitFor();
  // Any press, wherever: here on a button that would do something else.
  await more(page);
  await until(() => stops(gateway).length === 3 && !gateway.goal, "it stops");
});

on("another user drives: locked, control requested, taken by a second press", { drive: false }, async ({ gateway, page }) => {
  gateway.holder = "ben";
  await page.locator("#chips").getByText("ben drives").waitFor();
  await page.keyboard.press("KeyW");
  await item(page, "ask").click();
  await page.locator("#hint").getByText("ben is in control; wait, or take it").waitFor();
  await item(page, "take").click();
  assert.equal(gateway.holder, "ben");
  await item(page, "take").click();
  await until(() => gateway.holder === "anna", "it is taken");
  assert.equal(driven(gateway).length, 0);
  gateway.requestedBy = "ben";
  await more(page);
  await item(page, "give:ben").click();
  await until(() => gateway.holder === "ben", "it is given");
  await page.waitForFunction(() => document.body.classList.contains("locked"));
});

on("no operator: nothing is red, and the first press takes control and acts", { drive: false }, async ({ gateway, page }) => {
  await page.locator("#chips").getByText("No operator is in control").waitFor();
  const red = await page.evaluate(() => [...document.querySelectorAll("#chips .bad, #alarm:not(:empty), #alarms > *")].map((one) => one.textContent));
  assert.deepEqual(red, []);
  await page.locator("#keys_state").getByText("No operator is in control").waitFor();
  await page.keyboard.down("KeyW");
  await until(() => gateway.asks.some((ask) => ask.ask === "lease.ask"), "it asks for control");
  await until(() => driven(gateway).length > 2, "the held key drives");
  await page.keyboard.up("KeyW");
  await until(() => gateway.held === null, "it is released");
  await page.locator("#chips").getByText("You drive").waitFor();
});

on("a press without an operator in control that ends before control is granted moves nothing", { drive: false }, async ({ gateway, page }) => {
  await page.locator("#keys_state").getByText("No operator is in control").waitFor();
  await page.keyboard.press("KeyW");
  await page.locator("#chips").getByText("You drive").waitFor();
  assert.equal(driven(gateway).length, 0);
});

on("Start driving takes control and begins an episode; its time and size are shown", { drive: false }, async ({ gateway, page }) => {
  await item(page, "start").click();
  await until(() => gateway.episode && gateway.holder === "anna", "it runs");
  gateway.episode.seconds = 62;
  await page.locator("#chips").getByText(/● Recording 1:0\d, \d+ MB/).waitFor();
  await page.locator("#aims").getByText("mustard in the hand: not yet").waitFor();
});

on("an episode that no recorder records raises an alarm that blocks driving", { episode: true }, async ({ gateway, page }) => {
  gateway.recorders = [];
  await page.locator("#alarms").getByText("NOTHING IS RECORDED").waitFor();
  assert.ok(await page.locator("#pads").isHidden());
  await page.keyboard.down("KeyW");
  await page.getByText("Read the alarm first").first().waitFor({ state: "attached" });
  await page.keyboard.up("KeyW");
  assert.equal(driven(gateway).length, 0);
  await item(page, "alarm:0").click();
  await page.locator("#pads").waitFor();
  // On a busy machine the image may be frozen for a moment: a press then drives nothing.
  await page.waitForFunction(() => !document.body.classList.contains("locked"));
  await page.keyboard.down("KeyW");
  await until(() => driven(gateway).length > 2, "after it was read the person drives");
  await page.keyboard.up("KeyW");
});

on("a viewer sees and cannot drive", { user: "vera", drive: false }, async ({ gateway, page }) => {
  await until(() => gateway.acks.filter((ack) => ack.painted).length > 3, "images arrive");
  assert.ok(![...gateway.sockets].some((one) => one.kind === "control"));
  assert.equal(await page.locator('[data-item="take"]').count(), 0);
  assert.equal(await item(page, "start").isDisabled(), true);
  await page.getByText("You are watching").first().waitFor();
});

on("a wrong password shows an error, the right one opens the page", { user: null }, async ({ page }) => {
  await page.locator("#user").fill("anna");
  await page.locator("#password").fill("wrong");
  await page.keyboard.press("Enter");
  await page.getByText("Name or password is wrong").waitFor();
  await page.locator("#password").fill("abc");
  await page.keyboard.press("Enter");
  await page.locator("#drive:not([hidden])").waitFor();
});

on("an episode: start with a label, discard asks twice, redo asks twice", {}, async ({ gateway, page }) => {
  await more(page);
  await page.locator("#label").fill("try-1");
  await item(page, "start").click();
  await until(() => gateway.episode?.label === "try-1", "it runs under its label");
  await page.locator("#chips").getByText("● Recording 0:00").waitFor();
  await more(page);
  await item(page, "discard").click();
  await page.getByText("Discard: press again").waitFor();
  assert.ok(gateway.episode);
  await item(page, "redo").click();
  await page.getByText("Redo: press again").waitFor();
  await item(page, "discard").click();
  await item(page, "discard").click();
  await until(() => gateway.asks.some((ask) => ask.ask === "episode.discard"), "it is discarded");
  assert.ok(!gateway.asks.some((ask) => ask.ask === "episode.redo"));
});

on("settings persist, are saved to a file and are validated when loaded", {}, async ({ page }) => {
  await item(page, "settings").click();
  await item(page, "preset:dwell").click();
  await item(page, "theme:dark").click();
  const [download] = await Promise.all([page.waitForEvent("download"), item(page, "export").click()]);
  await page.reload();
  await page.locator("#drive:not([hidden])").waitFor();
  assert.equal(await page.evaluate(() => document.documentElement.dataset.theme), "dark");
  await item(page, "settings").click();
  // A pointer that rests on the button would press it again.
  await page.mouse.move(4, 400);
  assert.equal(await item(page, "preset:dwell").getAttribute("aria-pressed"), "true");
  await item(page, "preset:keyboard").click();
  await page.locator("#settings_file").setInputFiles(await download.path());
  await page.waitForFunction(() => JSON.parse(localStorage.getItem("wheelarm.drive")).preset === "dwell");
  await page.locator("#settings_file").setInputFiles({ name: "x.json", mimeType: "application/json", buffer: Buffer.from("{\"version\":2}") });
  await page.locator("#hint").getByText("The file cannot be used").waitFor();
});

on("a key is remapped, pads are arranged without dragging", {}, async ({ gateway, page }) => {
  await item(page, "settings").click();
  await page.locator("summary").click();
  await item(page, "key:hand.up").click();
  await page.keyboard.press("KeyP");
  await page.waitForFunction(() => JSON.parse(localStorage.getItem("wheelarm.drive")).keys.KeyP === "hand.up");
  await item(page, "arrange").click();
  await item(page, "arrange:hand:earlier").click();
  await item(page, "arrange:hand:larger").click();
  await item(page, "arrange:turn:hide").click();
  await item(page, "arrange:done").click();
  assert.deepEqual(await page.locator(".pad").evaluateAll((all) => all.map((one) => one.dataset.pad)), ["hand", "chair", "grip"]);
  await page.locator("#stage").focus();
  await page.keyboard.down("KeyP");
  await until(() => driven(gateway).some((message) => message.hand[2] === 1), "the new key drives");
  await page.keyboard.up("KeyP");
});
