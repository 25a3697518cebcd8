"use strict";
// Shows what the program serves: pictures by question and answer, so that a
// slow browser or link never gets a queue, only fewer pictures; the state as
// server-sent events. Texts from outside are set as text, never as markup.

const $ = (id) => document.getElementById(id);
const viewer = Math.random().toString(36).slice(2, 12);
const cameras = new Map();
// Two questions are under way at a time: one waits while the other is drawn.
const QUESTIONS = 2;
const OLD_MS = 2000;
const CAMERA_NAMES = { gen3: "hand camera", wheelchair: "chair camera", room: "room camera" };
const RECORDER_WORDS = { ready: "recording", idle: "ready" };

function element(tag, text, style) {
  const made = document.createElement(tag);
  if (text !== undefined) made.textContent = text;
  if (style) made.className = style;
  return made;
}

class Camera {
  constructor(name) {
    this.name = name;
    this.number = 0;
    this.drawn = [];
    this.level = "";
    this.growth = 0;
    this.failed = 0;
    this.figure = element("figure");
    this.canvas = element("canvas");
    this.title = element("span", CAMERA_NAMES[name] || name);
    this.figures = element("span", "waiting");
    const caption = element("figcaption");
    caption.append(this.title, this.figures);
    this.figure.append(this.canvas, caption);
    this.figure.addEventListener("click", () => enlarge(this.figure));
    for (let i = 0; i < QUESTIONS; i++) this.ask();
  }

  async ask() {
    for (;;) {
      if (document.hidden) { await sleep(300); continue; }
      try {
        const answer = await fetch(`/camera/${this.name}?after=${this.number}&viewer=${viewer}`);
        if (answer.status === 200) {
          const number = Number(answer.headers.get("x-number"));
          const picture = await createImageBitmap(await answer.blob());
          this.show(number, picture, answer.headers);
          this.failed = 0;
        } else if (answer.status !== 204) {
          await sleep(1000);
        }
      } catch {
        this.failed += 1;
        this.number = 0;
        await sleep(Math.min(3000, 300 * this.failed));
      }
    }
  }

  show(number, picture, headers) {
    if (number <= this.number) { picture.close(); return; }
    this.number = number;
    this.level = headers.get("x-level");
    this.growth = Number(headers.get("x-growth-ms"));
    if (this.canvas.width !== picture.width) this.canvas.width = picture.width;
    if (this.canvas.height !== picture.height) this.canvas.height = picture.height;
    this.canvas.getContext("2d").drawImage(picture, 0, 0);
    picture.close();
    const now = performance.now();
    this.drawn.push(now);
    while (now - this.drawn[0] > 3000) this.drawn.shift();
  }

  rate() {
    const span = this.drawn.length > 1 ? (this.drawn.at(-1) - this.drawn[0]) / 1000 : 0;
    return span > 0 ? (this.drawn.length - 1) / span : 0;
  }

  caption(still) {
    const last = this.drawn.at(-1);
    const age = last === undefined ? Infinity : performance.now() - last;
    const old = age > OLD_MS && !still;
    this.figure.classList.toggle("old", old && last !== undefined);
    if (last === undefined) this.figures.textContent = "waiting";
    else if (old) this.figures.textContent = `NOT LIVE: ${(age / 1000).toFixed(0)} s old`;
    else if (still) this.figures.textContent = "time is paused";
    else this.figures.textContent =
      `${this.rate().toFixed(1)} /s  ${this.canvas.width}×${this.canvas.height}  ${this.level}`;
  }
}

const sleep = (ms) => new Promise((done) => setTimeout(done, ms));

function enlarge(figure) {
  const large = figure.classList.toggle("large");
  for (const other of cameras.values()) {
    if (other.figure !== figure) other.figure.classList.remove("large");
  }
  $("cameras").classList.toggle("single", large);
}

function chip(id, text, style) {
  $(id).textContent = text;
  $(id).className = `chip ${style}`;
}

function pairs(id, rows) {
  const list = [];
  for (const [name, value, style] of rows) {
    list.push(element("dt", name), element("dd", value, style));
  }
  $(id).replaceChildren(...list);
}

// Without the sign of a rounded zero.
const fixed = (value, digits) =>
  (value === null || value === undefined ? "–" : value.toFixed(digits).replace(/^-(0(\.0*)?)$/, "$1"));

let alive = 0;
let state = null;

function show() {
  const gone = performance.now() - alive > 7000;
  const s = state;
  const alarms = [];
  if (gone) alarms.push("The program that serves this page does not answer.");
  if (!s || !s.connection) { alarm(alarms); return; }
  if (s.connection === "open") chip("link", `link ${fixed(s.round_trip_ms, 0)} ms`, "good");
  else if (s.connection === "silent") {
    chip("link", `no answer for ${fixed(s.since, 1)} s`, "careful");
  } else if (s.connection === "lost") {
    chip("link", "link lost", "bad");
    alarms.push(`Link lost ${fixed(s.since, 0)} s ago: the chair brakes by itself, the arm holds. Trying again …`);
  } else chip("link", "connecting", "careful");
  if (gone) chip("link", "page not live", "bad");

  if (s.episode) chip("episode", `episode ${s.episode.number}  ${s.episode.label}  ${fixed(s.episode.seconds, 1)} s`, "good");
  else chip("episode", "no episode", "");
  const missed = s.recorders.reduce((sum, r) => sum + r.missed, 0);
  const recording = s.recorders.filter((r) => r.state === "ready").length;
  const failed = s.recorders.some((r) => r.state === "failed");
  if (failed) chip("recording", "recorder FAILED", "bad");
  else if (missed > 0) chip("recording", `${missed} samples missed`, "bad");
  else if (recording > 0) chip("recording", `● recording × ${recording}`, "good");
  else if (s.episode) chip("recording", "NOT RECORDED", "careful");
  else chip("recording", s.recorders.length === 1 ? "1 recorder" : `${s.recorders.length} recorders`, "");
  chip("control", s.holder ? `${s.holder} in control` : "nobody in control", s.holder ? "" : "careful");
  if (s.paused) chip("pace", "paused", "careful");
  else chip("pace", `${fixed(s.factor, 2)}× time`, s.factor < 0.8 ? "careful" : "");
  if (s.waiting_for) alarms.push(`The simulation waits for ${s.waiting_for}.`);

  $("instruction").textContent = s.episode ? s.episode.instruction : s.instruction;
  $("task").textContent = s.task ? `${s.task}, seed ${s.seed}` : "none";
  $("conditions").replaceChildren(...s.conditions.map((c) => {
    const style = c.holds ? "good" : c.required ? "bad" : "careful";
    const row = element("li");
    row.append(element("b", c.holds ? "yes" : "no", style), `${c.name} `, element("small", fixed(c.value, 3)));
    return row;
  }));
  $("result").textContent =
    s.success ? "SUCCESS" : s.failure ? `FAILED: ${s.failure}` : s.task ? `${fixed(s.elapsed, 0)} s` : "";
  $("result").className = s.success ? "good" : s.failure ? "bad" : "";

  const [x, y, heading] = s.chair || [null, null, null];
  const [forward, left, up] = s.hand || [null, null, null];
  pairs("robot", [
    ["phase", s.phase || "–"],
    ["speed", `${fixed(s.speed[0], 2)} m/s  ${fixed(s.speed[1], 2)} rad/s`],
    ["chair", `${fixed(x, 2)}, ${fixed(y, 2)} m  ${fixed(heading, 0)}°`],
    ["hand", `${fixed(forward, 2)} ahead, ${fixed(left, 2)} left, ${fixed(up, 2)} up`],
    ["gripper", `${fixed(s.opening_mm, 0)} mm  ${fixed(s.pad_force[0], 1)} / ${fixed(s.pad_force[1], 1)} N`],
    ...(s.arm_problem ? [["arm", s.arm_problem, "bad"]] : []),
  ]);
  const recorders = s.recorders.map((r) => {
    const row = element("li");
    const done = r.state === "finished";
    const bad = r.state === "failed" || r.missed > 0 || (done && !r.complete);
    const style = bad ? "bad" : done || r.state === "ready" ? "good" : "";
    const word = done ? (r.complete ? "complete" : "PARTIAL") : RECORDER_WORDS[r.state] || r.state;
    row.append(`${r.name} `, element("span", word, style),
      element("small", ` ${r.accepted_frames} pictures, ${r.missed} missed ${r.message}`));
    return row;
  });
  if (!recorders.length) recorders.push(element("li", "none: nothing is recorded", "careful"));
  $("recorders").replaceChildren(...recorders);

  for (const name of s.cameras) {
    if (!cameras.has(name)) cameras.set(name, new Camera(name));
  }
  for (const [name, camera] of cameras) {
    if (!s.cameras.includes(name)) camera.figure.remove();
    else if (!camera.figure.isConnected) $("cameras").append(camera.figure);
  }
  $("nothing").hidden = s.cameras.length > 0;
  $("nothing").textContent = s.connection === "open" ? "this server has no cameras" : "waiting for the server …";
  $("cameras").classList.toggle("pair", s.cameras.length > 1);
  const still = s.paused || (s.waiting_for !== "" && s.connection === "open");
  let growth = 0;
  for (const camera of cameras.values()) {
    camera.caption(still);
    growth = Math.max(growth, camera.growth);
  }
  pairs("figures", [
    ["round trip", `${fixed(s.round_trip_ms, 1)} ms`],
    ["pictures", `${growth.toFixed(0)} ms behind`, growth > 400 ? "bad" : ""],
    ["refused", `${s.refused} commands`, s.refused > 0 ? "careful" : ""],
  ]);
  $("events").replaceChildren(...s.events.map((e) => {
    const row = element("li", undefined, e.bad ? "bad" : "");
    row.append(e.text, element("small", `  ${fixed(e.ago, 0)} s ago`));
    return row;
  }));
  alarm(alarms);
}

function alarm(texts) {
  $("alarm").hidden = texts.length === 0;
  $("alarm").textContent = texts.join(" ");
}

function listen() {
  const states = new EventSource("/state");
  states.onmessage = (message) => {
    alive = performance.now();
    state = JSON.parse(message.data);
    show();
  };
  // The browser connects again by itself; a closed one must be opened anew.
  states.onerror = () => {
    if (states.readyState === EventSource.CLOSED) setTimeout(listen, 1000);
  };
}

alive = performance.now();
listen();
setInterval(show, 500);
