import assert from "node:assert/strict";
import { test } from "node:test";

import { FROZEN_MS, HEADER_BYTES, Images, readHeader } from "../../../client/teleop/web/page/logic/images.js";
import { loopAge, rights } from "../../../client/teleop/web/page/logic/rights.js";
import { oneInOneOut } from "../../../client/teleop/web/page/parts/decode.js";

const image = () => ({ closed: 0, close() { this.closed += 1; } });
const header = (camera, seq, tick) => ({ camera, seq, tick });

test("the header is parsed as the protocol specifies", () => {
  const bytes = Buffer.alloc(HEADER_BYTES + 3);
  bytes.writeUInt8(1, 0);
  bytes.writeUInt8(1, 1);
  bytes.writeUInt8(1, 2);
  bytes.writeUInt8(4, 3);
  bytes.writeUInt16LE(640, 4);
  bytes.writeUInt16LE(360, 6);
  bytes.writeUInt32LE(4_000_000_000, 8);
  bytes.writeBigUInt64LE(9_000_000_000_000n, 16);
  const buffer = bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length);
  const read = readHeader(buffer);
  assert.deepEqual([read.codec, read.key, read.camera, read.width, read.height, read.seq, read.tick, read.body.length],
    ["h264", true, 4, 640, 360, 4_000_000_000, 9_000_000_000_000, 3]);
  new DataView(buffer).setUint8(0, 2);
  assert.throws(() => readHeader(buffer), /version 2/);
  assert.throws(() => readHeader(new ArrayBuffer(12)), /without content/);
});

test("only what is painted is shown and acknowledged; older images are closed", () => {
  const images = new Images();
  const [first, second] = [image(), image()];
  images.decoded(header(0, 1, 240), first);
  images.decoded(header(0, 2, 264), second);
  assert.equal(first.closed, 1);
  assert.equal(images.shown([0], 0), null, "decoded is not painted");
  const painted = [];
  const acks = images.paint(10, ({ seq }) => painted.push(seq));
  assert.deepEqual(painted, [2]);
  assert.deepEqual(acks, [{ t: "ack", camera: 0, seq: 2, painted: true }]);
  assert.equal(second.closed, 1);
  assert.equal(images.shown([0], 20), 264);
  assert.deepEqual(images.paint(30, () => {}), [], "nothing new: no acknowledgement");
});

test("an image that was decoded late is dropped", () => {
  const images = new Images();
  const late = image();
  images.decoded(header(0, 2, 264), image());
  images.decoded(header(0, 1, 240), late);
  assert.equal(late.closed, 1);
  assert.equal(images.paint(0, () => {})[0].seq, 2);
});

test("the shown tick is the oldest on the screen, and none when one image froze", () => {
  const images = new Images();
  images.decoded(header(0, 1, 240), image());
  images.decoded(header(1, 1, 216), image());
  images.paint(0, () => {});
  assert.equal(images.shown([0, 1], 100), 216);
  assert.equal(images.shown([0], 100), 240);
  images.decoded(header(0, 2, 500), image());
  images.paint(FROZEN_MS, () => {});
  assert.equal(images.shown([0, 1], FROZEN_MS + 1), null);
  assert.equal(images.shown([0], FROZEN_MS + 1), 500, "the frozen one can be hidden");
  assert.equal(images.shown([], 0), null);
});

const good = () => ({ link: "open", lease: { mine: true, holder: "anna" }, paused: false, control: { allow: "drive" } });
const check = (s, more = {}) => rights({ s, silenceMs: 50, role: "operator", lanes: 2, frozenMs: 100, hidden: false, away: false, ...more });

test("driving is allowed only with right, lease, lanes, link and a live image", () => {
  assert.equal(check(good()).reason, "");
  assert.equal(check(good(), { lanes: 1 }).reason, "");
  const no = [[null], [good(), { silenceMs: 5000 }], [good(), { role: "viewer" }], [good(), { lanes: 0 }], [good(), { hidden: true }],
    [{ ...good(), link: "lost" }], [{ ...good(), lease: { mine: false, holder: "ben" } }], [good(), { away: true }],
    [{ ...good(), paused: true }], [good(), { alarm: true }], [{ ...good(), control: { allow: "stop", why: "" } }], [good(), { frozenMs: 1001 }]];
  for (const [s, more] of no) assert.notEqual(check(s, more).reason, "", JSON.stringify([s, more]));
  assert.equal(check({ ...good(), control: { allow: "steps" } }).stepsOnly, true);
  assert.equal(check({ ...good(), lease: { mine: false, holder: "" } }).why, "free");
  assert.notEqual(check({ ...good(), lease: { mine: false, holder: "ben" } }).why, "free");
  assert.equal(check(good(), { frozenMs: 1001 }).why, "frozen");
});

test("the age of the loop is shown with its effect", () => {
  assert.deepEqual(loopAge({ age_ms: 123, allow: "drive", cap: { share: 1, chair: 0.35 } }), { text: "120 ms", state: "good" });
  assert.match(loopAge({ age_ms: 500, allow: "drive", cap: { share: 0.7, chair: 0.42 } }).text, /at most 0.42 m\/s/);
  assert.match(loopAge({ age_ms: 1400, allow: "steps" }).text, /1.4 s, only steps/);
  assert.equal(loopAge({ age_ms: 2500, allow: "stop" }).state, "bad");
  assert.equal(loopAge(null).text, "–");
});

/** WebCodecs of a browser whose decoder holds `held` images back. */
function codecs(held, supported = true) {
  return {
    isSecureContext: true,
    EncodedVideoChunk: class { constructor(init) { Object.assign(this, init); } },
    VideoDecoder: class {
      static async isConfigSupported() { return { supported }; }
      constructor({ output }) { Object.assign(this, { output, state: "unconfigured", inside: [] }); }
      configure() { this.state = "configured"; }
      decode(chunk) {
        this.inside.push(chunk);
        if (this.inside.length > held) setTimeout(() => this.output({ timestamp: this.inside.shift().timestamp, close() {} }));
      }
      close() { this.state = "closed"; }
    },
  };
}

test("the decoder is used only when it returns each image before the next input", async () => {
  assert.equal(await oneInOneOut(codecs(0)), true);
  assert.equal(await oneInOneOut(codecs(8), undefined, 20), false);
  assert.equal(await oneInOneOut(codecs(0, false)), false);
  assert.equal(await oneInOneOut({ isSecureContext: true }), false);
  assert.equal(await oneInOneOut({ ...codecs(0), isSecureContext: false }), false);
});
