// Every device as a person uses it, in Chromium, against the gateway for tests.
// The tests check the messages that the gateway received, and their order.

import assert from "node:assert/strict";
import { after, before, test } from "node:test";

import { preset } from "../../../client/teleop/web/page/logic/profile.js";
import { launch, open, painted, until } from "../browser.js";

let browser;
before(async () => { browser = await launch(); });
after(() => browser.close());

const moves = (message) => message.t === "drive" && [...(message.chair || []), ...(message.hand || []), ...(message.turn || []), message.grip].some(Boolean);
const driven = (gateway) => gateway.taken.filter(moves);
const count = (gateway, kind) => gateway.taken.filter((message) => message.t === kind).length;
const item = (page, name) => page.locator(`[data-item="${name}"]`);
/** Runs a test with its own page; errors of the page fail it. */
const on = (name, options, body) => test(name, async () => {
  const one = await open(browser, { codec: "jpeg", ...options });
  try {
    await body(one);
  } finally {
    await one.close();
  }
});
/** No motion and no command for it, during some "alive" messages. */
async function rests(gateway) {
  await until(() => gateway.held === null, "the gateway holds nothing");
  const from = gateway.taken.length;
  await until(() => gateway.taken.slice(from).filter((message) => message.t === "alive").length >= 2, "two signs of life");
  const since = gateway.taken.slice(from);
  // Messages on their way when the gateway braked are dead by their epoch.
  const alive = since.find((message) => moves(message) && message.epoch > gateway.dead);
  assert.ok(!alive, JSON.stringify(alive));
}

on("a key drives while it is held; both lanes carry the same; the tick is a painted one", {}, async ({ gateway, page }) => {
  await page.keyboard.down("KeyW");
  await until(() => driven(gateway).length >= 5, "five drive messages");
  await page.keyboard.up("KeyW");
  await rests(gateway);
  const [first] = driven(gateway);
  assert.deepEqual([first.device, first.mode, first.chair, first.speed], ["keyboard", "hold", [1, 0], 3]);
  assert.ok(first.shown > 0 && first.shown <= gateway.tick && first.shown % 24 === 0, String(first.shown));
  const lanes = [0, 1].map((lane) => gateway.came.filter((one) => one.lane === lane).map((one) => one.raw));
  const both = lanes[0].filter((raw) => lanes[1].includes(raw));
  assert.ok(both.length >= lanes[0].length - 8, `${both.length} of ${lanes[0].length} came twice`);
  assert.ok(gateway.chair[0] > 0);
});

on("keys are not for driving while a button or a field has the focus", {}, async ({ gateway, page }) => {
  await item(page, "pick").focus();
  await page.keyboard.press("KeyW");
  await item(page, "more").click();
  await page.locator("#label").focus();
  await page.keyboard.type("wasd");
  assert.equal(await page.locator("#label").inputValue(), "wasd");
  await rests(gateway);
  assert.equal(driven(gateway).length, 0);
  await page.keyboard.press("Escape");
  await until(() => count(gateway, "stop") > 0, "Esc stops, also from a field");
  await page.keyboard.down("KeyS");
  await until(() => driven(gateway).length > 0, "Esc gave the keys back");
  assert.equal(driven(gateway)[0].chair[0], -1);
  await page.keyboard.up("KeyS");
});

on("Space on a focused pad button drives that button, and nothing else", {}, async ({ gateway, page }) => {
  await item(page, "hand.up").focus();
  await page.keyboard.down("Space");
  await until(() => driven(gateway).length >= 3, "it drives");
  await page.keyboard.up("Space");
  await rests(gateway);
  assert.ok(driven(gateway).every((message) => message.hand[2] === 1 && message.chair.every((value) => value === 0)));
});

on("a mouse button drives while it is down, and stops when it comes up elsewhere", {}, async ({ gateway, page }) => {
  await item(page, "chair.forward").hover();
  await page.mouse.down();
  await until(() => driven(gateway).length >= 3, "it drives");
  await page.mouse.move(5, 5);
  await page.mouse.up();
  await rests(gateway);
  assert.equal(driven(gateway)[0].device, "mouse");
});

on("a finger drives; touchcancel releases", { touch: true, size: { width: 360, height: 740 }, settings: preset("touch") }, async ({ gateway, page, context }) => {
  const cdp = await context.newCDPSession(page);
  const box = await item(page, "chair.forward").boundingBox();
  const points = [{ x: box.x + 30, y: box.y + 30 }];
  await cdp.send("Input.dispatchTouchEvent", { type: "touchStart", touchPoints: points });
  await until(() => driven(gateway).length >= 3, "it drives");
  assert.equal(driven(gateway)[0].device, "touch");
  await cdp.send("Input.dispatchTouchEvent", { type: "touchCancel", touchPoints: [] });
  await rests(gateway);
});

on("click-click: a press latches, the next press anywhere stops and selects nothing", { settings: { ...preset("keyboard"), mode: "latch" } }, async ({ gateway, page }) => {
  await item(page, "chair.forward").click();
  await until(() => driven(gateway).length >= 3, "the latch drives");
  assert.equal(driven(gateway)[0].mode, "latch");
  await page.mouse.down();
  await until(() => count(gateway, "stop") === 3, "three stops");
  await page.mouse.up();
  await rests(gateway);
});

on("click-click ends when the pointer leaves, after a refusal, and by a contact", { settings: { ...preset("keyboard"), mode: "latch" } }, async ({ gateway, page }) => {
  const start = async () => {
    const from = driven(gateway).length;
    await item(page, "chair.forward").click();
    await until(() => driven(gateway).length >= from + 3, "the latch drives");
  };
  await start();
  await page.mouse.move(4, 300);
  await rests(gateway);
  await start();
  gateway.refuse("the command answers a state that is 1.2 s old");
  await rests(gateway);
  await page.locator("#hint").getByText("the command answers a state").waitFor();
  await start();
  gateway.brake();
  gateway.faults.blocked = { "chair.forward": "contact" };
  await rests(gateway);
  assert.match(await item(page, "chair.forward").getAttribute("aria-label"), /touches something/);
});

on("steps: one press is one step", { settings: { ...preset("keyboard"), mode: "step" } }, async ({ gateway, page }) => {
  await item(page, "hand.up").click();
  await until(() => count(gateway, "step") === 1, "one step");
  await page.waitForTimeout(1200);
  await page.keyboard.down("KeyF");
  await page.keyboard.down("KeyF");
  await until(() => count(gateway, "step") === 2, "one by key");
  await page.keyboard.up("KeyF");
  await rests(gateway);
  const steps = gateway.taken.filter((message) => message.t === "step");
  assert.deepEqual(steps.map((step) => [step.part, step.axis, step.sign, step.device]), [["hand", 2, 1, "mouse"], ["hand", 1, -1, "keyboard"]]);
  assert.ok(steps[1].epoch > steps[0].epoch);
  assert.equal(driven(gateway).length, 0);
});

on("losing the focus with a key held stops; the key's repeat moves nothing after it", {}, async ({ gateway, page }) => {
  await page.keyboard.down("KeyW");
  await until(() => driven(gateway).length >= 3, "it drives");
  await page.evaluate(() => window.dispatchEvent(new Event("blur")));
  await until(() => gateway.taken.some((message) => message.t === "stop" && message.why === "blur"), "a stop for the blur");
  await page.keyboard.down("KeyW");
  await rests(gateway);
  await page.keyboard.up("KeyW");
  await page.keyboard.down("KeyW");
  await until(() => gateway.held !== null, "a fresh press drives");
  await page.keyboard.up("KeyW");
});

on("a hidden tab stops, paints nothing, and gets no more than three images", {}, async ({ gateway, page, context }) => {
  await page.keyboard.down("KeyW");
  await until(() => driven(gateway).length >= 3, "it drives");
  const other = await context.newPage();
  await other.bringToFront();
  // Headless Chromium may continue painting; then the test reports the page as hidden itself.
  if (!(await page.evaluate(() => document.hidden))) {
    await page.evaluate(() => {
      Object.defineProperty(document, "hidden", { get: () => true });
      window.requestAnimationFrame = () => 0;
      document.dispatchEvent(new Event("visibilitychange"));
    });
  }
  await until(() => gateway.taken.some((message) => message.t === "stop" && message.why === "hidden") || gateway.log.includes("stall"), "it stops");
  await until(() => gateway.held === null, "nothing is held");
  const acks = await until(async () => {
    const before_ = gateway.acks.length;
    await new Promise((done) => { setTimeout(done, 600); });
    return gateway.acks.length === before_ && before_;
  }, "no image is acknowledged any more");
  assert.equal(gateway.acks.length, acks);
  assert.ok(gateway.inFlight <= 3, String(gateway.inFlight));
});

/** A gamepad that tests control. */
const PAD = `window.pad = { id: "Adaptive Joystick", index: 0, connected: true, mapping: "", axes: [0, 0],
  buttons: [0, 1].map(() => ({ pressed: false, value: 0 })) };
  navigator.getGamepads = () => [window.pad && { ...window.pad, axes: [...window.pad.axes], buttons: window.pad.buttons.map((one) => ({ ...one })) }];
  document.hasFocus = () => true;`;
const stick = (page, x, y) => page.evaluate(([a, b]) => { window.pad.axes = [a, b]; }, [x, y]);
const press = async (page, index) => {
  await page.evaluate((at) => { window.pad.buttons[at] = { pressed: true, value: 1 }; }, index);
  await painted(page);
  await page.evaluate((at) => { window.pad.buttons[at] = { pressed: false, value: 0 }; }, index);
  await painted(page);
};
const tilt = async (page, x, y) => {
  await stick(page, x, y);
  await painted(page);
  await stick(page, 0, 0);
  await painted(page);
};

on("a gamepad of one stick and two buttons: center first, drive, stop, unplug", { settings: preset("gamepad"), scripts: [PAD.replace("axes: [0, 0]", "axes: [0, -1]")] }, async ({ gateway, page }) => {
  await rests(gateway);
  assert.equal(driven(gateway).length, 0, "tilted since it came: it moves nothing");
  await tilt(page, 0, 0);
  await stick(page, 0, -1);
  await until(() => driven(gateway).length >= 3, "it drives");
  assert.deepEqual([driven(gateway)[0].device, driven(gateway)[0].chair[0]], ["gamepad", 1]);
  await press(page, 1);
  await until(() => count(gateway, "stop") >= 3, "its button stops");
  await rests(gateway);
  await tilt(page, 0, 0);
  await stick(page, 0, -1);
  const before_ = driven(gateway).length;
  await until(() => driven(gateway).length > before_, "let go and tilted anew it drives");
  await page.evaluate(() => { window.pad = null; });
  await until(() => gateway.taken.some((message) => message.t === "stop" && message.why === "lost_device"), "unplugged: stop");
  await rests(gateway);
});

on("two axes and two buttons run an episode: start, drive, goal, finish", { settings: preset("gamepad"), scripts: [PAD] }, async ({ gateway, page }) => {
  await painted(page);
  for (let mode = 0; mode < 5; mode += 1) await press(page, 0);
  await page.locator("#hint").getByText("Stick: Buttons of the page").waitFor();
  const take = async (name) => {
    for (let steps = 0; steps < 60; steps += 1) {
      if (await page.evaluate(() => document.querySelector(".framed")?.dataset.item) === name) break;
      await tilt(page, 0, 1);
    }
    assert.equal(await page.evaluate(() => document.querySelector(".framed")?.dataset.item), name);
    await tilt(page, 1, 0);
  };
  await take("start");
  await until(() => gateway.episode, "the episode runs");
  await take("pick");
  await tilt(page, 0.3, 0.3);
  await press(page, 0);
  await until(() => gateway.asks.some((ask) => ask.ask === "pick"), "a place was picked");
  await item(page, "goal:take").waitFor();
  await take("goal:take");
  await until(() => gateway.goal, "the goal runs");
  await painted(page, 30);
  await tilt(page, 0, 1);
  await until(() => count(gateway, "stop") >= 3 && !gateway.goal, "a tilt during the goal stops");
  await take("finish");
  await until(() => gateway.asks.some((ask) => ask.ask === "episode.finish"), "it is finished");
});

on("voice: one phrase is one step, STOP acts before the phrase ends, talk does nothing", { settings: preset("voice"), scripts: [`
  window.SpeechRecognition = class { start() { window.recognize = (words, isFinal) => this.onresult({ resultIndex: 0, results: [Object.assign([{ transcript: words }], { isFinal })] }); } stop() { this.onend?.(); } };
  window.webkitSpeechRecognition = window.SpeechRecognition;`] }, async ({ gateway, page }) => {
  await item(page, "voice").click();
  const say = (words, isFinal = true) => page.evaluate(([text, end]) => window.recognize(text, end), [words, isFinal]);
  await say("hand up");
  await until(() => count(gateway, "step") === 1, "a step");
  assert.equal(gateway.taken.find((message) => message.t === "step").device, "voice");
  await say("could you put your hand up");
  await page.waitForTimeout(2400);
  await say("hand forward", false);
  await say("please st", false);
  await say("please stop", false);
  await until(() => count(gateway, "stop") === 3, "STOP on what is not finished");
  await page.waitForTimeout(1500);
  await say("again");
  await until(() => count(gateway, "step") === 2, "again");
  await page.waitForTimeout(2400);
  await say("slower");
  assert.equal(await item(page, "speed:2").getAttribute("aria-pressed"), "true");
  assert.equal(driven(gateway).length, 0);
});

on("dwelling: mouse moves alone step, start and stop", { settings: { ...preset("dwell"), dwell: { ...preset("dwell").dwell, time: 300 } } }, async ({ gateway, page }) => {
  const rest = async (name) => {
    const target = item(page, name);
    await target.scrollIntoViewIfNeeded();
    const box = await target.boundingBox();
    await page.mouse.move(box.x + box.width / 2 - 3, box.y + box.height / 2);
    await page.mouse.move(box.x + box.width / 2, box.y + box.height / 2);
  };
  await rest("tab:hand");
  await page.waitForTimeout(900);
  await rest("hand.up");
  await until(() => count(gateway, "step") === 1, "a step");
  assert.equal(gateway.taken.find((message) => message.t === "step").device, "dwell");
  // While the step is under way a press would stop it.
  await page.waitForTimeout(2400);
  await rest("start");
  await until(() => gateway.episode, "the episode runs");
  assert.equal(count(gateway, "step"), 1, "only once while it rested");
  await rest("stop");
  await until(() => count(gateway, "stop") === 3, "STOP");
  await page.locator("#stage canvas").first().hover({ position: { x: 200, y: 60 } });
  await page.waitForTimeout(1800);
  assert.equal(gateway.asks.filter((ask) => ask.ask === "pick").length, 0, "an image is not dwelt on while driving");
  await rest("pick");
  await page.waitForTimeout(1800);
  await page.locator("#stage canvas").first().hover({ position: { x: 210, y: 60 } });
  await until(() => gateway.asks.some((ask) => ask.ask === "pick"), "while choosing it is");
});

/** The default settings for one switch; silent. */
const SWITCH = { ...preset("one_switch"), sound: false };
/** The page in real time, with the default scanning times. */
const SIZES = [{ width: 1280, height: 800 }, { width: 1366, height: 768 }, { width: 360, height: 740 }];

/** One switch: the framed item, a press, and choosing an item when it is framed. */
function oneSwitch(page) {
  const framed = () => page.evaluate(() => {
    const one = document.querySelector(".framed");
    return one && (one.dataset.item || `row:${one.dataset.row}`);
  });
  const hit = async () => {
    await page.keyboard.down("Space");
    await page.waitForTimeout(SWITCH.scan.hold + 50);
    await page.keyboard.up("Space");
    await page.waitForTimeout(SWITCH.scan.debounce);
  };
  const take = async (name) => {
    await until(async () => (await framed()) === name, `the frame on ${name}`, 90);
    await hit();
  };
  return { framed, hit, take };
}

/** Visible share of each image, 0 to 1: within the window and not covered. */
const visibleShares = (page) => page.evaluate(() => [...document.querySelectorAll("#stage canvas:not(.over)")].map((canvas) => {
  const box = canvas.getBoundingClientRect();
  let sum = 0;
  for (let row = 0; row < 10; row += 1) {
    for (let column = 0; column < 10; column += 1) {
      const over = document.elementFromPoint(box.left + box.width * (column + 0.5) / 10, box.top + box.height * (row + 0.5) / 10);
      if (over && (over === canvas || over.closest("figure") === canvas.parentElement)) sum += 1;
    }
  }
  return sum / 100;
}));

for (const size of SIZES) {
  const name = `${size.width}x${size.height}`;
  on(`one switch at ${name}: the images are in view at every stop of the frame, and both are swept`, { settings: SWITCH, size, slow: false, episode: true }, async ({ gateway, page }) => {
    const { framed, hit, take } = oneSwitch(page);
    await page.locator("#stage").focus();
    await page.getByText("Press your switch to begin").first().waitFor();
    await hit();
    const stops = new Set();
    await until(async () => {
      const at = await framed();
      const parts = await visibleShares(page);
      assert.ok(parts.length === 2 && parts.every((part) => part > 0.95), `${at}: ${parts} of the images are visible`);
      const hidden = await page.evaluate(() => {
        const box = document.querySelector(".framed")?.getBoundingClientRect();
        return box && (box.top < -1 || box.bottom > innerHeight + 1);
      });
      assert.ok(!hidden, `${at} is framed out of sight`);
      const again = stops.size > 6 && at === "stop";
      if (at) stops.add(at);
      return again;
    }, "the frame went round", 60);
    // On a phone the row of the page has one button, which is then framed itself.
    const last = size.width < 561 ? "more" : "row:Page";
    for (const at of ["row:Object", "row:Gripper", "finish", last]) assert.ok(stops.has(at), [...stops].join());
    await take("row:Gripper");
    await take("grip.close");
    await until(() => count(gateway, "step") === 1, "a step");
    await until(async () => (await visibleShares(page)).every((part) => part > 0.95), "the images are visible within a row");
    await take("back");
    await take("again");
    await until(() => count(gateway, "step") === 2, "the same step");
    assert.deepEqual(gateway.taken.filter((one) => one.t === "step").map((one) => [one.part, one.sign]), [["grip", -1], ["grip", -1]]);
    await page.waitForTimeout(1000);
    await take("row:Object");
    await take("pick");
    for (const camera of ["Chair", "Hand"]) {
      await until(() => page.evaluate((words) => document.querySelector("#hint").textContent.startsWith(words), `${camera} camera: press`), `${camera} camera is swept`);
      const [chair, hand] = await visibleShares(page);
      assert.ok((camera === "Chair" ? chair : hand) > 0.95, `${camera} camera: ${chair} ${hand}`);
    }
    await hit();
    await until(() => page.evaluate(() => document.querySelector("#hint").textContent.includes("over it")), "the second line");
    await hit();
    const pick = await until(() => gateway.asks.find((ask) => ask.ask === "pick"), "two presses name a place");
    assert.equal(pick.camera, 1);
  });
}

on("one switch alone at 1280x800: start an episode, step, choose an object, stop, finish", { settings: SWITCH, size: SIZES[0], slow: false }, async ({ gateway, page }) => {
  const { hit, take } = oneSwitch(page);
  await page.locator("#stage").focus();
  await hit();
  await take("start");
  await until(() => gateway.episode, "the episode runs");
  await take("row:Hand");
  await take("hand.up");
  await until(() => count(gateway, "step") === 1, "a step");
  assert.deepEqual([gateway.taken.find((message) => message.t === "step").device], ["switch"]);
  await take("back");
  await take("row:Object");
  await take("goal:turn");
  await until(() => gateway.asks.some((ask) => ask.ask === "goal.start" && ask.candidate === "task" && ask.action === "turn"), "the chair turns to the object");
  gateway.goal = null;
  await page.waitForTimeout(500);
  await take("pick");
  // A third of the way down and across.
  await page.waitForTimeout(2500);
  await hit();
  await page.waitForTimeout(2500);
  await hit();
  const pick = await until(() => gateway.asks.find((ask) => ask.ask === "pick"), "two presses name a place");
  assert.ok(pick.u > 0.2 && pick.u < 0.7 && pick.v > 0.2 && pick.v < 0.7, JSON.stringify(pick));
  await take("goal:take");
  await until(() => gateway.goal, "the goal runs");
  await page.waitForTimeout(400);
  const asks = gateway.asks.length;
  await hit();
  await until(() => count(gateway, "stop") === 3 && !gateway.goal, "a press during the goal stops");
  assert.equal(gateway.asks.length, asks, "and selects nothing");
  await take("back");
  await take("finish");
  await until(() => gateway.asks.some((ask) => ask.ask === "episode.finish"), "it is finished");
  await page.locator("#hint").getByText("kept in data/").waitFor();
});

on("a carer who picks One switch presses Done by mouse; then the page asks for the switch", {}, async ({ gateway, page }) => {
  await item(page, "settings").click();
  await item(page, "preset:one_switch").click();
  await item(page, "settings:done").click();
  await page.locator("#drive:not([hidden])").waitFor();
  await page.getByText("Press your switch to begin").first().waitFor();
  // Now the pointer is the switch: a click on Settings begins scanning.
  await item(page, "settings").click({ delay: 1200 });
  await page.locator(".framed").waitFor();
  assert.ok(await page.locator("#settings").isHidden());
  // Carer gives it back on any device, and a press while the robot moves is still STOP.
  await page.locator("#carer").click();
  await item(page, "settings").click();
  await page.locator("#settings:not([hidden])").waitFor();
  await item(page, "settings:done").click();
  await page.locator("#carer").click();
  gateway.goal = { id: 1, action: "take", name: "mustard", stage: "reaching", of: 4, at: 2, text: "" };
  await until(() => page.evaluate(() => document.querySelector("#keys_state").textContent.includes("any press stops")), "the goal is shown");
  await item(page, "settings").click();
  await until(() => count(gateway, "stop") === 3, "it stops");
  assert.ok(await page.locator("#settings").isHidden());
});

on("a latched direction ends by any key of any layout", { settings: { ...preset("keyboard"), mode: "latch" } }, async ({ gateway, page }) => {
  await page.locator("#stage").focus();
  for (const key of [{ key: "л", code: "KeyK" }, { key: "Process", code: "" }, { key: "CapsLock", code: "CapsLock" }, { key: "Shift", code: "ShiftLeft" }, { key: "F7", code: "F7" }]) {
    const [from, stops] = [driven(gateway).length, count(gateway, "stop")];
    await page.keyboard.press("KeyJ");
    await until(() => driven(gateway).length >= from + 2, "the latch drives");
    await page.evaluate((init) => document.activeElement.dispatchEvent(new KeyboardEvent("keydown", { ...init, bubbles: true, cancelable: true })), key);
    await until(() => count(gateway, "stop") === stops + 3, `three stops by ${key.key}`);
    await rests(gateway);
  }
});

on("an episode that cannot be recorded does not start, and practice shows that nothing is recorded", {}, async ({ gateway, page }) => {
  const alarm = page.locator("#alarms");
  gateway.recorders = [];
  await item(page, "start").click();
  await alarm.getByText("nothing can be recorded").waitFor();
  assert.equal(gateway.episode, null);
  assert.ok(await page.locator("#pads").isHidden(), "the alarm blocks driving");
  await item(page, "alarm:practise").click();
  await until(() => gateway.episode?.practice, "practice runs");
  await page.locator("#chips").getByText("Practice 0:00: nothing is kept").waitFor();
  await item(page, "finish").click();
  await until(() => !gateway.episode, "it is over");
  // With a recorder the first free label is used, and "kept" appears when the file exists.
  gateway.recorders = ["disk"];
  await item(page, "start").click();
  await until(() => gateway.episode?.label === "mustard-seed3-2", "the next free label");
  await item(page, "finish").click();
  await page.locator("#hint").getByText("kept in data/mustard-seed3-2.h5").waitFor();
  // A failed recorder keeps nothing.
  await item(page, "start").click();
  await until(() => gateway.episode?.label === "mustard-seed3-3", "it runs");
  gateway.recorderState = "failed";
  await item(page, "finish").click();
  await alarm.getByText("NOT KEPT").waitFor();
});

on("a lost task raises an alarm, and the episode is marked", { episode: true }, async ({ gateway, page }) => {
  gateway.alarms = ["THE TASK IS LOST (dropped). Finish, discard or redo this episode"];
  gateway.extra = { evaluation: { success: false, failure: "dropped", elapsed_s: 9, conditions: [] } };
  await page.locator("#alarms").getByText("THE TASK IS LOST").waitFor();
  await page.locator("#chips").getByText("TASK LOST").waitFor();
  await item(page, "alarm:0").click();
  assert.equal(await item(page, "finish").innerText(), "Finish, keep as failed");
});
