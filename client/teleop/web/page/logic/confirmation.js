// Actions that must be confirmed by a second press: the first press asks, the second acts. Pure.

/** The second press counts within this time, ms. It may be long: it only asks again. */
const WITHIN_MS = 6000;

export class Confirmation {
  constructor() {
    this.pending = null;
  }

  /** A press of `what`. Returns whether it is the second. */
  press(what, now) {
    const again = this.pending !== null && this.pending.what === what && now - this.pending.at < WITHIN_MS;
    this.pending = again ? null : { what, at: now };
    return again;
  }

  /** The action that waits for its second press, or null. */
  asks(now) {
    if (this.pending && now - this.pending.at >= WITHIN_MS) this.pending = null;
    return this.pending ? this.pending.what : null;
  }
}
