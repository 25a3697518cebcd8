// Received images: their header, painting, acknowledgements and
// age. Pure: images are opaque objects with `close()`.

export const HEADER_BYTES = 40;
/** Without a new image for this long the image is frozen, ms. */
export const FROZEN_MS = 1000;

/** Parses the header of a message, with the encoded image; throws an Error when it is invalid. */
export function readHeader(buffer) {
  if (buffer.byteLength <= HEADER_BYTES) throw new Error("an image without content");
  const view = new DataView(buffer);
  const version = view.getUint8(0);
  if (version !== 1) throw new Error(`images of version ${version}: load the page again`);
  return {
    codec: ["jpeg", "h264"][view.getUint8(1)] || "unknown",
    key: (view.getUint8(2) & 1) === 1,
    camera: view.getUint8(3),
    width: view.getUint16(4, true),
    height: view.getUint16(6, true),
    seq: view.getUint32(8, true),
    tick: Number(view.getBigUint64(16, true)),
    stamp: Number(view.getBigUint64(24, true)),
    sent: Number(view.getBigUint64(32, true)),
    body: new Uint8Array(buffer, HEADER_BYTES),
  };
}

/** Images that wait to be painted and painted ones, by camera. */
export class Images {
  constructor() {
    this.waiting = new Map();
    this.painted = new Map();
  }

  /** A decoded image; an older waiting image of its camera is closed. */
  decoded(header, image) {
    const old = this.waiting.get(header.camera);
    if (old && old.header.seq > header.seq) {
      image.close();
      return;
    }
    if (old) old.image.close();
    this.waiting.set(header.camera, { header, image });
  }

  /**
   * In the animation frame: `paint(header, image)` for each waiting image. Returns
   * the acknowledgements; each covers all older images of its camera.
   */
  paint(now, paint) {
    const acks = [];
    for (const [camera, { header, image }] of this.waiting) {
      paint(header, image);
      image.close();
      const last = this.painted.get(camera);
      const times = (last?.times || []).filter((time) => now - time < 3000);
      this.painted.set(camera, { ...header, body: undefined, at: now, times: [...times, now] });
      acks.push({ t: "ack", camera, seq: header.seq, painted: true });
    }
    this.waiting.clear();
    return acks;
  }

  /** The lowest painted tick of these cameras, or null. */
  shown(cameras, now) {
    if (cameras.length === 0 || this.frozenFor(cameras, now) > FROZEN_MS) return null;
    return Math.min(...cameras.map((camera) => this.painted.get(camera).tick));
  }

  /** Age of the oldest painted image, ms; Infinity before the first. */
  frozenFor(cameras, now) {
    return Math.max(0, ...cameras.map((camera) => now - (this.painted.get(camera)?.at ?? -Infinity)));
  }

  /** Images per second of a camera. */
  rate(camera, now) {
    const times = (this.painted.get(camera)?.times || []).filter((time) => now - time < 3000);
    return times.length > 1 ? ((times.length - 1) * 1000) / (times.at(-1) - times[0]) : 0;
  }

  /** The sockets are new: sequence numbers start again. */
  forget() {
    for (const { image } of this.waiting.values()) image.close();
    this.waiting.clear();
    this.painted.clear();
  }
}
