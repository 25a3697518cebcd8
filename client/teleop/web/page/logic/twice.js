// What must be pressed twice, or held: the first press asks, the second does it. Pure.

/** The second press counts within this time, ms. There is no hurry: it only asks again. */
const WITHIN_MS = 6000;

export class Twice {
  constructor() {
    this.asked = null;
  }

  /** A press of `what`. Whether it is the second. */
  press(what, now) {
    const again = this.asked !== null && this.asked.what === what && now - this.asked.at < WITHIN_MS;
    this.asked = again ? null : { what, at: now };
    return again;
  }

  /** What is asked about now, or null. */
  asks(now) {
    if (this.asked && now - this.asked.at >= WITHIN_MS) this.asked = null;
    return this.asked ? this.asked.what : null;
  }
}
