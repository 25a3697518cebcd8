// From input of any device to messages for the gateway. Pure: time is an argument
// (milliseconds of one clock), `frame` returns messages.
//
// Invariant: after a stop, a guard or a lost device nothing moves before a fresh
// press: input that was held then is dead until it is released, and the epoch tells the
// gateway the same.

import { MOTIONS, axesOf, directions, isStill, still, sum } from "./motions.js";

/** A latch ends after this long unless it is renewed, ms. */
export const LATCH_MS = 2000;
/** Least time between two messages of a held motion, ms. */
const RESEND_MS = 30;
/** Time between two "alive" messages while nothing moves, ms. */
const ALIVE_MS = 250;
/** Repetitions of stops and releases. */
const REPEATS = 3;
/** Least time between two steps, ms. */
const STEP_MS = 150;
/** A step that the robot does not report as motion is over after this, ms. */
const STEP_OVER_MS = 400;
/** A step is over after this in any case, ms. */
const STEP_LONGEST_MS = 4000;
/** A press that asked for control acts when control is granted within this time, ms. */
const GRANT_MS = 3000;
/** Devices whose press also stops a step that is under way. */
const SLOW_DEVICES = ["switch", "dwell", "voice"];

export class Driver {
  constructor() {
    this.speed = 3;
    this.seq = 0;
    this.epoch = 0;
    /** Why driving is not allowed, in words, or "". */
    this.lock = "not connected";
    /** Kind of that reason; "free": no operator is in control, and a press requests it. */
    this.lockWhy = "";
    /** A press asks for control; the page sends the request. */
    this.controlWanted = false;
    this.askedAt = -Infinity;
    this.waitingStep = null;
    /** The newest step, to repeat it. */
    this.last = null;
    /** Only steps and goals are allowed. */
    this.stepsOnly = false;
    this.goal = false;
    /** Notes for the person: {text, bad}. */
    this.notes = [];
    this.sources = new Map();
    this.latch = null;
    this.pendingStep = null;
    this.stops = 0;
    this.releases = 0;
    this.moving = false;
    this.why = "person";
    this.device = "keyboard";
    this.mode = "hold";
    this.lastDrive = -Infinity;
    this.lastAlive = -Infinity;
    this.stepAt = -Infinity;
    this.robotMoved = false;
    this.robotMoving = false;
    this.lastSent = "";
  }

  // Device input

  /** A direction is pressed and held. Returns "drive", "stop" or "refused". */
  press(id, names, device, now) {
    if (this.intercept(device, now)) {
      this.sources.set(id, { axes: still(), device, mode: "hold", dead: true });
      return "stop";
    }
    if (this.sources.has(id)) return this.sources.get(id).dead ? "refused" : "drive";
    const refused = this.refusal(false);
    const waits = refused !== "" && this.asksControl(now);
    this.sources.set(id, { axes: axesOf(names), device, mode: "hold", dead: refused !== "", waits });
    if (refused && !waits) this.tell(refused, true);
    return refused ? "refused" : "drive";
  }

  /** State of a device with sticks; all zero is a release. */
  set(id, axes, device, now, more = {}) {
    const old = this.sources.get(id);
    if (isStill(axes) && !more.clutch) {
      if (old) this.release(id);
      return;
    }
    if (old) {
      if (!old.dead) Object.assign(old, { axes, clutch: more.clutch });
      return;
    }
    let dead = this.intercept(device, now);
    const refused = dead ? "" : this.refusal(false);
    const waits = refused !== "" && this.asksControl(now);
    if (refused) {
      if (!waits) this.tell(refused, true);
      dead = true;
    }
    this.sources.set(id, { axes, device, mode: more.mode || "hold", dead, waits, clutch: more.clutch });
  }

  /** A direction is released. */
  release(id) {
    this.sources.delete(id);
  }

  /** Click-click: the first press latches a direction, any press after it stops. */
  toggle(names, device, now) {
    if (this.intercept(device, now)) return "stop";
    const refused = this.refusal(false);
    if (refused) {
      if (!this.asksControl(now)) this.tell(refused, true);
      return "refused";
    }
    this.latch = { names, device, until: now + LATCH_MS };
    return "drive";
  }

  /** The person is active: renews the latch. */
  renew(now) {
    if (this.latch) this.latch.until = now + LATCH_MS;
  }

  /** The pointer left the button. */
  unlatch() {
    this.latch = null;
  }

  /** One step. Returns "step", "stop" or "refused". */
  step(name, device, now) {
    if (this.intercept(device, now)) return "stop";
    const refused = this.refusal(true) || (this.anything() ? "let go first" : "");
    if (refused) {
      if (this.asksControl(now)) this.waitingStep = { name, device };
      else this.tell(refused, true);
      return "refused";
    }
    if (now - this.stepAt < STEP_MS) return "refused";
    const { part, axis, sign } = MOTIONS[name];
    this.pendingStep = { part, axis, sign, device, name };
    this.last = name;
    this.stepAt = now;
    this.robotMoved = false;
    return "step";
  }

  /** Stops everything. Never refused. */
  stop(why, device) {
    this.kill();
    this.stops = REPEATS;
    this.releases = 0;
    this.why = why;
    if (device) this.device = device;
  }

  /**
   * Whether a press must stop the robot instead of doing its own action: it
   * moves on a latch or towards a goal, or by a step of a slow device.
   */
  intercept(device, now) {
    const onItsOwn = this.latch !== null || this.goal ||
      (SLOW_DEVICES.includes(device) && this.stepping(now));
    if (!onItsOwn) return false;
    this.stop("person", device);
    this.tell("Stopped", false);
    return true;
  }

  /** A problem (a device was lost, a refusal, a contact): everything is released. */
  guard(why, text) {
    this.forgetWaiting();
    const was = this.anything() || this.goal || this.pendingStep !== null;
    if (!was) return;
    this.stop(why, null);
    if (text) this.tell(text, true);
  }

  // Messages of the gateway

  /** The newest situation: dead epoch, goal, whether the robot moves. */
  receive(control, goal, robotMoving, now) {
    this.goal = Boolean(goal);
    this.robotMoving = robotMoving;
    if (robotMoving) this.robotMoved = true;
    if (control && control.dead >= this.epoch && this.epoch > 0 && this.anything() && this.moving &&
        control.seq >= this.movingSince) {
      this.kill();
      this.releases = REPEATS;
      this.tell(control.why || "Stopped by the gateway; press again", true);
    }
    if (now - this.stepAt > STEP_LONGEST_MS) this.stepAt = -Infinity;
  }

  /**
   * Whether driving is allowed at `now`; a reason locks it, and stops all motion. When
   * control was granted, the press that asked for it acts: the person still holds it.
   */
  locked(reason, why, stepsOnly, now = 0) {
    if (reason && !this.lock) this.guard(why, reason);
    if (stepsOnly && !this.stepsOnly && this.anything()) {
      this.guard("frozen", "The image is too old: only steps and goals");
    }
    this.lock = reason;
    this.lockWhy = reason ? why : "";
    this.stepsOnly = stepsOnly;
    if (now - this.askedAt > GRANT_MS) this.forgetWaiting();
    else if (!reason) this.act(now);
  }

  // Messages to send

  /** The messages that are due now. `shown` is the shown tick or null. */
  frame(now, shown) {
    const messages = [];
    if (this.latch && now >= this.latch.until) {
      this.latch = null;
      this.tell("The latch ran out; press again", false);
    }
    if (this.stops > 0) {
      this.stops -= 1;
      messages.push(this.message("stop", now, shown, { why: this.why }));
    }
    if (this.pendingStep) {
      const { part, axis, sign, device } = this.pendingStep;
      this.pendingStep = null;
      this.epoch += 1;
      this.device = device;
      this.mode = "step";
      messages.push(this.message("step", now, shown, { part, axis, sign }));
    }
    const { axes, clutch, source } = this.axes();
    const moves = source !== null;
    if (moves) {
      if (!this.moving) {
        this.epoch += 1;
        this.movingSince = this.seq + 1;
        this.lastDrive = -Infinity;
      }
      this.device = source.device;
      this.mode = source.mode;
      const state = JSON.stringify([axes, clutch]);
      if (now - this.lastDrive >= RESEND_MS || state !== this.lastSent) {
        this.lastDrive = now;
        this.lastSent = state;
        messages.push(this.message("drive", now, shown, clutch ? { ...axes, clutch } : axes));
      }
    } else {
      if (this.moving && this.stops === 0 && messages.length === 0) this.releases = REPEATS;
      if (this.releases > 0 && messages.length === 0) {
        this.releases -= 1;
        messages.push(this.message("drive", now, shown, still()));
      }
      if (messages.length === 0 && now - this.lastAlive >= ALIVE_MS) {
        messages.push(this.message("alive", now, shown, {}));
      }
    }
    if (messages.length > 0) this.lastAlive = now;
    this.moving = moves;
    return messages;
  }

  /** The directions that are commanded now. */
  active() {
    return directions(this.axes().axes);
  }

  /** Whether anything is held or latched. */
  anything() {
    return this.axes().source !== null;
  }

  /** Notes for the person since the last call. */
  takeNotes() {
    return this.notes.splice(0);
  }

  /** Whether a step is in progress. */
  stepping(now) {
    const since = now - this.stepAt;
    if (since > STEP_LONGEST_MS) return false;
    return this.robotMoved ? this.robotMoving : since < STEP_OVER_MS;
  }

  /** Whether a press that is refused requests control instead: no operator has it. */
  asksControl(now) {
    if (this.lockWhy !== "free") return false;
    this.controlWanted = true;
    this.askedAt = now;
    return true;
  }

  /** Control is granted: the press that asked for it acts. */
  act(now) {
    const step = this.waitingStep;
    for (const held of this.sources.values()) {
      if (held.waits && !this.stepsOnly) held.dead = false;
    }
    this.forgetWaiting();
    if (step) this.step(step.name, step.device, now);
  }

  forgetWaiting() {
    for (const held of this.sources.values()) held.waits = false;
    this.waitingStep = null;
  }

  axes() {
    const parts = [];
    let source = null;
    let clutch;
    for (const held of this.sources.values()) {
      if (held.dead || (isStill(held.axes) && !held.clutch)) continue;
      parts.push(held.axes);
      source = held;
      clutch = held.clutch || clutch;
    }
    if (this.latch) {
      parts.push(axesOf(this.latch.names));
      source = { device: this.latch.device, mode: "latch" };
    }
    return { axes: sum(parts), clutch, source };
  }

  kill() {
    this.forgetWaiting();
    for (const held of this.sources.values()) held.dead = true;
    this.latch = null;
    this.pendingStep = null;
    this.stepAt = -Infinity;
    this.goal = false;
  }

  refusal(isStep) {
    if (this.lock) return this.lock;
    if (this.stepsOnly && !isStep) return "The image is too old: only steps and goals";
    return "";
  }

  message(t, now, shown, more) {
    this.seq += 1;
    const { epoch, seq, device, mode, speed } = this;
    return { t, seq, epoch, shown, ms: now, device, mode, speed, ...more };
  }

  tell(text, bad) {
    const last = this.notes.at(-1);
    if (!last || last.text !== text) this.notes.push({ text, bad });
  }
}
