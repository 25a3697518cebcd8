// The connection: tickets, the four sockets, and reconnecting.
// Nothing is queued: a message that cannot be sent now is dropped.

const PROTOCOL = 1;
/** A lane with more unsent bytes than this is skipped. */
const FULL = 1000;
const WAITS = [500, 1000, 2000, 4000];
const ASK_MS = 60_000;

/** GET or POST of JSON: {status, body}. */
export async function http(path, body) {
  const options = body === undefined ? {} : {
    method: "POST", headers: { "content-type": "application/json" }, body: JSON.stringify(body),
  };
  const answer = await fetch(path, { ...options, credentials: "same-origin", cache: "no-store" });
  const text = await answer.text();
  let value = {};
  try {
    value = text ? JSON.parse(text) : {};
  } catch {
    value = { error: `the gateway's answer cannot be read (${answer.status})` };
  }
  return { status: answer.status, body: value };
}

/** A random identifier of this page. */
export function pageName() {
  return [...crypto.getRandomValues(new Uint8Array(16))].map((byte) => byte.toString(16).padStart(2, "0")).join("");
}

export class Sockets {
  /** `received(kind, message)`, `opened(kind)`, `closed(kind, reason)`, `login()`. */
  constructor(handlers) {
    this.handlers = handlers;
    this.page = pageName();
    this.open = new Map();
    this.tries = new Map();
    this.asks = new Map();
    this.number = 0;
    this.life = 0;
  }

  /** Opens all sockets that this role may open. */
  start(role) {
    this.life += 1;
    const kinds = role === "viewer" ? ["state", "video"] : ["state", "video", "control0", "control1"];
    for (const kind of kinds) this.connect(kind, this.life);
  }

  /** Closes all, for good. */
  end() {
    this.life += 1;
    for (const socket of this.open.values()) socket.close(1000, "left");
    this.open.clear();
  }

  /** Number of open control lanes. */
  lanes() {
    return ["control0", "control1"].filter((kind) => this.open.has(kind)).length;
  }

  /** Control messages are sent on both lanes; a full lane is skipped, except by a stop. */
  control(messages) {
    for (const kind of ["control0", "control1"]) {
      const socket = this.open.get(kind);
      if (!socket) continue;
      for (const message of messages) {
        if (message.t === "stop" || socket.bufferedAmount <= FULL) socket.send(JSON.stringify(message));
      }
    }
  }

  /** A message on the video socket. */
  video(message) {
    this.open.get("video")?.send(JSON.stringify(message));
  }

  /** Sends a request; resolves with the answer, throws its error. */
  ask(what, fields = {}) {
    const socket = this.open.get("state");
    if (!socket) return Promise.reject(new Error("no connection: the request was not sent"));
    this.number += 1;
    const id = this.number;
    return new Promise((done, fail) => {
      const timer = setTimeout(() => {
        this.asks.delete(id);
        fail(new Error("the gateway did not answer for a minute"));
      }, ASK_MS);
      this.asks.set(id, { done, fail, timer });
      socket.send(JSON.stringify({ t: "ask", id, ask: what, ...fields }));
    });
  }

  again(kind, life, wait) {
    const tries = this.tries.get(kind) || 0;
    this.tries.set(kind, tries + 1);
    setTimeout(() => this.connect(kind, life), wait ?? WAITS[Math.min(tries, WAITS.length - 1)]);
  }

  async connect(kind, life) {
    if (life !== this.life) return;
    let ticket;
    try {
      const { status, body } = await http("/ticket", { count: 1 });
      if (life !== this.life) return;
      if (status === 401) {
        this.handlers.login();
        return;
      }
      ticket = body.tickets?.[0];
    } catch {
      ticket = undefined;
    }
    if (!ticket) {
      this.handlers.closed(kind, "");
      this.again(kind, life);
      return;
    }
    const lane = kind === "control1" ? 1 : 0;
    const path = kind.startsWith("control") ? "control" : kind;
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    const socket = new WebSocket(`${scheme}://${location.host}/ws/${path}`);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => {
      const hello = { t: "hello", protocol: PROTOCOL, ticket, page: this.page };
      socket.send(JSON.stringify(path === "control" ? { ...hello, lane } : hello));
    };
    socket.onmessage = ({ data }) => this.message(kind, socket, data, life);
    socket.onclose = ({ code, reason }) => this.gone(kind, socket, code, reason, life);
  }

  message(kind, socket, data, life) {
    if (life !== this.life) return;
    if (typeof data !== "string") {
      this.handlers.received(kind, data);
      return;
    }
    const message = JSON.parse(data);
    if (message.t === "welcome") {
      this.open.set(kind, socket);
      this.tries.set(kind, 0);
      this.handlers.opened(kind);
    } else if (message.t === "answer") {
      const ask = this.asks.get(message.id);
      this.asks.delete(message.id);
      if (!ask) return;
      clearTimeout(ask.timer);
      if (message.ok) ask.done(message);
      else ask.fail(new Error(message.error || "refused"));
    } else this.handlers.received(kind, message);
  }

  gone(kind, socket, code, reason, life) {
    if (this.open.get(kind) === socket) this.open.delete(kind);
    if (life !== this.life) return;
    if (kind === "state") {
      for (const { fail, timer } of this.asks.values()) {
        clearTimeout(timer);
        fail(new Error("the connection was lost before the answer"));
      }
      this.asks.clear();
    }
    this.handlers.closed(kind, code >= 4000 ? reason : "");
    if (code === 4426) this.handlers.closed(kind, "The gateway is of another version: load this page again");
    else if (code !== 4403 && code !== 4409) {
      this.again(kind, life, code === 4429 ? 10_000 : code === 4400 ? 4000 : undefined);
    }
  }
}
