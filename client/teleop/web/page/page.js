// The page: reads input devices, sends intents, shows images and state.

import { Driver } from "./logic/driver.js";
import { STICK_MODES } from "./logic/gamepad.js";
import { MOTIONS } from "./logic/motions.js";
import { Images, FROZEN_MS } from "./logic/images.js";
import { movePad, sizePad } from "./logic/profile.js";
import { rights } from "./logic/rights.js";
import { Confirmation } from "./logic/confirmation.js";
import { Decoders, oneInOneOut } from "./parts/decode.js";
import { $, button, children, elementOf, takesKeys, text } from "./parts/dom.js";
import { closeLetters, openLetters } from "./parts/letters.js";
import { Inputs } from "./parts/input.js";
import { Pads } from "./parts/pads.js";
import { Panels, message } from "./parts/panels.js";
import { Settings, keep, stored } from "./parts/settings.js";
import { Sockets, http } from "./parts/sockets.js";
import { readAloud } from "./parts/sound.js";
import { Stage } from "./parts/stage.js";
import { Voice } from "./parts/voice.js";

const now = () => performance.now();

class Page {
  constructor() {
    this.settings = stored();
    this.driver = new Driver();
    this.driver.speed = this.settings.speed;
    this.images = new Images();
    this.confirmation = new Confirmation();
    this.situation = null;
    this.receivedAt = -Infinity;
    this.role = "viewer";
    this.codecs = ["jpeg"];
    this.clickDevice = null;
    this.candidates = null;
    this.inForce = false;
    /** Alarms that the person has acknowledged. */
    this.read = new Set();
    /** With scanning on: the pointer presses its target instead of acting as the switch. */
    this.carer = false;
    this.isArranging = false;
    this.where = "login";
    this.xr = null;
    this.now = now;
    this.sockets = new Sockets({
      received: (kind, data) => this.receive(kind, data),
      opened: (kind) => this.opened(kind),
      closed: (kind, reason) => this.closed(reason),
      login: () => this.view("login"),
    });
    this.decoders = new Decoders(this.images, (message_) => this.sockets.video(message_));
    this.stage = new Stage(this);
    this.panels = new Panels(this);
    this.pads = new Pads(this);
    this.settingsView = new Settings(this);
    this.inputs = new Inputs(this);
    this.voice = new Voice({
      received: (meaning_, words) => this.spoken(meaning_, words),
      stop: () => this.stop("voice"),
      failed: (error) => this.say(`Speech recognition: ${error}`, true),
      changed: () => this.drawVoice(),
    });
  }

  async begin() {
    // Height of the header: the rest of the window belongs to the drive view.
    new ResizeObserver(([{ target }]) => {
      document.documentElement.style.setProperty("--top", `${target.offsetHeight}px`);
    }).observe($("top"));
    this.buttons();
    this.inputs.listen();
    this.applySettings();
    this.loop();
    try {
      const { status, body } = await http("/session");
      if (status === 200) await this.signedIn(body);
      else this.view("login");
    } catch {
      this.view("login");
      text($("login_error"), "The gateway does not answer. Is it running?");
    }
  }

  // Login and views

  async signedIn(session) {
    this.role = session.role;
    this.user = session.user;
    text($("login_error"), "");
    this.view("drive");
    if (await oneInOneOut()) this.codecs = ["h264", "jpeg"];
    this.sockets.start(this.role);
  }

  view(where) {
    if (where === "login") this.sockets.end();
    if (this.where === "drive" && where !== "drive") this.driver.guard("guard", "");
    this.where = where;
    closeLetters();
    for (const id of ["login", "drive", "settings"]) $(id).hidden = id !== where;
    $("menu").hidden = where === "login";
    $("chips").hidden = where === "login" || !this.situation;
    if (where === "settings") {
      this.settingsView.draw();
      $("settings_title").focus();
    } else if (where === "login") $("user").focus();
    else $("stage").focus({ preventScroll: true });
    this.applySettings();
    document.body.dataset.where = where;
    this.drawer(false);
    if (where === "drive") this.setCarer(false);
    window.scrollTo(0, 0);
  }

  /** Opens or closes what is not needed at every moment; the images stay in view. */
  drawer(on) {
    $("drawer").hidden = !on;
    document.body.classList.toggle("more", on);
    const more = document.querySelector('[data-item="more"]');
    text(more, on ? "Less" : "More");
    more.setAttribute("aria-expanded", String(on));
    more.hidden = this.where !== "drive";
  }

  buttons() {
    $("menu").append(
      button("more", "More", () => this.drawer($("drawer").hidden), { "aria-controls": "drawer" }),
      button("settings", "Settings", () => this.view(this.where === "settings" ? "drive" : "settings")),
      button("xr", "Headset", () => this.enterXr(), { hidden: true }),
    );
    $("drawer_buttons").append(button("drawer:close", "Back to driving", () => this.drawer(false), { className: "first" }));
    $("login_buttons").append(
      button("login", "Sign in", () => {}, { type: "submit", className: "first" }),
      button("write:user", "Letters for the name", () => openLetters($("user")), { hidden: true }),
      button("write:password", "Letters for the password", () => openLetters($("password")), { hidden: true }),
    );
    $("login_form").addEventListener("submit", (event) => {
      event.preventDefault();
      this.login();
    });
    $("instruction_buttons").append(button("read", "Read aloud", () => {
      if (!readAloud($("instruction").textContent || "No instruction")) this.say("This browser cannot read aloud", true);
    }));
    $("carer").addEventListener("click", () => this.setCarer(!this.carer));
    navigator.xr?.isSessionSupported?.("immersive-vr").then((can) => {
      document.querySelector('[data-item="xr"]').hidden = !can;
    }).catch(() => {});
  }

  async logout() {
    this.stop("mouse");
    await http("/logout", {});
    this.view("login");
  }

  async login() {
    const [user, password] = [$("user"), $("password")];
    closeLetters();
    try {
      const { status, body } = await http("/login", { user: user.value, password: password.value });
      password.value = "";
      if (status === 200) await this.signedIn(body);
      else text($("login_error"), body.error || `the gateway answered ${status}`);
    } catch {
      text($("login_error"), "The gateway does not answer. Is it running?");
    }
  }

  // Settings

  change(settings) {
    this.settings = settings;
    keep(settings);
    this.applySettings();
  }

  applySettings() {
    const { settings } = this;
    document.documentElement.dataset.theme = settings.theme;
    this.driver.speed = settings.speed;
    this.inputs.apply(settings);
    $("carer").hidden = !settings.scan.on;
    if (!settings.scan.on) this.carer = false;
    this.pads.draw(this.isArranging);
    this.drawVoice();
    // A tap on the image itself.
    document.body.classList.toggle("tap", settings.preset === "touch");
    for (const item of ["write:user", "write:password"]) {
      const one = document.querySelector(`[data-item="${item}"]`);
      if (one) one.hidden = !this.letters();
    }
  }

  /** Whether the on-screen letters are needed. */
  letters() {
    return this.settings.scan.on || this.settings.dwell.on || this.inputs.gamepads.pads.size > 0;
  }

  arranging(on) {
    this.isArranging = on;
    if (on) this.view("drive");
    else this.applySettings();
  }

  arrange(name, what) {
    const { pads } = this.settings;
    const made = { earlier: () => movePad(pads, name, -1), later: () => movePad(pads, name, 1),
      larger: () => sizePad(pads, name, 8), smaller: () => sizePad(pads, name, -8),
      hide: () => pads.map((pad) => (pad.name === name ? { ...pad, hidden: !pad.hidden } : pad)) }[what]();
    this.change({ ...this.settings, pads: made });
    elementOf(`arrange:${name}:${what}`)?.focus();
  }

  hiddenPad(name) {
    return this.settings.pads.some((pad) => pad.name === name && pad.hidden);
  }

  setSpeed(speed) {
    this.change({ ...this.settings, speed: Math.min(5, Math.max(1, speed)) });
    this.say(`Speed ${this.driver.speed}`, false);
  }

  setMode(mode) {
    this.driver.guard("guard", "");
    this.change({ ...this.settings, mode });
  }

  // Messages of the gateway

  receive(kind, data) {
    if (kind === "video") {
      this.decoders.take(data);
      return;
    }
    const at = now();
    if (data.t === "situation") {
      this.situation = data;
      this.receivedAt = at;
      this.driver.receive(data.control, data.goal, Boolean(data.robot?.moving), at);
      this.inForce = Boolean(data.control?.stopped);
      this.stage.cameras(data.cameras || []);
      this.panels.show(data, at);
    } else if (data.t === "refusal") {
      this.driver.guard("guard", "");
      this.say(data.reason, true);
    } else if (data.t === "stopped") this.inForce = true;
    else if (data.t === "note") this.say(data.text, data.bad);
  }

  opened(kind) {
    if (kind === "video") {
      this.decoders.forget();
      this.images.forget();
      this.want(true);
    }
    if (kind === "state") {
      this.sockets.ask("tasks").then(({ tasks }) => {
        this.panels.tasks = tasks || [];
        this.refresh();
      }).catch(() => {});
    }
  }

  closed(reason) {
    if (reason) this.say(reason, true);
    if (this.sockets.lanes() === 0) this.driver.guard("guard", "The connection is lost: everything stops");
  }

  want(force) {
    const want = JSON.stringify(this.stage.want(this.codecs));
    if (!force && want === this.wanted) return;
    this.wanted = want;
    this.sockets.video(JSON.parse(want));
  }

  refresh() {
    if (this.situation) this.panels.show(this.situation, now());
  }

  say(words, bad) {
    message(words, bad);
    text($("announcement"), words);
    text($("hint"), words);
    $("hint").className = bad ? "bad" : "";
    this.saidAt = now();
  }

  // Requests

  async ask(what, fields) {
    try {
      const answer = await this.sockets.ask(what, fields);
      if (answer.text) this.say(answer.text, false);
      return answer;
    } catch (error) {
      this.say(error.message, true);
      return null;
    }
  }

  /** Requests control where no other operator has it. Returns whether this page is in control. */
  async takeControl() {
    if (this.situation?.lease?.mine) return true;
    return Boolean((await this.ask("lease.ask"))?.mine);
  }

  /** Whether driving is off for another reason than that no operator is in control. */
  locked() {
    return this.driver.lock !== "" && this.driver.lockWhy !== "free";
  }

  async episode(what) {
    this.driver.guard("guard", "");
    if (what === "start" || what === "practise") {
      if (!(await this.takeControl())) return;
      this.drawer(false);
    } else {
      await this.ask(`episode.${what}`);
      return;
    }
    const answer = await this.ask("episode.start", { label: $("label").value.trim(), instruction: $("sentence").value.trim(),
      recorders: what === "practise" ? 0 : 1 });
    if (!answer) return;
    this.say(answer.practice ? "Practice: nothing is kept" : `You drive. Recording ${answer.label}`, false);
    $("label").value = "";
    $("sentence").value = "";
  }

  confirm(what, act) {
    if (this.confirmation.press(what, now())) act();
    else this.say("Press again to do it", false);
    this.refresh();
  }

  choosing(on) {
    this.closeMenu();
    this.stage.picking = on;
    if (on && (this.settings.scan.on || this.inputs.inMenu())) this.inputs.openCross();
    this.refresh();
  }

  async picked(camera, at, u, v) {
    if (this.locked()) {
      this.say(this.driver.lock, true);
      return;
    }
    this.stage.cross = null;
    if (!(await this.takeControl())) return;
    const answer = await this.ask("pick", { camera, tick: at, u, v });
    this.stage.picking = false;
    if (answer) {
      const { candidates = [], note } = answer;
      this.candidates = { list: candidates, chosen: 0, note, camera };
      this.outline();
      this.say(this.panels.words(this.candidates), false);
    }
    this.refresh();
  }

  outline() {
    const one = this.candidates?.list[this.candidates.chosen];
    this.stage.outline = one?.outline ? { camera: this.candidates.camera, points: one.outline } : null;
  }

  otherCandidate() {
    this.candidates.chosen = (this.candidates.chosen + 1) % this.candidates.list.length;
    this.outline();
    this.refresh();
  }

  closeMenu() {
    this.candidates = null;
    this.stage.outline = null;
    this.stage.cross = null;
    this.stage.picking = false;
    this.refresh();
  }

  async startGoal(candidate, action) {
    this.closeMenu();
    if (this.locked()) {
      this.say(this.driver.lock, true);
      return;
    }
    if (!(await this.takeControl())) return;
    // From here on any press stops, also before the first situation that contains the goal.
    if (await this.ask("goal.start", { candidate, action })) this.driver.goal = true;
  }

  cancelGoal() {
    this.ask("goal.cancel");
  }

  // Devices

  stop(device) {
    this.driver.stop("person", device);
    this.inputs.gamepads.disarm();
    this.stage.cross = null;
    this.flush();
    this.say("STOP", false);
  }

  flush() {
    const at = now();
    this.sockets.control(this.driver.frame(at, this.images.shown(this.stage.shown(), at)));
  }

  /** Presses an item, for a device that cannot hold. */
  activate(item, device) {
    if (item === "stop") {
      this.stop(device);
      return;
    }
    if (this.driver.intercept(device, now())) {
      this.flush();
      return;
    }
    // Voice and headset also reach what is in the closed drawer.
    const element = elementOf(item) || document.querySelector(`#drawer [data-item="${CSS.escape(item)}"]`);
    if (!element || element.disabled) return;
    this.clickDevice = device;
    if (element.tagName === "CANVAS") this.stage.pick(Number(item.split(":")[1]), this.inputs.pointer.u, this.inputs.pointer.v);
    else element.click();
    this.clickDevice = null;
  }

  spoken(phrase, words) {
    if (!phrase) {
      this.say(`Not understood: ${words.slice(0, 60)}`, false);
      return;
    }
    if (phrase.stop) return;
    const at = now();
    if (this.driver.intercept("voice", at)) {
      this.flush();
      return;
    }
    if (phrase.again) phrase = { step: this.driver.last };
    if (phrase.step) {
      this.driver.step(phrase.step, "voice", at);
      this.flush();
    } else if (phrase.speed) this.setSpeed(this.driver.speed + phrase.speed);
    else if (phrase.press) this.activate(phrase.press, "voice");
    else if (phrase.menu) this.activate(phrase.menu === "cancel" ? (this.situation?.goal ? "goal:cancel" : "goal:none") : `goal:${phrase.menu}`, "voice");
    this.say(`Heard: ${words}`, false);
  }

  drawVoice() {
    const on = this.settings.voice.on && Voice.possible;
    $("voice").hidden = !on && !this.isArranging;
    children($("voice"), JSON.stringify([on, this.voice.listening, this.isArranging]), () => [
      ...(on ? [button("voice", this.voice.listening ? "Listening: say a phrase" : "Press to talk", () => this.voice.toggle(this.settings.voice.local),
        { "aria-pressed": String(this.voice.listening) })] : []),
      ...(this.isArranging ? [button("arrange:done", "Pads are as I want them", () => this.arranging(false), { className: "first" })] : []),
    ]);
  }

  // Only animation frames send held input, so that a frozen page stops the robot.
  loop() {
    const frame = () => {
      requestAnimationFrame(frame);
      // In VR the headset's frames run the page.
      if (!this.xr) this.frame(now());
    };
    requestAnimationFrame(frame);
    // Captions, rights, and texts need no higher rate.
    setInterval(() => this.slow(now()), 200);
  }

  frame(at) {
    this.inputs.frame(at);
    for (const ack of this.images.paint(at, (header, image) => this.paint(header, image))) this.sockets.video(ack);
    const shown = this.stage.shown();
    const frozenMs = shown.length === 0 ? Infinity : this.images.frozenFor(shown, at);
    const right = rights({ s: this.situation, silenceMs: at - this.receivedAt, role: this.role, lanes: this.sockets.lanes(),
      frozenMs, hidden: document.hidden, away: this.where !== "drive", alarm: this.panels.blocks });
    this.driver.locked(right.reason, right.why, right.stepsOnly, at);
    if (this.driver.controlWanted) {
      this.driver.controlWanted = false;
      this.takeControl();
    }
    this.sockets.control(this.driver.frame(at, this.images.shown(shown, at)));
    this.shownFrozen = frozenMs > FROZEN_MS;
    this.draw(at);
  }

  paint(header, image) {
    this.stage.paint(header, image);
    this.xr?.paint(header, image);
  }

  draw(at) {
    for (const note of this.driver.takeNotes()) this.say(note.text, note.bad);
    const active = this.driver.active().join();
    if (active !== this.drawn || this.situation !== this.drawnFor) {
      this.drawn = active;
      this.drawnFor = this.situation;
      this.pads.show(this.driver.active(), this.driver.latch?.names, this.situation?.blocked || {});
      this.stage.show(at, this.shownFrozen);
      document.body.classList.toggle("locked", this.locked());
      $("stop").classList.toggle("inforce", this.inForce);
    } else if (this.stage.cross || this.stage.outline) this.stage.drawOver(at);
    this.drawAgain();
    this.inputs.frameShown();
    this.inputs.ring(at);
  }

  /** The newest step, to be repeated with one press; where presses are steps. */
  drawAgain() {
    const last = this.settings.mode === "step" && this.role !== "viewer" ? this.driver.last : null;
    children($("again"), last || "", () => (last ? [button("again", `Again: ${MOTIONS[last].words}`, () => {
      this.driver.step(last, this.clickDevice || "mouse", now());
      this.flush();
    })] : []));
  }

  slow(at) {
    const { lock } = this.driver;
    if (this.where === "drive") {
      text($("alarm"), this.situation && at - this.receivedAt > 1500 ? "The gateway does not answer: everything stops by itself."
        : this.shownFrozen && this.situation && !this.situation.paused && this.images.painted.size > 0 ? "The image is not live: only STOP works." : "");
    } else text($("alarm"), "");
    if (at - (this.saidAt ?? -Infinity) > 6000) {
      text($("hint"), this.resting());
      $("hint").className = "";
    }
    if (this.situation && this.confirmation.pending) {
      this.confirmation.asks(at);
      this.refresh();
    }
    this.stage.show(at, Boolean(this.shownFrozen));
    text($("keys_state"), this.keysState());
    $("keys_state").classList.toggle("important", lock !== "" || Boolean(this.situation?.goal) || this.settings.scan.on || this.inputs.gamepads.pads.size > 0);
  }

  /** Instruction while scanning rests, or "". */
  resting() {
    if (!this.settings.scan.on) return "";
    if (this.carer) return "Carer: the pointer presses buttons. Press Carer again, or your switch, to begin.";
    return this.inputs.scanner.resting ? "Press your switch to begin." : "";
  }

  /** Whether the pointer belongs to a carer instead of acting as the switch. */
  setCarer(on) {
    if (on === this.carer || (on && !this.settings.scan.on)) return;
    this.carer = on;
    $("carer").setAttribute("aria-pressed", String(this.carer));
    this.saidAt = -Infinity;
    this.slow(now());
  }

  keysState() {
    const { settings, driver } = this;
    if (this.situation?.goal) return "The robot moves on its own: any press stops it.";
    if (driver.lock) return this.locked() ? `Driving is off: ${driver.lock}.` : `${driver.lock}.`;
    // The hint beside STOP names the key to press.
    if (settings.scan.on) return this.resting() ? "" : "Scanning.";
    if (this.inputs.gamepads.pads.size > 0) return `Stick: ${STICK_MODES[this.inputs.gamepads.mode].label}`;
    if (!settings.keysOn) return "";
    if (takesKeys(document.activeElement)) return "Keys are for the button or field that has the focus. Press Esc or click an image to drive by keys.";
    return `Keys drive: W A S D or arrows the chair; V N H F G B the hand (${this.inputs.turning ? "turning" : "moving"}, Space changes); R Y the gripper.`;
  }

  // The headset

  async enterXr() {
    try {
      const { Headset } = await import("./xr/headset.js");
      this.xr = await Headset.enter(this, () => {
        this.xr = null;
        this.driver.guard("lost_device", "The headset's session ended: everything stops");
        this.flush();
      });
    } catch (error) {
      this.xr = null;
      this.say(`The headset cannot be used: ${error.message}`, true);
    }
  }
}

const page = new Page();
page.begin();
