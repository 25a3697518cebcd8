// The settings: presets, how each device behaves, keys, gamepads, and the file.

import { keyName, remap } from "../logic/keys.js";
import { MOTIONS } from "../logic/motions.js";
import { PRESETS, checked, preset } from "../logic/profile.js";
import { $, button, h } from "./dom.js";
import { Voice } from "./voice.js";

const KEY = "wheelarm.drive";

/** The validated settings stored in this browser. */
export function stored() {
  try {
    return checked(JSON.parse(localStorage.getItem(KEY) || "{}"));
  } catch {
    return checked({});
  }
}

/** Stores the settings in this browser, where it allows that. */
export function keep(settings) {
  try {
    localStorage.setItem(KEY, JSON.stringify(settings));
  } catch {
    // A private window stores nothing; the file still can.
  }
}

export class Settings {
  constructor(app) {
    this.app = app;
    this.listening = null;
    this.learning = null;
  }

  draw() {
    const { settings } = this.app;
    const body = $("settings_body");
    const focused = document.activeElement?.dataset?.item;
    body.replaceChildren(
      h("div", { className: "buttons", "data-row": "Settings" }, button("settings:done", "Done", () => this.app.view("drive"), { className: "first" }),
        button("logout", "Sign out", () => this.app.logout())),
      this.presets(settings),
      this.look(settings),
      this.scan(settings),
      this.dwell(settings),
      this.gamepads(settings),
      this.voice(settings),
      this.keys(settings),
      this.file(),
    );
    if (focused) body.querySelector(`[data-item="${CSS.escape(focused)}"]`)?.focus();
  }

  change(change) {
    this.app.change({ ...this.app.settings, ...change });
    this.draw();
  }

  section(title, row, ...content) {
    return h("section", { "data-row": row || title }, h("h3", {}, title), ...content);
  }

  presets(settings) {
    return this.section("How I drive", "", h("div", { className: "presets" },
      ...Object.entries(PRESETS).map(([name, { label, words }]) => {
        const one = button(`preset:${name}`, "", () => {
          // Manual settings of devices stay with the browser's keys and maps.
          const { keys, gamepad, theme } = this.app.settings;
          this.change({ ...preset(name), keys, gamepad, theme });
          // A person who chose it with a pointer still needs the pointer, for Done.
          if (this.app.clickDevice === null) this.app.setCarer(true);
        }, { "aria-pressed": String(settings.preset === name) });
        one.append(h("b", {}, label), h("small", {}, words));
        return one;
      })));
  }

  look(settings) {
    const themes = { auto: "Light or dark as the system", light: "Light", dark: "Dark" };
    return this.section("Look and pads", "Look",
      h("div", { className: "buttons" }, ...Object.entries(themes).map(([name, label]) =>
        button(`theme:${name}`, label, () => this.change({ theme: name }), { "aria-pressed": String(settings.theme === name) }))),
      h("p", {}, ""),
      h("div", { className: "buttons" },
        button("arrange", "Arrange the pads", () => this.app.arranging(true)),
        button("tabs", settings.tabs === "always" ? "Show all pads at once" : "Show one pad at a time",
          () => this.change({ tabs: settings.tabs === "always" ? "never" : "always" }))));
  }

  range(item, label, value, least, most, by, unit, set) {
    const id = `range_${item}`;
    const shown = h("output", { for: id }, `${value} ${unit}`);
    const input = h("input", { id, type: "range", min: least, max: most, step: by, value,
      oninput: () => { shown.textContent = `${input.value} ${unit}`; },
      onchange: () => set(Number(input.value)) });
    const nudge = (sign) => () => set(Math.min(most, Math.max(least, value + sign * by)));
    return h("div", {}, h("label", { for: id }, label), " ", shown, input,
      h("div", { className: "buttons" },
        button(`${item}:less`, "−", nudge(-1), { "aria-label": `${label}: less` }),
        button(`${item}:more`, "+", nudge(1), { "aria-label": `${label}: more` })));
  }

  check(item, label, on, set) {
    return h("div", { className: "buttons" }, button(item, `${label}: ${on ? "on" : "off"}`, () => set(!on),
      { "aria-pressed": String(on) }));
  }

  scan({ scan, sound }) {
    const set = (name) => (value) => this.change({ scan: { ...scan, [name]: value } });
    const kinds = { rows: "Row, then button", linear: "Every button", two: "Two switches" };
    return this.section("Scanning with a switch", "Scanning",
      this.check("scan:on", "Scanning", scan.on, (on) => {
        set("on")(on);
        if (this.app.clickDevice === null) this.app.setCarer(true);
      }), h("p", {}, ""),
      h("div", { className: "buttons" }, ...Object.entries(kinds).map(([kind, label]) =>
        button(`scan:${kind}`, label, () => set("kind")(kind), { "aria-pressed": String(scan.kind === kind) }))),
      h("p", { className: "quiet" }, "The switch is Space, a click anywhere, or any gamepad button; a second switch is Enter. Carer, at the top of the page, gives the pointer back to a carer."),
      h("div", { className: "fields" },
        this.range("scan.interval", "Each button is framed for", scan.interval, 500, 5000, 100, "ms", set("interval")),
        this.range("scan.first", "The first one longer by", scan.first, 0, 3000, 100, "ms", set("first")),
        this.range("scan.loops", "Rounds until it rests", scan.loops, 1, 20, 1, "", set("loops")),
        this.range("scan.hold", "A press counts after", scan.hold, 0, 2000, 50, "ms", set("hold")),
        this.range("scan.debounce", "Then ignore presses for", scan.debounce, 0, 3000, 50, "ms", set("debounce"))),
      this.check("sound", "Sound at every move of the frame", sound, (on) => this.change({ sound: on })));
  }

  dwell({ dwell }) {
    const set = (name) => (value) => this.change({ dwell: { ...dwell, [name]: value } });
    return this.section("Resting the pointer (eye tracker, head mouse)", "Resting",
      this.check("dwell:on", "Resting presses", dwell.on, set("on")), h("p", {}, ""),
      h("div", { className: "fields" },
        this.range("dwell.time", "Resting time", dwell.time, 300, 3000, 100, "ms", set("time")),
        this.range("dwell.radius", "The pointer may stray by", dwell.radius, 5, 60, 5, "pixels", set("radius")),
        this.range("dwell.stop", "Resting time of STOP", dwell.stop, 200, 1000, 100, "ms", set("stop"))));
  }

  gamepads({ gamepad }) {
    const pads = this.app.inputs.gamepadList();
    const rows = pads.map((pad) => h("div", {},
      h("p", {}, `${pad.id} (${pad.mapping === "standard" ? "standard layout" : "own layout"})`),
      h("div", { className: "buttons" }, ...["stop", "next", "open", "close", "up", "down", "take"].map((name) => {
        const learning = this.learning?.name === name && this.learning.id === pad.id;
        const words = { stop: "STOP", next: "Next pad", open: "Open", close: "Close", up: "Hand up", down: "Hand down", take: "Choose" };
        return button(`learn:${pad.index}:${name}`, learning ? "Press a button of the device …" : `${words[name]}: button ${this.app.inputs.gamepads.map(pad)[name].join(", ") || "none"}`,
          () => {
            this.learning = { id: pad.id, name };
            this.draw();
          });
      }))));
    return this.section("Gamepad, joystick, adaptive controller", "Gamepad",
      ...(rows.length > 0 ? rows : [h("p", { className: "quiet" }, "None is connected. Press a button of it: browsers show it only then.")]),
      h("div", { className: "fields" },
        this.range("deadzone", "Dead zone", Math.round(gamepad.deadzone * 100), 2, 60, 2, "%",
          (value) => this.change({ gamepad: { ...gamepad, deadzone: value / 100 } }))),
      h("p", { className: "quiet" }, "A QuadStick or an adaptive controller appears here, or as mouse or keyboard, as it is set up."));
  }

  /** A button of a device was pressed while a button is being assigned. */
  learned(id, index) {
    if (!this.learning || this.learning.id !== id) return;
    const { name } = this.learning;
    this.learning = null;
    const { gamepad } = this.app.settings;
    this.change({ gamepad: { ...gamepad, maps: { ...gamepad.maps, [id]: { ...gamepad.maps[id], [name]: [index] } } } });
  }

  voice({ voice }) {
    const set = (name) => (value) => this.change({ voice: { ...voice, [name]: value } });
    if (!Voice.possible) {
      return this.section("Voice", "", h("p", {}, "This browser does not recognize speech. Chrome, Edge and Safari do."));
    }
    return this.section("Voice", "",
      h("p", { className: "careful" }, "Most browsers send the microphone's sound to their maker's computers. It listens only after the button, and never longer than 8 s after the last phrase."),
      this.check("voice:on", "Voice", voice.on, set("on")), h("p", {}, ""),
      this.check("voice:local", "On this computer where the browser can", voice.local, set("local")));
  }

  keys({ keys, keysOn }) {
    const actions = [...new Set(Object.values(keys))];
    const words = (action) => action.split("+").map((name) => MOTIONS[name]?.words || name).join(", ");
    const rows = actions.map((action) => {
      const codes = Object.keys(keys).filter((code) => keys[code] === action);
      const waits = this.listening === action;
      return h("tr", {}, h("th", { scope: "row" }, words(action)), h("td", {}, codes.map(keyName).join("  ")),
        h("td", {}, button(`key:${action}`, waits ? "Press a key …" : "Change", (event) => this.listen(action, codes[0], event.target),
          { "aria-label": waits ? "Press a key" : `Change the key: ${words(action)}` })));
    });
    return this.section("Keys", "",
      this.check("keys:on", "Single keys drive", keysOn, (on) => this.change({ keysOn: on })),
      h("p", { className: "quiet" }, "Keys drive only while no button or field has the focus. Esc always stops."),
      h("details", {}, h("summary", {}, "All keys"), h("table", {}, h("tbody", {}, ...rows)),
        h("div", { className: "buttons" }, button("keys:usual", "Usual keys", () => this.change({ keys: preset("keyboard").keys })))));
  }

  listen(action, old, target) {
    this.listening = action;
    target.textContent = "Press a key …";
    const take = (event) => {
      event.preventDefault();
      event.stopPropagation();
      this.listening = null;
      if (event.code === "Escape" || event.code === "Tab") this.draw();
      else this.change({ keys: remap(this.app.settings.keys, old, event.code, action) });
    };
    target.addEventListener("keydown", take, { once: true });
    target.addEventListener("blur", () => {
      if (this.listening !== action) return;
      this.listening = null;
      target.textContent = "Change";
    }, { once: true });
  }

  file() {
    const input = h("input", { type: "file", id: "settings_file", accept: "application/json,.json", onchange: async () => {
      try {
        const file = input.files[0];
        if (file.size > 200_000) throw new Error("it is longer than 200 kB");
        const read = JSON.parse(await file.text());
        if (!read || read.version !== 1 || !Object.hasOwn(PRESETS, read.preset)) throw new Error("the file does not contain settings of this page");
        this.change(checked(read));
        this.app.say("The settings are loaded", false);
      } catch (error) {
        this.app.say(`The file cannot be used: ${error.message}`, true);
      }
    } });
    return this.section("File", "",
      h("p", {}, "The settings stay in this browser. A file takes them to another one."),
      h("div", { className: "buttons" }, button("export", "Save as a file", () => {
        const url = URL.createObjectURL(new Blob([JSON.stringify(this.app.settings, null, 1)], { type: "application/json" }));
        h("a", { href: url, download: "wheelarm-drive.json" }).click();
        setTimeout(() => URL.revokeObjectURL(url), 1000);
      })),
      h("p", {}, h("label", { for: "settings_file" }, "Read a file"), input));
  }
}
