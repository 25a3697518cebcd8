// The buttons that drive, by pointer, by a key on a focused button, and by
// assistive programs that click.

import { MOTIONS, PADS } from "../logic/motions.js";
import { $, button, h, text } from "./dom.js";

const GLYPH = (glyph) => h("b", { "aria-hidden": "true" }, glyph);
const deviceOf = (event) => (event.pointerType === "mouse" || !event.pointerType ? "mouse" : "touch");

export class Pads {
  /** `app` gives driver, settings, now(), flush(), device of a click. */
  constructor(app) {
    this.app = app;
    this.buttons = new Map();
    this.tab = "chair";
  }

  /** Builds pads, speeds and modes from the settings. */
  draw(arranging) {
    const { settings } = this.app;
    this.buttons.clear();
    const shown = settings.pads.filter((pad) => !pad.hidden || arranging);
    $("pads").replaceChildren(...shown.map((pad) => this.pad(pad, arranging)));
    $("tabs").replaceChildren(...shown.map(({ name }) => button(`tab:${name}`, PADS[name].label, () => this.choose(name))));
    if (!shown.some((pad) => pad.name === this.tab) && shown.length > 0) this.tab = shown[0].name;
    $("speeds").replaceChildren(h("span", { className: "quiet" }, "Speed"), ...[1, 2, 3, 4, 5].map((speed) =>
      button(`speed:${speed}`, String(speed), () => this.app.setSpeed(speed), { "aria-label": `Speed ${speed}` })));
    const words = { hold: "Hold", latch: "Press on, press off", step: "Steps" };
    $("modes").replaceChildren(...Object.entries(words).map(([mode, label]) =>
      button(`mode:${mode}`, label, () => this.app.setMode(mode))));
    const { dwell } = this.app.inputs;
    if (settings.dwell.on) {
      $("modes").append(button("rest", dwell.resting ? "Resting presses again" : "Look without pressing", () => {
        dwell.resting = !dwell.resting;
        this.draw(arranging);
      }, { "aria-pressed": String(dwell.resting) }));
    }
    this.choose(this.tab);
    this.mark();
  }

  pad({ name, size }, arranging) {
    const { label, rows } = PADS[name];
    const cells = rows.flat().map((motion) => (motion ? this.motion(motion) : h("span")));
    const grid = h("div", { className: "grid" }, ...cells);
    grid.style.setProperty("--size", `${size}px`);
    grid.style.setProperty("--columns", String(rows[0].length));
    const arrange = arranging ? h("div", { className: "buttons arrange", "data-row": `Arrange ${label}` },
      ...[["Earlier", "earlier"], ["Later", "later"], ["Larger", "larger"], ["Smaller", "smaller"],
        [this.app.hiddenPad(name) ? "Show" : "Hide", "hide"]].map(([words, what]) =>
        button(`arrange:${name}:${what}`, words, () => this.app.arrange(name, what), { "aria-label": `${words}: ${label}` })))
      : null;
    return h("section", { className: "pad", "aria-label": label, "data-row": label, "data-pad": name },
      h("h2", {}, label), grid, arrange);
  }

  motion(name) {
    const { label, words, glyph } = MOTIONS[name];
    const one = button(name, "", () => {}, { "aria-label": words });
    one.append(GLYPH(glyph), h("span", {}, label));
    this.buttons.set(name, one);
    this.listen(one, name);
    return one;
  }

  listen(one, name) {
    const { app } = this;
    const { driver } = app;
    let byPointer = false;
    const let_go = (event) => {
      driver.release(`pointer:${event.pointerId}`);
      app.flush();
    };
    one.addEventListener("pointerdown", (event) => {
      if (event.button !== 0) return;
      byPointer = true;
      // No focus: keys continue to drive, and Space does not also press this button.
      event.preventDefault();
      if (app.settings.mode === "hold") {
        one.setPointerCapture(event.pointerId);
        driver.press(`pointer:${event.pointerId}`, name, deviceOf(event), app.now());
      } else if (app.settings.mode === "latch") driver.toggle(name, deviceOf(event), app.now());
      app.flush();
    });
    for (const kind of ["pointerup", "pointercancel", "lostpointercapture"]) one.addEventListener(kind, let_go);
    one.addEventListener("contextmenu", (event) => {
      event.preventDefault();
      // A long press of a finger drives; with a mouse the context menu is another button.
      if (event.pointerType === "touch") return;
      driver.guard("lost_device", "");
      app.flush();
    });
    one.addEventListener("pointermove", () => {
      if (driver.latch?.names === name) driver.renew(app.now());
    });
    one.addEventListener("pointerleave", (event) => {
      if (event.pointerType === "mouse" && driver.latch?.names === name && driver.latch.device === "mouse") driver.unlatch();
    });
    one.addEventListener("keydown", (event) => {
      if (event.code !== "Enter" && event.code !== "Space") return;
      if (app.settings.mode !== "hold" || event.repeat) {
        if (event.repeat) event.preventDefault();
        return;
      }
      event.preventDefault();
      driver.press(`button:${name}`, name, "keyboard", app.now());
      app.flush();
    });
    const up = () => {
      driver.release(`button:${name}`);
      app.flush();
    };
    one.addEventListener("keyup", up);
    one.addEventListener("blur", up);
    one.addEventListener("click", () => {
      const pointer = byPointer;
      byPointer = false;
      const device = app.clickDevice;
      if (app.settings.mode === "step") driver.step(name, device || (pointer ? "mouse" : "keyboard"), app.now());
      else if (device || !pointer) {
        // Scanning, dwelling, voice and screen readers cannot hold.
        if (app.settings.mode === "latch" && device !== "voice") driver.toggle(name, device || "keyboard", app.now());
        else driver.step(name, device || "keyboard", app.now());
      }
      app.flush();
    });
  }

  choose(name) {
    this.tab = name;
    const tabs = this.tabbed();
    $("tabs").hidden = !tabs;
    $("driving").classList.toggle("tabbed", tabs);
    for (const pad of document.querySelectorAll(".pad")) pad.hidden = tabs && pad.dataset.pad !== name;
    for (const one of $("tabs").children) one.setAttribute("aria-pressed", String(one.dataset.item === `tab:${name}`));
  }

  tabbed() {
    const { tabs, pads } = this.app.settings;
    if (tabs !== "narrow") return tabs === "always";
    // One pad at a time where they do not fit beside each other.
    const shown = pads.filter((pad) => !pad.hidden);
    const wide = shown.reduce((sum, { name, size }) => sum + PADS[name].rows[0].length * (size + 8) + 12, -20);
    return wide > ($("driving").clientWidth || window.innerWidth);
  }

  /** Marks the chosen speed and mode. */
  mark() {
    for (const one of $("speeds").querySelectorAll("button")) {
      one.setAttribute("aria-pressed", String(one.dataset.item === `speed:${this.app.driver.speed}`));
    }
    for (const one of $("modes").querySelectorAll('[data-item^="mode:"]')) {
      one.setAttribute("aria-pressed", String(one.dataset.item === `mode:${this.app.settings.mode}`));
    }
  }

  /** Marks moving, latched and blocked directions. */
  show(active, latched, blocked) {
    for (const [name, one] of this.buttons) {
      one.classList.toggle("active", active.includes(name));
      one.classList.toggle("latched", latched === name);
      one.classList.toggle("limit", blocked[name] === "limit");
      one.classList.toggle("contact", blocked[name] === "contact");
      const why = { limit: ", at its limit", contact: ", touches something" }[blocked[name]] || "";
      const words = MOTIONS[name].words + why;
      if (one.getAttribute("aria-label") !== words) one.setAttribute("aria-label", words);
    }
    text($("keys_state"), this.app.keysState());
  }
}
