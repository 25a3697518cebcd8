// The panel under the images: instruction, episode, recorder, lock reason,
// and buttons to point at, so that the headset can stay on between episodes.

import { loopAge } from "../logic/rights.js";
import { recording } from "../logic/words.js";

const SIZE = [1200, 400];
const BUTTONS = { y: 290, height: 90, gap: 16 };
/** Least time between two renderings, ms. */
const REDRAW_MS = 100;

export class Hud {
  constructor(app) {
    this.app = app;
    this.made = Object.assign(document.createElement("canvas"), { width: SIZE[0], height: SIZE[1] });
    this.drawnAt = -Infinity;
    this.boxes = [];
  }

  /** Buttons that can be pressed now: [item, label]. */
  buttons() {
    const { situation: s, confirmation } = this.app;
    const asks = confirmation.asks(this.app.now());
    const again = (what, words) => [what, asks === what ? "again?" : words];
    // While control is free, starting takes it.
    if (!s?.lease?.mine && (s?.lease?.holder || s?.episode)) return [["ask", "Ask for control"], ["leave", "Leave"]];
    const alarms = this.app.panels.alarmed.length > 0 ? [["alarm:0", "I have read this"]] : [];
    return s.episode ? [...alarms, ["finish", "Finish"], again("discard", "Discard"), again("redo", "Redo"), ["read", "Read"], ["leave", "Leave"]]
      : [...alarms, ["start", "Start driving"], ["practise", "Practise"], ["read", "Read"], ["leave", "Leave"]];
  }

  /** The item at a point, or null. */
  at(u, v) {
    const [x, y] = [u * SIZE[0], v * SIZE[1]];
    return this.boxes.find((box) => x >= box.x && x <= box.x + box.width && y >= BUTTONS.y && y <= BUTTONS.y + BUTTONS.height)?.item || null;
  }

  /** The canvas when it was rendered again, else null. `ray` is the pointed position. */
  canvas(now, ray) {
    if (now - this.drawnAt < REDRAW_MS) return null;
    this.drawnAt = now;
    const context = this.made.getContext("2d");
    const { situation: s, driver, inForce } = this.app;
    context.fillStyle = "#12161a";
    context.fillRect(0, 0, ...SIZE);
    const [alarm] = this.app.panels.alarmed;
    context.fillStyle = alarm ? "#ff9c96" : "#eef2f5";
    context.font = "bold 52px system-ui, sans-serif";
    this.wrapped(context, alarm || s?.episode?.instruction || s?.scenario?.instruction || "", 30, 62, SIZE[0] - 60, 58);
    context.font = "36px system-ui, sans-serif";
    context.fillText([s ? recording(s).text : "", `image ${loopAge(s?.control).text}`].filter(Boolean).join("    "), 30, 190);
    context.fillStyle = this.app.locked() || inForce ? "#ff9c96" : "#7fdca0";
    context.fillText(driver.lock || (inForce ? "STOPPED: squeeze again" : "Squeeze: hand.  Stick: chair.  Trigger closes, B opens.  A: STOP"), 30, 248);
    this.drawButtons(context, ray);
    return this.made;
  }

  drawButtons(context, ray) {
    this.boxes = [];
    let x = 30;
    const pointed = ray && this.app && { x: ray.u * SIZE[0], y: ray.v * SIZE[1] };
    for (const [item, words] of this.buttons()) {
      const width = context.measureText(words).width + 60;
      const over = pointed && pointed.x >= x && pointed.x <= x + width && pointed.y >= BUTTONS.y && pointed.y <= BUTTONS.y + BUTTONS.height;
      context.fillStyle = over ? "#7cc4f5" : "#29323b";
      context.fillRect(x, BUTTONS.y, width, BUTTONS.height);
      context.fillStyle = over ? "#06202f" : "#eef2f5";
      context.fillText(words, x + 30, BUTTONS.y + 58);
      this.boxes.push({ item, x, width });
      x += width + BUTTONS.gap;
    }
    if (!pointed) return;
    context.fillStyle = "#ffe14d";
    context.beginPath();
    context.arc(pointed.x, pointed.y, 9, 0, 7);
    context.fill();
  }

  wrapped(context, words, x, y, width, line) {
    let row = "";
    let at = y;
    for (const word of words.split(" ")) {
      if (context.measureText(`${row}${word}`).width > width && row) {
        context.fillText(row, x, at);
        row = "";
        at += line;
        if (at > y + line) return;
      }
      row += `${word} `;
    }
    context.fillText(row, x, at);
  }
}
