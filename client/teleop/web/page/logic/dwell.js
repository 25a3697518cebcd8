// Clicks by resting the pointer on a target, for a head mouse or an eye tracker. Pure.

export const DWELL_DEFAULTS = {
  /** How long the pointer rests, ms, 300 to 3000. */
  time: 1000,
  /** How far the pointer may stray meanwhile, CSS pixels. */
  radius: 30,
  /** The same for STOP, ms. */
  stop: 300,
};

export class Dwell {
  constructor(settings = {}) {
    this.settings = { ...DWELL_DEFAULTS, ...settings };
    this.resting = false;
    this.target = null;
    this.from = null;
    this.since = 0;
    /** The target that was clicked; the pointer must leave it before it counts again. */
    this.spent = null;
  }

  /** The pointer is at x, y over `target` (an id) or over no target (null). */
  pointer(x, y, target, now) {
    if (target !== this.spent) this.spent = null;
    const strayed = this.from && Math.hypot(x - this.from.x, y - this.from.y) > this.settings.radius;
    if (target !== this.target || (strayed && target !== "stop")) {
      this.target = target;
      this.from = { x, y };
      this.since = now;
    }
  }

  /** The pointer left the page. */
  away() {
    this.target = null;
    this.from = null;
    this.spent = null;
  }

  /** Progress of the dwell, 0 to 1. */
  progress(now) {
    if (this.target === null || this.target === this.spent) return 0;
    // While paused only STOP and the button that ends the pause react.
    if (this.resting && this.target !== "stop" && this.target !== "rest") return 0;
    const time = this.target === "stop" ? this.settings.stop : this.settings.time;
    return Math.min(1, (now - this.since) / time);
  }

  /** Advances the clock to `now`. Returns the id that is clicked, or null. */
  tick(now) {
    if (this.progress(now) < 1) return null;
    this.spent = this.target;
    return this.target;
  }
}
