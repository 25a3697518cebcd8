// Actions that must be confirmed by a second press: the first press asks, the second acts. Pure.

/** The second press counts within this time, ms. It may be long: it only asks again. */
const WITHIN_MS = 6000;

export class Twice {
  constructor() {
    this.asked = null;
  }

  /** A press of `what`. Returns whether it is the second. */
  press(what, now) {
    const again = this.asked !== null && this.asked.what === what && now - this.asked.at < WITHIN_MS;
    this.asked = again ? null : { what, at: now };
    return again;
  }

  /** The action that waits for its second press, or null. */
  asks(now) {
    if (this.asked && now - this.asked.at >= WITHIN_MS) this.asked = null;
    return this.asked ? this.asked.what : null;
  }
}
