// Scanning with one switch or two: a frame moves from item to item, a press chooses
// the framed one. Pure: presses and time in, chosen items out.
//
// STOP is the first item of every cycle, also within a row.

export const SCAN_DEFAULTS = {
  /** "rows" (row, then item), "linear" (every item), "two" (one switch steps, one chooses). */
  kind: "rows",
  /** How long an item is framed, ms, 500 to 5000. */
  interval: 1200,
  /** Extra time for the first item of a cycle, ms. */
  first: 800,
  /** Cycles until scanning rests, or goes back from a row. */
  loops: 3,
  /** A press counts when it was held for this long, ms. */
  hold: 250,
  /** After a press that counted, presses are ignored for this long, ms. */
  debounce: 400,
};

const STOP = { id: "stop", label: "STOP" };

export class Scanner {
  constructor(settings = {}) {
    this.settings = { ...SCAN_DEFAULTS, ...settings };
    this.rows = [];
    this.row = null;
    this.index = 0;
    this.loops = 0;
    this.resting = true;
    this.since = 0;
    this.down = new Map();
    this.due = [];
    this.last = -Infinity;
  }

  /** Rows of items: [{id, label, items: [{id, label}]}]. */
  items(rows, now) {
    const same = JSON.stringify(rows) === JSON.stringify(this.rows);
    if (same) return;
    const framed = this.framed();
    this.rows = rows;
    if (this.row !== null && !rows.some((row) => row.id === this.row)) this.row = null;
    // The frame stays on its item, if that still exists.
    const at = framed ? this.cycle().findIndex((item) => item.id === framed.id) : -1;
    if (at >= 0) this.index = at;
    else {
      this.index = 0;
      this.since = now;
    }
  }

  /** Items of the current cycle; STOP is the first. */
  cycle() {
    if (this.settings.kind === "rows" && this.row === null) {
      // A row of one item is that item.
      return [STOP, ...this.rows.map((row) =>
        (row.items.length === 1 ? row.items[0] : { id: row.id, label: row.label, row: true }))];
    }
    if (this.settings.kind === "rows") {
      const row = this.rows.find((candidate) => candidate.id === this.row);
      return [STOP, ...row.items, { id: "back", label: "Back" }];
    }
    return [STOP, ...this.rows.flatMap((row) => row.items)];
  }

  /** The framed item, or null while it rests. */
  framed() {
    return this.resting ? null : this.cycle()[this.index] || STOP;
  }

  /** A switch is pressed: 1 (chooses, or with two switches steps), 2 (chooses). */
  press(which, now) {
    if (this.down.has(which)) return;
    this.down.set(which, { at: now, counted: false });
  }

  /** A switch is released; a press shorter than the filter does not count. */
  release(which, now) {
    const press = this.down.get(which);
    this.down.delete(which);
    // Long enough, but released before the next frame.
    if (press && !press.counted && now - press.at >= this.settings.hold) this.due.push({ which, at: press.at });
  }

  /** The presses that count now, each once: {which, at}, `at` is the time of the press. */
  presses(now) {
    const due = this.due.splice(0);
    for (const [which, press] of this.down) {
      if (press.counted || now - press.at < this.settings.hold) continue;
      press.counted = true;
      due.push({ which, at: press.at });
    }
    return due.filter(() => {
      if (now - this.last < this.settings.debounce) return false;
      this.last = now;
      return true;
    });
  }

  /** Forgets the held switches. */
  forget() {
    this.down.clear();
    this.due = [];
  }

  /** A press was used otherwise (STOP): the switch must be released first. */
  spend(which, now) {
    this.down.set(which, { at: now, counted: true });
    this.last = now;
    this.since = now;
  }

  /** Advances the clock to `now`. Returns the id that was chosen, or null. */
  tick(now) {
    for (const { which } of this.presses(now)) {
      const taken = this.pressed(which, now);
      if (taken !== null) return taken;
    }
    if (!this.resting && this.settings.kind !== "two") this.move(now);
    return null;
  }

  move(now) {
    // The frame does not move during a press.
    if ([...this.down.values()].some((press) => !press.counted)) return;
    const wait = this.settings.interval + (this.index === 0 ? this.settings.first : 0);
    if (now - this.since < wait) return;
    this.since = now;
    this.index += 1;
    if (this.index < this.cycle().length) return;
    this.index = 0;
    this.loops += 1;
    if (this.loops < this.settings.loops) return;
    this.loops = 0;
    if (this.row !== null) this.row = null;
    else this.resting = true;
  }

  pressed(which, now) {
    this.since = now;
    this.loops = 0;
    if (this.resting) {
      this.resting = false;
      this.index = 0;
      return null;
    }
    if (this.settings.kind === "two" && which === 1) {
      this.index = (this.index + 1) % this.cycle().length;
      return null;
    }
    const item = this.framed();
    if (item.row) {
      this.row = item.id;
      this.index = 0;
      return null;
    }
    if (item.id === "back") {
      this.row = null;
      this.index = 0;
      return null;
    }
    // The same item can be chosen again at once: it stays framed for its time.
    return item.id;
  }
}

/**
 * Chooses a point in an image by one switch: a line sweeps down one camera's image after the
 * other's, a press holds it, a second line sweeps across that image, a press chooses the
 * point. STOP stays outside of it.
 */
export class Cross {
  /** `cameras`: those whose images are shown, the first is swept first. */
  constructor(now, cameras, sweep = 8000) {
    this.sweep = sweep;
    this.began = now;
    this.cameras = cameras;
    this.held = null;
  }

  /** Positions of the lines: {camera, u, v}, u null while the first one sweeps. */
  at(now) {
    const turns = Math.max(0, now - this.began) / this.sweep;
    if (this.held) return { ...this.held, u: turns % 1 };
    return { camera: this.cameras[Math.floor(turns) % this.cameras.length], u: null, v: turns % 1 };
  }

  /** Ends after three sweeps of every image without a press. */
  over(now) {
    return now - this.began > 3 * this.sweep * (this.held ? 1 : this.cameras.length);
  }

  /** Handles a press that began at `at`; returns the point when it is the second. */
  press(at, now = at) {
    const place = this.at(at);
    if (this.held) return place;
    this.held = { camera: place.camera, v: place.v };
    this.began = now;
    return null;
  }
}

/** A frame that a stick moves from item to item; STOP is the first one here too. */
export class Cursor {
  constructor() {
    this.list = [STOP];
    this.index = 0;
  }

  /** Items of all rows; the frame stays on its item. */
  items(rows) {
    const framed = this.framed().id;
    this.list = [STOP, ...rows.flatMap((row) => row.items)];
    this.index = Math.max(0, this.list.findIndex((item) => item.id === framed));
  }

  framed() {
    return this.list[this.index] || STOP;
  }

  /** Moves on (1) or back (-1), cyclically. */
  move(by) {
    this.index = (this.index + by + this.list.length) % this.list.length;
  }
}
