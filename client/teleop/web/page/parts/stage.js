// The images on the page: painting, enlarging, and choosing a point in them.

import { $, button, h, text } from "./dom.js";

/** Up to this width a page shows one camera large, the other small, CSS pixels. */
const NARROW = 560;
const NAMES = { gen3: "Hand camera", wheelchair: "Chair camera", wheelchair_pole: "Pole camera", room: "Room camera" };

export class Stage {
  constructor(app) {
    this.app = app;
    this.figures = new Map();
    this.large = null;
    this.off = new Set();
    this.picking = false;
    this.cross = null;
    this.outline = null;
    this.key = "";
  }

  /** The cameras of the newest situation. */
  cameras(list) {
    const key = JSON.stringify(list.map((camera) => [camera.index, camera.name]));
    if (key === this.key) return;
    this.key = key;
    for (const { figure, line } of this.figures.values()) {
      figure.remove();
      line.remove();
    }
    this.figures.clear();
    for (const camera of list) this.figures.set(camera.index, this.figure(camera));
    $("nothing").hidden = list.length > 0;
    if (window.innerWidth <= NARROW && list.length > 1) this.large ??= list[0].index;
    this.arrange();
  }

  figure({ index, name }) {
    const title = NAMES[name] || name;
    const canvas = h("canvas", { width: 640, height: 360, role: "img", "aria-label": title });
    const over = h("canvas", { className: "over", width: 640, height: 360, "aria-hidden": "true" });
    const figures = h("span", { className: "figures quiet" }, "");
    const larger = button(`enlarge:${index}`, "", () => {
      this.large = this.large === index ? null : index;
      this.arrange();
    });
    const hide = button(`camera:${index}`, "", () => {
      if (this.off.has(index)) this.off.delete(index);
      else if (this.shown().length > 1) this.off.add(index);
      this.arrange();
    });
    const line = h("li", {}, h("span", {}, `${title} `), figures, h("div", { className: "buttons", "data-row": title }, larger, hide));
    const figure = h("figure", {}, canvas, over, h("figcaption", {}, title));
    canvas.addEventListener("click", (event) => {
      const box = canvas.getBoundingClientRect();
      this.pick(index, (event.clientX - box.left) / box.width, (event.clientY - box.top) / box.height);
    });
    $("stage").append(figure);
    $("cameras").append(line);
    return { figure, line, canvas, over, figures, larger, hide, title, context: canvas.getContext("2d") };
  }

  /** The cameras that are shown, by index. */
  shown() {
    return [...this.figures.keys()].filter((index) => !this.off.has(index));
  }

  /** The `want` message: codecs and widths. */
  want(codecs) {
    const width = (index) => {
      const wide = (this.figures.get(index).canvas.clientWidth || 640) * Math.min(2, devicePixelRatio || 1);
      if (this.large === index && wide > 700) return 1280;
      return wide > 340 ? 640 : 320;
    };
    return { t: "want", codecs, cameras: this.shown().map((index) => ({ camera: index, width: width(index) })) };
  }

  arrange() {
    const stage = $("stage");
    stage.classList.toggle("enlarged", this.large !== null && this.shown().length > 1);
    stage.dataset.count = String(this.shown().length);
    for (const [index, { figure, larger, hide, title }] of this.figures) {
      const large = this.large === index;
      figure.classList.toggle("large", large);
      figure.hidden = this.off.has(index);
      text(larger, large ? "Smaller" : "Larger");
      larger.setAttribute("aria-label", `${large ? "Smaller" : "Larger"}: ${title}`);
      const off = this.off.has(index);
      text(hide, off ? "Show" : "Hide");
      hide.setAttribute("aria-label", `${off ? "Show" : "Hide"}: ${title}`);
    }
    this.app.want();
  }

  /** Paints a decoded image. */
  paint(header, image) {
    const one = this.figures.get(header.camera);
    if (!one) return;
    const { canvas, context } = one;
    if (canvas.width !== header.width) canvas.width = header.width;
    if (canvas.height !== header.height) canvas.height = header.height;
    context.drawImage(image, 0, 0, canvas.width, canvas.height);
  }

  /** Updates captions and overlays of the images. */
  show(now, frozen) {
    const { images } = this.app;
    $("stage").classList.toggle("picking", this.picking);
    for (const [index, { figure, figures, canvas }] of this.figures) {
      const last = images.painted.get(index);
      figure.classList.toggle("frozen", frozen && Boolean(last) && !this.off.has(index));
      text(figures, last ? `${images.rate(index, now).toFixed(0)} /s, ${canvas.width}×${canvas.height}` : "waiting");
    }
    this.drawOver(now);
  }

  drawOver(now) {
    for (const [index, { over, canvas }] of this.figures) {
      const cross = this.cross?.at(now);
      const drawn = cross?.camera === index || (this.outline && this.outline.camera === index);
      if (!drawn && !over.used) continue;
      over.used = drawn;
      if (over.width !== canvas.width) over.width = canvas.width;
      if (over.height !== canvas.height) over.height = canvas.height;
      const context = over.getContext("2d");
      context.clearRect(0, 0, over.width, over.height);
      if (this.outline?.camera === index) outlined(context, over, this.outline.points);
      if (cross?.camera === index) crossed(context, over, cross);
    }
  }

  /** Brings a camera's image into view, large where the page is narrow. */
  reveal(camera) {
    if (window.innerWidth <= NARROW && this.large !== camera) {
      this.large = camera;
      this.arrange();
    }
    // Only where the page scrolls: a narrow window, or 400 % zoom.
    this.figures.get(camera).figure.scrollIntoView({ block: "nearest" });
  }

  /** A point in an image was clicked. */
  pick(camera, u, v) {
    const tick = this.app.images.painted.get(camera)?.tick;
    if (tick === undefined || u < 0 || u > 1 || v < 0 || v > 1) return;
    this.app.picked(camera, tick, u, v);
  }
}

function stroke(context, over) {
  const unit = over.width / 320;
  // A dark line below a light one: visible on every image.
  for (const [colour, width] of [["#000", 4 * unit], ["#ffe14d", 2 * unit]]) {
    context.strokeStyle = colour;
    context.lineWidth = width;
    context.stroke();
  }
}

function outlined(context, over, points) {
  context.beginPath();
  for (const [u, v] of points) context.lineTo(u * over.width, v * over.height);
  context.closePath();
  stroke(context, over);
}

function crossed(context, over, { u, v }) {
  context.beginPath();
  if (v !== null) {
    context.moveTo(0, v * over.height);
    context.lineTo(over.width, v * over.height);
  }
  if (u !== null) {
    context.moveTo(u * over.width, 0);
    context.lineTo(u * over.width, over.height);
  }
  stroke(context, over);
}
