// Decodes images: JPEG by createImageBitmap, H.264 by WebCodecs
// if the decoder returns one image for each input.

import { readHeader } from "../logic/images.js";
import { TEST_STREAM } from "./test_stream.js";

export const CONFIG = {
  codec: "avc1.42E01F", optimizeForLatency: true, hardwareAcceleration: "prefer-software",
};
/** A decoder that has not returned an image after this time holds images back, ms. */
const PATIENCE_MS = 700;

const bytes = (base64) => Uint8Array.from(atob(base64), (c) => c.charCodeAt(0));

/**
 * Feeds ten images, each only after the previous one was returned. Resolves to whether all were:
 * some decoders hold eight images back, which would be eight tenths of a second.
 */
export async function oneInOneOut(scope = globalThis, stream = TEST_STREAM, patience = PATIENCE_MS) {
  const { VideoDecoder, EncodedVideoChunk } = scope;
  if (!VideoDecoder || !EncodedVideoChunk || !scope.isSecureContext) return false;
  let came = () => {};
  let decoder;
  try {
    if (!(await VideoDecoder.isConfigSupported(CONFIG)).supported) return false;
    decoder = new VideoDecoder({
      output: (frame) => {
        frame.close();
        came(true);
      },
      error: () => came(false),
    });
    decoder.configure(CONFIG);
    for (const [index, data] of stream.entries()) {
      const out = new Promise((resolve) => {
        came = resolve;
        setTimeout(() => resolve(false), patience);
      });
      decoder.decode(new EncodedVideoChunk({
        type: index === 0 ? "key" : "delta", timestamp: index, data: bytes(data),
      }));
      if (!(await out)) return false;
    }
    return true;
  } catch {
    return false;
  } finally {
    if (decoder && decoder.state !== "closed") decoder.close();
  }
}

export class Decoders {
  /** `images` receives the decoded images; `send` sends on the video socket. */
  constructor(images, send) {
    this.images = images;
    this.send = send;
    this.cameras = new Map();
    this.problem = "";
  }

  /** A binary message. */
  take(buffer) {
    let header;
    try {
      header = readHeader(buffer);
    } catch (error) {
      this.problem = error.message;
      return;
    }
    if (header.codec === "jpeg") this.jpeg(header);
    else if (header.codec === "h264") this.h264(header);
    else this.lost(header);
  }

  async jpeg(header) {
    try {
      const image = await createImageBitmap(new Blob([header.body], { type: "image/jpeg" }));
      this.images.decoded(header, image);
    } catch {
      this.lost(header);
    }
  }

  h264(header) {
    let one = this.cameras.get(header.camera);
    if (!one || one.decoder.state === "closed") {
      one = this.opened(header.camera);
      this.cameras.set(header.camera, one);
    }
    if (one.wantsKey && !header.key) {
      this.lost(header);
      return;
    }
    one.wantsKey = false;
    one.headers.set(header.seq, header);
    try {
      one.decoder.decode(new EncodedVideoChunk({
        type: header.key ? "key" : "delta", timestamp: header.seq, data: header.body,
      }));
    } catch {
      this.broken(header.camera);
    }
  }

  opened(camera) {
    const one = { headers: new Map(), wantsKey: true, decoder: null };
    one.decoder = new VideoDecoder({
      output: (frame) => {
        const header = one.headers.get(frame.timestamp);
        for (const seq of one.headers.keys()) if (seq <= frame.timestamp) one.headers.delete(seq);
        if (header) this.images.decoded(header, frame);
        else frame.close();
      },
      error: () => this.broken(camera),
    });
    one.decoder.configure(CONFIG);
    return one;
  }

  /** An image that cannot be decoded is acknowledged; otherwise the gateway would stop sending. */
  lost(header) {
    this.send({ t: "ack", camera: header.camera, seq: header.seq, painted: false });
    if (!header.key) this.send({ t: "key", camera: header.camera });
  }

  broken(camera) {
    const one = this.cameras.get(camera);
    if (!one) return;
    this.cameras.delete(camera);
    const last = Math.max(0, ...one.headers.keys());
    if (one.decoder.state !== "closed") one.decoder.close();
    if (last > 0) this.send({ t: "ack", camera, seq: last, painted: false });
    this.send({ t: "key", camera });
  }

  /** The socket is new. */
  forget() {
    for (const { decoder } of this.cameras.values()) if (decoder.state !== "closed") decoder.close();
    this.cameras.clear();
  }
}
