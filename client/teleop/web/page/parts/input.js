// Input devices: keyboard, pointer, switch, gamepad and dwelling
// pointer. Each drives or presses a button of the page.

import { Cursor, Cross, Scanner } from "../logic/scan.js";
import { Dwell } from "../logic/dwell.js";
import { Gamepads, STICK_MODES, steepest } from "../logic/gamepad.js";
import { meaning } from "../logic/keys.js";
import { $, elementOf, rowsOf, takesKeys } from "./dom.js";
import { lettersOpen } from "./letters.js";
import { tick } from "./sound.js";

const now = () => performance.now();
/** The pad that is shown while the stick moves its part. */
const PADS_OF = { chair: "chair", hand: "hand", height: "hand", tip: "turn", grip: "grip" };

export class Inputs {
  constructor(app) {
    const { scan, dwell, gamepad } = app.settings;
    this.app = app;
    this.scanner = new Scanner(scan);
    this.dwell = new Dwell(dwell);
    this.gamepads = new Gamepads(gamepad.maps, gamepad.deadzone);
    this.cursor = new Cursor();
    this.turning = false;
  }

  /** Applies changed settings. */
  apply({ scan, dwell, gamepad }) {
    Object.assign(this.scanner.settings, scan);
    this.scanner.row = null;
    Object.assign(this.dwell.settings, dwell);
    this.gamepads.maps = gamepad.maps;
    this.gamepads.deadzone = gamepad.deadzone;
  }

  /** In the animation frame. */
  frame(at) {
    this.readGamepads(at);
    if (this.app.settings.scan.on) this.scan(at);
    if (!this.app.settings.dwell.on) return;
    const clicked = this.dwell.tick(at);
    if (clicked) this.app.activate(clicked, "dwell");
  }

  /** Opens a cross over the image for users who cannot point: swept, or moved by a stick. */
  openCross() {
    const { app } = this;
    const shown = app.stage.shown();
    const camera = app.stage.large ?? shown[0];
    if (app.settings.scan.on) {
      app.stage.cross = new Cross(now(), [camera, ...shown.filter((other) => other !== camera)]);
      this.swept = null;
      return;
    }
    app.stage.cross = { camera, u: 0.5, v: 0.5, at() { return { camera: this.camera, u: this.u, v: this.v }; } };
    app.stage.reveal(camera);
    app.say("Press when the line is over it", false);
  }

  /** The swept image is scrolled into view before a press is needed. */
  showSwept({ camera, u }) {
    const { app } = this;
    const key = `${camera} ${u === null}`;
    if (key === this.swept) return;
    this.swept = key;
    app.stage.reveal(camera);
    const { title } = app.stage.figures.get(camera);
    app.say(u === null ? `${title}: press when the line is at the right height` : `${title}: press when the line is over it`, false);
  }

  /** Whether the stick is on the buttons of the page. */
  inMenu() {
    return this.gamepads.pads.size > 0 && STICK_MODES[this.gamepads.mode].name === "menu";
  }

  key(event, down) {
    const { app } = this;
    const at = now();
    if (down && !event.repeat && event.code !== "Escape" && app.driver.intercept("keyboard", at)) {
      // Any key stops a motion that continues on its own, whatever its meaning in the layout.
      event.preventDefault();
      event.stopImmediatePropagation();
      app.flush();
      return;
    }
    if (["Shift", "Control", "Alt", "Meta", "CapsLock"].includes(event.key)) {
      // While Meta is down some systems do not report the release of other keys.
      if (event.key === "Meta") {
        for (const id of [...app.driver.sources.keys()]) if (id.startsWith("key:")) app.driver.release(id);
      }
      return;
    }
    const focused = document.activeElement;
    if (down && event.code === "Escape") {
      event.preventDefault();
      app.stop("keyboard");
      if (app.where === "drive") $("stage").focus({ preventScroll: true });
      return;
    }
    const typing = focused?.matches?.("input, textarea, select");
    const which = { Space: 1, Enter: 2 }[event.code];
    if (app.settings.scan.on && which && !typing) {
      event.preventDefault();
      event.stopImmediatePropagation();
      if (!event.repeat) this.switched(app.settings.scan.kind === "two" ? which : 1, down, at);
      return;
    }
    if (down && app.stage.picking && !typing && this.crossKey(event)) return;
    if (!down) {
      app.driver.release(`key:${event.code}`);
      app.flush();
      return;
    }
    if (app.where !== "drive" || !app.settings.keysOn || takesKeys(focused) || event.repeat) return;
    const action = meaning(event, app.settings.keys, this.turning);
    if (!action) return;
    event.preventDefault();
    this.keyed(action, event.code, at);
    app.flush();
  }

  keyed(action, code, at) {
    const { app } = this;
    if (action === "stop") app.stop("keyboard");
    else if (action === "turning") {
      this.turning = !this.turning;
      app.say(this.turning ? "The hand keys turn the hand" : "The hand keys move the hand", false);
    } else if (action.startsWith("speed")) app.setSpeed(Number(action.slice(5)));
    else if (action === "slower" || action === "faster") app.setSpeed(app.driver.speed + (action === "faster" ? 1 : -1));
    else if (app.settings.mode === "step") app.driver.step(action.split("+")[0], "keyboard", at);
    else if (app.settings.mode === "latch") app.driver.toggle(action, "keyboard", at);
    else app.driver.press(`key:${code}`, action, "keyboard", at);
  }

  /** While a point is chosen the arrows move the cross and Enter chooses it. */
  crossKey(event) {
    const { app } = this;
    const by = { ArrowUp: [0, -1], ArrowDown: [0, 1], ArrowLeft: [-1, 0], ArrowRight: [1, 0] }[event.code];
    if (!by && event.code !== "Enter") return false;
    if (takesKeys(document.activeElement)) return false;
    event.preventDefault();
    if (!app.stage.cross) this.openCross();
    const { cross } = app.stage;
    if (by) this.moveCross(by[0] * 0.02, by[1] * 0.02);
    else app.stage.pick(cross.camera, cross.u, cross.v);
    return true;
  }

  moveCross(du, dv) {
    const { app } = this;
    const { cross } = app.stage;
    if (!cross || cross.u === undefined) return;
    cross.u = Math.min(1, Math.max(0, cross.u + du));
    cross.v = Math.min(1, Math.max(0, cross.v + dv));
  }

  /** A switch of the scanning was pressed or released. */
  switched(which, down, at) {
    const { app } = this;
    if (!down) {
      this.scanner.release(which, at);
      return;
    }
    if (app.driver.intercept("switch", at)) {
      this.scanner.spend(which, at);
      app.flush();
      return;
    }
    this.scanner.press(which, at);
  }

  listen() {
    const { app } = this;
    window.addEventListener("keydown", (event) => this.key(event, true), true);
    window.addEventListener("keyup", (event) => this.key(event, false), true);
    this.listenPointer();
    const lose = (why, words) => () => {
      app.driver.guard(why, words);
      this.scanner.forget();
      this.gamepads.disarm();
      app.flush();
    };
    window.addEventListener("blur", lose("blur", "The window lost the focus: everything stops"));
    document.addEventListener("visibilitychange", () => {
      if (document.hidden) lose("hidden", "The page was hidden: everything stops")();
    });
    document.addEventListener("freeze", lose("hidden", ""));
    window.addEventListener("pagehide", lose("hidden", ""));
    window.addEventListener("gamepaddisconnected", lose("lost_device", "The gamepad is gone: everything stops"));
    window.addEventListener("resize", () => {
      app.pads.choose(app.pads.tab);
      app.want(false);
    });
  }

  listenPointer() {
    const { app } = this;
    let swallow = false;
    const inScan = () => app.settings.scan.on && !app.carer;
    window.addEventListener("pointerdown", (event) => {
      const device = inScan() ? "switch" : event.pointerType === "mouse" ? "mouse" : "touch";
      swallow = false;
      if (event.target.closest("#stop")) {
        event.preventDefault();
        swallow = true;
        app.stop(device);
      } else if (app.driver.intercept(device, now())) {
        // Any press while the robot moves on its own is only STOP.
        event.preventDefault();
        event.stopImmediatePropagation();
        swallow = true;
        if (inScan()) this.scanner.spend(1, now());
        app.flush();
      } else if (event.target.closest("#carer")) {
        // Never the switch: a carer regains the pointer here, on any device.
      } else if (inScan() && !event.target.closest("input, textarea, select, summary")) {
        event.preventDefault();
        event.stopImmediatePropagation();
        swallow = true;
        this.scanner.press(1, now());
      }
    }, true);
    const up = () => this.scanner.release(1, now());
    window.addEventListener("pointerup", up, true);
    window.addEventListener("pointercancel", up, true);
    window.addEventListener("click", (event) => {
      if (swallow && event.isTrusted) {
        swallow = false;
        event.preventDefault();
        event.stopImmediatePropagation();
        return;
      }
      // A click without a pointer: the keyboard or a screen reader.
      if (event.isTrusted && event.target.closest("#stop")) app.stop("keyboard");
    }, true);
    window.addEventListener("pointermove", (event) => this.pointed(event), { passive: true });
    document.documentElement.addEventListener("pointerleave", () => {
      this.dwell.away();
    });
  }

  /** Target under the pointer, for dwelling. */
  pointed(event) {
    const { app } = this;
    if (!app.settings.dwell.on) return;
    const over = document.elementFromPoint(event.clientX, event.clientY);
    const one = over?.closest("button[data-item]");
    let target = one && !one.disabled ? one.dataset.item : null;
    // An image is a target only while a point in it is chosen, never while driving.
    const canvas = !one && app.stage.picking ? over?.closest("figure")?.querySelector("canvas") : null;
    let box = null;
    if (canvas) {
      const found = [...app.stage.figures].find(([, figure]) => figure.canvas === canvas);
      box = canvas.getBoundingClientRect();
      canvas.dataset.item = `image:${found[0]}`;
      target = canvas.dataset.item;
    }
    this.pointer = { x: event.clientX, y: event.clientY };
    if (box) Object.assign(this.pointer, { u: (event.clientX - box.left) / box.width, v: (event.clientY - box.top) / box.height });
    this.dwell.pointer(event.clientX, event.clientY, target, now());
  }

  gamepadList() {
    return [...(navigator.getGamepads?.() || [])].filter((pad) => pad && pad.connected);
  }

  readGamepads(at) {
    const { app } = this;
    if (document.hidden || !document.hasFocus()) return;
    const list = this.gamepadList();
    if (list.length === 0 && this.gamepads.pads.size === 0) return;
    const learning = app.settingsView.learning;
    if (learning) {
      for (const pad of list) {
        const index = pad.buttons.findIndex((one) => one.pressed);
        if (pad.id === learning.id && index >= 0) app.settingsView.learned(pad.id, index);
      }
      this.gamepads.disarm();
    }
    const read = this.gamepads.read(list);
    for (const id of read.arrived) app.say(`Gamepad: ${id}. It drives after its stick was released`, false);
    if (read.gone.length > 0) {
      app.driver.release("gamepad");
      app.driver.guard("lost_device", "The gamepad is gone: everything stops");
      this.stopFor("lost_device", at);
    }
    if (read.arrived.length > 0 || read.gone.length > 0) app.applySettings();
    if (learning) return;
    if (app.settings.scan.on) this.gamepadSwitch(list, at);
    else this.gamepadDrive(read, at);
  }

  /** Sends a stop also when the release has already ended the motion. */
  stopFor(why, at) {
    const { app } = this;
    if (app.driver.moving) app.driver.stop(why, "gamepad");
    app.flush();
  }

  /** Any button of any pad is the switch. */
  gamepadSwitch(list, at) {
    const down = list.some((pad) => pad.buttons.some((one) => one.pressed));
    if (down !== Boolean(this.padDown)) this.switched(1, down, at);
    this.padDown = down;
  }

  gamepadDrive(read, at) {
    const { app } = this;
    for (const press of read.presses) {
      if (press === "stop") app.stop("gamepad");
      else if (app.driver.intercept("gamepad", at)) app.flush();
      else if (press === "next") this.nextPad(read);
      else if (press === "take") app.choosing(!app.stage.picking);
      else if (press === "slower" || press === "faster") app.setSpeed(app.driver.speed + (press === "faster" ? 1 : -1));
    }
    if (app.stage.cross?.u !== undefined) {
      this.moveCross(read.stick[0] * 0.012, read.stick[1] * 0.012);
      return;
    }
    if (read.menu) this.menuStick(read.menu, at);
    if (app.where !== "drive") return;
    if (app.settings.mode === "step") {
      const step = steepest(read.axes);
      if (step && step !== this.padStep) app.driver.step(step, "gamepad", at);
      this.padStep = step;
    } else app.driver.set("gamepad", read.axes, "gamepad", at);
  }

  nextPad() {
    const { app } = this;
    const { cross } = app.stage;
    if (cross?.u !== undefined) {
      // Chooses the item instead of going on.
      this.gamepads.mode = (this.gamepads.mode + STICK_MODES.length - 1) % STICK_MODES.length;
      app.stage.pick(cross.camera, cross.u, cross.v);
      return;
    }
    const mode = STICK_MODES[this.gamepads.mode];
    app.say(`Stick: ${mode.label}`, false);
    if (PADS_OF[mode.name]) app.pads.choose(PADS_OF[mode.name]);
  }

  menuStick(what, at) {
    const { app } = this;
    if (app.driver.intercept("gamepad", at)) {
      app.flush();
      return;
    }
    this.cursor.items(rowsOf(this.scanRoot()));
    if (what === "take") app.activate(this.cursor.framed().id, "gamepad");
    else this.cursor.move(what === "next" ? 1 : -1);
  }

  /** Items to scan: the letters while they are open, otherwise everything. */
  scanRoot() {
    return lettersOpen() ? $("letters") : document.body;
  }

  scan(at) {
    const { app } = this;
    const { cross } = app.stage;
    if (cross instanceof Cross) {
      if (cross.over(at)) {
        app.closeMenu();
        return;
      }
      for (const press of this.scanner.presses(at)) {
        // The line's position at the press counts, not at the end of the press filter.
        const place = cross.press(press.at, at);
        if (place) app.stage.pick(place.camera, place.u, place.v);
      }
      this.showSwept(cross.at(at));
      return;
    }
    this.scanner.items(rowsOf(this.scanRoot()), at);
    const before = this.scanner.framed()?.id;
    const taken = this.scanner.tick(at);
    if (taken) app.activate(taken, "switch");
    const framed = this.scanner.framed()?.id;
    if (framed !== before && framed && app.settings.sound) tick(framed === "stop");
  }

  frameShown() {
    const { app } = this;
    // Within a row the frame also covers a way back.
    $("back").hidden = !app.settings.scan.on || this.scanner.resting || this.scanner.row === null;
    const inMenu = this.gamepads.pads.size > 0 && STICK_MODES[this.gamepads.mode].name === "menu" && !app.settings.scan.on;
    const id = app.settings.scan.on ? this.scanner.framed()?.id : inMenu ? this.cursor.framed().id : null;
    const element = id ? elementOf(id) : null;
    if (element === this.framed) return;
    this.framed?.classList.remove("framed");
    this.framed = element;
    if (!element) return;
    element.classList.add("framed");
    element.scrollIntoView({ block: "nearest" });
  }

  ring(at) {
    const { app } = this;
    const done = app.settings.dwell.on ? this.dwell.progress(at) : 0;
    const ring = $("ring");
    ring.hidden = done === 0;
    if (done === 0) return;
    ring.style.left = `${this.pointer.x}px`;
    ring.style.top = `${this.pointer.y}px`;
    ring.style.setProperty("--done", done.toFixed(2));
  }
}
