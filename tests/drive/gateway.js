// A gateway without a robot that implements client/teleop/web/PROTOCOL.md, for tests of the
// page: it records the received messages, and acts on them by the protocol. Its
// chair and hand are points that move by the current command.

import { randomBytes } from "node:crypto";
import { readFileSync } from "node:fs";
import { createServer } from "node:http";
import { extname, join, normalize } from "node:path";
import { fileURLToPath } from "node:url";
import { WebSocketServer } from "ws";

import { TEST_STREAM } from "../../client/teleop/web/page/parts/test_stream.js";

const HERE = fileURLToPath(new URL(".", import.meta.url));
const PAGE = join(HERE, "../../client/teleop/web/page");
const TYPES = { ".html": "text/html", ".css": "text/css", ".js": "text/javascript", ".svg": "image/svg+xml", ".json": "application/json" };
const POLICY = "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob: data:; " +
  "connect-src 'self'; form-action 'none'; base-uri 'none'; frame-ancestors 'none'";
const CHAIR = [0.1, 0.2, 0.35, 0.5, 0.63];
const PICTURES = ["chair", "hand"].map((name) => readFileSync(join(HERE, `data/${name}.jpg`)));
const STREAM = TEST_STREAM.map((line) => Buffer.from(line, "base64"));
/** Simulation ticks between two images, at 240 per second and 10 images per second. */
const TICKS = 24;

/** Brakes after this silence of a driving page. Longer than the real 0.25 s, see browser.js. */
const STALL_MS = 1500;

const USERS = { anna: { password: "abc", role: "operator" }, ben: { password: "abc", role: "operator" }, vera: { password: "abc", role: "viewer" } };

export class Gateway {
  constructor() {
    this.tickets = new Map();
    this.sessions = new Map();
    this.sockets = new Set();
    /** Accepted control messages, once each. */
    this.taken = [];
    /** All received messages, with their lane. */
    this.came = [];
    this.asks = [];
    this.acks = [];
    this.wants = [];
    this.held = null;
    this.chair = [0, 0];
    this.hand = [0, 0, 0];
    this.dead = 0;
    this.epoch = 0;
    this.seq = 0;
    this.tick = 240;
    this.frozen = false;
    this.codec = "auto";
    this.holder = "";
    this.goal = null;
    this.goals = 0;
    this.last = 0;
    this.faults = { allow: "drive", why: "", age_ms: 120, share: 1, blocked: {}, paused: false, silent: false };
    this.episode = null;
    this.episodes = 0;
    this.log = [];
    this.extra = {};
    /** Recorders that are connected, and labels of which they have a file. */
    this.recorders = ["disk"];
    this.labels = ["mustard-seed3-1"];
    this.recorderState = null;
    this.alarms = [];
  }

  async start() {
    this.server = createServer((request, response) => this.http(request, response));
    this.wss = new WebSocketServer({ noServer: true });
    this.server.on("upgrade", (request, socket, head) => this.wss.handleUpgrade(request, socket, head, (one) => this.socket(one, request)));
    await new Promise((done) => { this.server.listen(0, "127.0.0.1", done); });
    this.url = `http://localhost:${this.server.address().port}`;
    this.timers = [setInterval(() => this.sendImages(), 100), setInterval(() => this.situations(), 100), setInterval(() => this.guard(), 25)];
    return this;
  }

  stop() {
    this.timers.forEach(clearInterval);
    for (const one of this.sockets) one.socket.terminate();
    this.server.closeAllConnections();
    this.server.close();
  }

  // HTTP

  user(request) {
    const key = /(?:^|; )drive=([0-9a-f]+)/.exec(request.headers.cookie || "")?.[1];
    return this.sessions.get(key);
  }

  async http(request, response) {
    const path = new URL(request.url, "http://x").pathname;
    const json = (status, body, headers = {}) => {
      response.writeHead(status, { "content-type": "application/json", ...headers });
      response.end(body === undefined ? "" : JSON.stringify(body));
    };
    let body = "";
    for await (const part of request) body += part;
    if (request.method === "POST" && request.headers["sec-fetch-site"] !== "same-origin") return json(403, { error: "foreign" });
    const user = this.user(request);
    const session = (name) => ({ protocol: 1, user: name, role: USERS[name].role, name: "WheelArm" });
    if (path === "/login" && request.method === "POST") {
      const { user: name, password } = JSON.parse(body);
      if (USERS[name]?.password !== password) return json(401, { error: "Name or password is wrong" });
      const key = randomBytes(16).toString("hex");
      this.sessions.set(key, name);
      return json(200, session(name), { "set-cookie": `drive=${key}; HttpOnly; SameSite=Strict; Path=/` });
    }
    if (path === "/session") return user ? json(200, session(user)) : json(401, { error: "sign in" });
    if (path === "/logout") {
      response.writeHead(204, { "set-cookie": "drive=; Max-Age=0; Path=/" });
      return response.end();
    }
    if (path === "/ticket") {
      if (!user) return json(401, { error: "sign in" });
      const tickets = Array.from({ length: JSON.parse(body).count }, () => randomBytes(16).toString("hex"));
      for (const ticket of tickets) this.tickets.set(ticket, user);
      return json(200, { tickets, expires_s: 30 });
    }
    return this.file(path, response);
  }

  file(path, response) {
    const name = normalize(path === "/" ? "/index.html" : path);
    try {
      // Test assets are stored beside the page under /test.
      const from = name.startsWith("/test/") ? join(HERE, "node_modules", name.slice(6)) : join(PAGE, name);
      const content = readFileSync(from);
      response.writeHead(200, { "content-type": TYPES[extname(name)] || "application/octet-stream",
        "content-security-policy": POLICY, "cache-control": "no-cache" });
      response.end(content);
    } catch {
      response.writeHead(404);
      response.end();
    }
  }

  // Sockets

  socket(socket, request) {
    const kind = new URL(request.url, "http://x").pathname.slice(4);
    const one = { socket, kind, ready: false, flight: new Map(), seq: new Map(), key: new Set(), want: null };
    socket.on("error", () => {});
    socket.on("close", () => {
      this.sockets.delete(one);
      if (kind === "control" && ![...this.sockets].some((other) => other.kind === "control" && other.user === this.holder)) this.brake();
    });
    socket.on("message", (data) => {
      const message = JSON.parse(data.toString());
      if (!one.ready) this.hello(one, message);
      else this.message(one, message, data.toString());
    });
  }

  hello(one, { ticket, protocol, page, lane }) {
    const user = this.tickets.get(ticket);
    this.tickets.delete(ticket);
    if (!user) return one.socket.close(4401, "ticket");
    if (protocol !== 1) return one.socket.close(4426, "version");
    if (one.kind === "control" && USERS[user].role === "viewer") return one.socket.close(4403, "viewers do not drive");
    Object.assign(one, { ready: true, user, page, lane });
    this.sockets.add(one);
    one.socket.send(JSON.stringify({ t: "welcome", protocol: 1 }));
    return undefined;
  }

  message(one, message, raw) {
    if (one.kind === "video") return this.video(one, message);
    if (one.kind === "state") return this.ask(one, message);
    this.came.push({ lane: one.lane, raw, ...message });
    if (message.seq <= this.seq || this.holder !== one.user) return undefined;
    this.seq = message.seq;
    this.epoch = Math.max(this.epoch, message.epoch);
    this.ms = message.ms;
    this.last = Date.now();
    this.taken.push(message);
    if (message.t === "stop") {
      this.brake();
      this.stopped = true;
      this.toAll("state", { t: "stopped", seq: message.seq });
      return undefined;
    }
    if (message.t === "alive" || message.epoch <= this.dead) return undefined;
    if (message.t === "step") {
      this.goal = null;
      this.stopped = false;
      if (message.part === "hand") this.hand[message.axis] += message.sign * 0.05;
      if (message.part === "chair") this.chair[message.axis] += message.sign * 0.05;
      return undefined;
    }
    const moves = message.clutch || message.grip || ["chair", "hand", "turn"].some((part) => (message[part] || []).some(Boolean));
    if (moves) {
      this.goal = null;
      this.stopped = false;
    }
    if (message.clutch) {
      if (this.latched?.epoch !== message.epoch) this.latched = { epoch: message.epoch, hand: [...this.hand] };
      this.hand = this.latched.hand.map((value, axis) => value + message.clutch.move[axis]);
    }
    this.held = moves ? message : null;
    return undefined;
  }

  /** Ends a motion on the gateway's side. */
  brake() {
    this.held = null;
    this.goal = null;
    this.dead = this.epoch;
  }

  guard() {
    if (this.held && Date.now() - this.last > STALL_MS) {
      this.log.push("stall");
      this.brake();
    }
    if (!this.held) return;
    const speed = CHAIR[this.held.speed - 1] * this.faults.share;
    (this.held.chair || []).forEach((value, axis) => { this.chair[axis] += value * speed * 0.025; });
    (this.held.hand || []).forEach((value, axis) => { this.hand[axis] += value * 0.08 * 0.025; });
  }

  video(one, message) {
    if (message.t === "want") {
      one.want = message;
      this.wants.push(message);
    } else if (message.t === "ack") {
      this.acks.push(message);
      const flight = one.flight.get(message.camera) || [];
      one.flight.set(message.camera, flight.filter((seq) => seq > message.seq));
    } else if (message.t === "key") one.key.add(message.camera);
  }

  /** Sends an image of each camera to each page that wants it, within the limit of unacknowledged ones. */
  sendImages() {
    if (!this.faults.paused) this.tick += TICKS;
    if (this.frozen) return;
    for (const one of this.sockets) {
      if (one.kind !== "video" || !one.want) continue;
      for (const { camera } of one.want.cameras) this.sendImage(one, camera);
    }
  }

  sendImage(one, camera) {
    const flight = one.flight.get(camera) || [];
    if (flight.length >= 3 || camera > 1) return;
    const seq = (one.seq.get(camera) || 0) + 1;
    const h264 = one.want.codecs[0] === "h264" && this.codec !== "jpeg";
    // After a lost key frame the stream begins again.
    if (one.key.delete(camera)) one.start = seq;
    const at = (seq - (one.start || 1)) % STREAM.length;
    const body = h264 ? STREAM[at] : PICTURES[camera];
    const header = Buffer.alloc(40);
    header.writeUInt8(1, 0);
    header.writeUInt8(h264 ? 1 : 0, 1);
    header.writeUInt8(!h264 || at === 0 ? 1 : 0, 2);
    header.writeUInt8(camera, 3);
    header.writeUInt16LE(h264 ? 64 : 640, 4);
    header.writeUInt16LE(h264 ? 48 : 360, 6);
    header.writeUInt32LE(seq, 8);
    header.writeBigUInt64LE(BigInt(this.tick), 16);
    header.writeBigUInt64LE(BigInt(this.tick) * 4166667n, 24);
    one.socket.send(Buffer.concat([header, body]));
    one.seq.set(camera, seq);
    one.flight.set(camera, [...flight, seq]);
    this.inFlight = Math.max(this.inFlight || 0, flight.length + 1);
  }

  ask(one, message) {
    this.asks.push({ user: one.user, ...message });
    const answer = (body) => one.socket.send(JSON.stringify({ t: "answer", id: message.id, ok: true, ...body }));
    const refuse = (error) => one.socket.send(JSON.stringify({ t: "answer", id: message.id, ok: false, error }));
    const may = USERS[one.user].role !== "viewer";
    if (!may && message.ask !== "tasks") return refuse("this name watches only");
    switch (message.ask) {
      case "tasks": return answer({ tasks: [{ name: "pick_mustard", instruction: "Take the mustard" }, { name: "bear", instruction: "Take the bear" }] });
      case "lease.ask":
        if (this.holder && this.holder !== one.user) {
          this.requestedBy = one.user;
          this.toAll("state", { t: "note", bad: false, text: `${one.user} asks for control` });
          return refuse(`${this.holder} is in control; wait, or take it`);
        }
        this.holder = one.user;
        return answer({ mine: true });
      case "lease.take":
        this.brake();
        this.holder = one.user;
        return answer({ mine: true });
      case "lease.give":
        this.brake();
        this.holder = message.to || "";
        return answer({});
      case "episode.start": {
        const practice = message.recorders === 0;
        let refusal = "";
        let label = message.label || "mustard-seed3-1";
        if (!practice && this.recorders.length < (message.recorders ?? 1)) {
          refusal = "nothing can be recorded: 0 of 1 recorders answer. Start one with `wheelarm record`, or practise without recording";
        } else if (!practice && message.label && this.labels.includes(label)) refusal = `recorder disk cannot record it: ${label}.h5 exists already; the next free label is ${label}-2`;
        else for (let number = 2; !practice && this.labels.includes(label); number += 1) label = `mustard-seed3-${number}`;
        this.alarms = refusal ? [refusal] : [];
        if (refusal) return refuse(refusal);
        this.episodes += 1;
        this.episode = { number: this.episodes, label, practice, instruction: message.instruction || "Bring the mustard to the person.", seconds: 0 };
        return answer({ number: this.episodes, label, practice });
      }
      case "episode.finish":
        if (!this.episode.practice) this.written(this.episode.label);
        this.episode = null;
        return answer({ success: true, text: "episode over: success after 12.0 s" });
      case "episode.discard":
        this.episode = null;
        return answer({ success: true, text: "episode over: success after 12.0 s; discarded" });
      case "pick":
        return answer(message.v < 0.1 ? { candidates: [], note: "Nothing is there" } : { candidates: [
          { candidate: "c1", name: "mustard bottle", actions: ["near", "take"], note: "0.62 m away",
            outline: [[0.27, 0.09], [0.34, 0.09], [0.34, 0.29], [0.27, 0.29]] },
          { candidate: "c2", name: "table", actions: ["put"], outline: [[0, 0.1], [0.7, 0.1], [0.7, 0.6], [0, 0.6]] }] });
      case "goal.start":
        this.goals += 1;
        this.stopped = false;
        this.goal = { id: this.goals, action: message.action, name: "mustard bottle", stage: "reaching", of: 4, at: 2, text: "the hand goes near" };
        return answer({ goal: this.goals });
      case "goal.cancel":
        this.brake();
        return answer({});
      default: return answer({});
    }
  }

  /** The recorder reports the state of the file a moment later. */
  written(label) {
    this.labels.push(label);
    setTimeout(() => {
      const kept = this.recorderState !== "failed";
      const words = kept ? `episode ${label}: kept in data/${label}.h5` : `episode ${label} is NOT KEPT: recorder disk failed: the disk is full`;
      if (!kept) this.alarms = [words];
      this.toAll("state", { t: "note", bad: !kept, text: words });
    }, 300);
  }

  toAll(kind, message) {
    for (const one of this.sockets) if (one.kind === kind) one.socket.send(JSON.stringify(message));
  }

  /** A refusal of the newest command, as the command gate would send it. */
  refuse(reason) {
    this.brake();
    this.toAll("state", { t: "refusal", seq: this.seq, code: "TOO_OLD", reason });
  }

  situations() {
    if (this.faults.silent) return;
    this.count = (this.count || 0) + 1;
    if (this.episode) this.episode.seconds += 0.1;
    for (const one of this.sockets) if (one.kind === "state") one.socket.send(JSON.stringify(this.situation(one.user)));
  }

  situation(user) {
    const { faults } = this;
    const mine = user === this.holder;
    const people = [...new Set([...this.sockets].map((one) => one.user))].map((name) => ({ name, role: USERS[name].role, control: name === this.holder }));
    const chair = CHAIR[2];
    return {
      t: "situation", n: this.count, tick: this.tick, sim_s: this.tick / 240, link: "open", link_for_s: 10,
      you: { user, role: USERS[user].role }, lease: { holder: this.holder, mine, requests: this.requestedBy && this.requestedBy !== this.holder ? [this.requestedBy] : [], for_s: 10 },
      people, scenario: { task: "pick_mustard", seed: 3, instruction: "Bring the mustard to the person." }, episode: this.episode,
      alarms: this.alarms, recorded_bytes: this.episode && !this.episode.practice ? Math.round(this.episode.seconds * 1.2e6) : null,
      recorders: this.recorders.map((name) => ({ name, state: this.recorderState || (this.episode ? "ready" : "idle"), missed: 0, frames: this.episode ? Math.round(this.episode.seconds * 20) : 0, complete: false, message: "" })),
      evaluation: { success: false, failure: "", elapsed_s: 0, conditions: [
        { name: "lifted_and_held(mustard)", holds: false, required: true }, { name: "chair_stopped", holds: true, required: true },
        { name: "nothing_knocked_over", holds: true, required: true }, { name: "clear_of_person", holds: true, required: true }] },
      paused: faults.paused, waiting_for: "", factor: 1, busy: "",
      cameras: ["wheelchair", "gen3"].map((name, index) => ({ index, name, width: 1280, height: 720, hz: 10, codec: "jpeg", width_sent: 640 })),
      control: { seq: this.seq, epoch: this.epoch, dead: this.dead, stopped: Boolean(this.stopped), allow: faults.allow, why: faults.why, age_ms: faults.age_ms,
        cap: { chair: chair * faults.share, share: faults.share } },
      echo: { ms: this.ms || 0, held_ms: 5 },
      robot: { speed: this.held?.chair || [0, 0], chair: [...this.chair, 0], hand: this.hand.map((value, axis) => value + [0.45, 0, 0.6][axis]), opening_mm: 85, pad_force: [0, 0],
        moving: Boolean(this.held || this.goal), phase: "", problem: "" },
      blocked: faults.blocked, contacts: Object.values(faults.blocked).includes("contact") ? ["chair and table"] : [], goal: this.goal, ...this.extra,
    };
  }
}

