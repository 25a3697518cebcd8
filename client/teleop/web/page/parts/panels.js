// Panels of the newest situation: chips, episode, control, robot, messages.

import { loopAge } from "../logic/rights.js";
import { clock, condition, recording, said, unrecorded } from "../logic/words.js";
import { $, button, children, h, text } from "./dom.js";
import { openLetters } from "./letters.js";
import { alarm } from "./sound.js";

const RECORDER_WORDS = {
  idle: "ready", ready: "recording", finishing: "writing the file", finished: "file finished", failed: "FAILED",
};
/** An episode without a recorder is an alarm after this, ms: a recorder may appear. */
const UNRECORDED_MS = 3000;
const UNRECORDED = "NOTHING IS RECORDED: no recorder has this episode";
const fixed = (value, digits) =>
  (value === null || value === undefined ? "–" : value.toFixed(digits).replace(/^-(0(\.0*)?)$/, "$1"));

/** A line of the list of messages; the newest is first. */
export function message(words, bad) {
  const list = $("messages");
  const clock = new Date().toTimeString().slice(0, 8);
  list.prepend(h("li", { className: bad ? "bad" : "" }, words, h("small", { className: "quiet" }, `  ${clock}`)));
  while (list.children.length > 30) list.lastChild.remove();
}

export class Panels {
  constructor(app) {
    this.app = app;
    this.task = null;
    this.seed = null;
    this.tasks = [];
    this.alarmed = [];
    this.unrecordedSince = null;
  }

  /** Whether an alarm waits to be read; driving waits for it. */
  get blocks() {
    return this.alarmed.length > 0;
  }

  /** Updates everything from a situation. */
  show(s, now) {
    const mine = Boolean(s.lease?.mine);
    const asks = this.app.confirmation.asks(now);
    document.body.classList.toggle("mine", mine);
    this.alarms(s, mine, now);
    this.chips(s, mine);
    text($("instruction"), s.episode?.instruction || s.scenario?.instruction || "");
    this.aims(s);
    this.main(s, mine, asks);
    this.episode(s, mine, asks);
    this.setup(s, mine, asks);
    this.control(s, mine, asks);
    this.goal(s);
    this.robot(s);
  }

  /** An alarm covers the buttons until the person acknowledges it, or it is over. */
  alarms(s, mine, now) {
    const { app } = this;
    const { read, settings, role } = app;
    // A viewer cannot act on alarms.
    const all = role === "viewer" ? [] : [...(s.alarms || [])];
    if (!mine || !unrecorded(s)) this.unrecordedSince = null;
    else this.unrecordedSince ??= now;
    const lacks = this.unrecordedSince !== null && now - this.unrecordedSince > UNRECORDED_MS;
    if (lacks && !all.some((words) => words.includes("NOTHING IS RECORDED"))) all.push(UNRECORDED);
    for (const words of read) if (!all.includes(words)) read.delete(words);
    const list = all.filter((words) => !read.has(words));
    const fresh = list.some((words) => !this.alarmed.includes(words));
    this.alarmed = list;
    document.body.classList.toggle("alarmed", this.blocks);
    if (fresh && settings.sound) alarm();
    const mayPractise = mine && !s.episode && !s.busy;
    const lost = mine && unrecorded(s);
    children($("alarms"), JSON.stringify([list, mayPractise, lost]), () => [
      ...list.map((words, index) => h("div", {}, h("p", {}, words),
        button(`alarm:${index}`, "I have read this", () => {
          read.add(words);
          app.refresh();
        }))),
      ...(list.length > 0 && mayPractise ? [button("alarm:practise", "Practise, keep nothing", () => {
        for (const words of list) read.add(words);
        app.episode("practise");
      })] : []),
      ...(list.length > 0 && lost ? [button("alarm:finish", "End this episode", () => app.episode("finish"))] : []),
    ]);
  }

  chips(s, mine) {
    const age = loopAge(s.control);
    const now = recording(s);
    const lost = s.episode && s.evaluation?.failure;
    const list = [
      [mine ? "You drive" : s.lease?.holder ? `${s.lease.holder} drives` : "No operator is in control", mine ? "good" : ""],
      [now.text, now.state],
      ...(lost ? [[`Episode ${s.episode.number}: TASK LOST`, "bad"]] : []),
      ...(s.link !== "open" ? [[`Robot: ${s.link || "unknown"}`, "bad"]] : []),
      ...(mine && ["careful", "bad"].includes(age.state) ? [[`Image ${age.text}`, age.state]] : []),
      ...(s.paused ? [["Time is paused", "careful"]] : s.factor < 0.8 ? [[`${fixed(s.factor, 2)}× time`, "careful"]] : []),
    ];
    children($("chips"), JSON.stringify(list), () => list.map(([words, state]) => h("li", { className: state }, words)));
    $("chips").hidden = false;
  }

  /** Beside the instruction: what is still to do, and broken rules. */
  aims(s) {
    const list = (s.evaluation?.conditions || []).map(condition).filter(({ aim, holds }) => aim || (s.episode && !holds));
    children($("aims"), JSON.stringify(list), () => list.map((one) =>
      h("li", { className: one.holds ? "good" : one.aim ? "" : "careful" }, said(one))));
  }

  /** The one large button: what is next. */
  main(s, mine, asks) {
    const { app } = this;
    const { holder } = s.lease || {};
    const runs = Boolean(s.episode);
    const lost = runs && !s.evaluation?.success && s.evaluation?.failure;
    const practice = Boolean(s.episode?.practice);
    // While an episode runs this is the last row of a round, before it the first.
    $("main").dataset.row = runs ? "Finish" : "Start";
    const key = JSON.stringify([mine, holder, runs, Boolean(s.busy), practice, lost, asks === "take", app.role]);
    children($("main"), key, () => {
      const first = { className: "first", disabled: Boolean(s.busy) || app.role === "viewer" };
      if (app.role !== "viewer" && holder && !mine) {
        return [button("ask", `Ask ${holder} for control`, () => app.ask("lease.ask"), { className: "first" }),
          button("take", asks === "take" ? `Take it from ${holder}: press again` : "Take control",
            () => app.confirm("take", () => app.ask("lease.take")), { className: asks === "take" ? "asks" : "" })];
      }
      if (runs && mine) {
        return [button("finish", practice ? "Finish practice" : lost ? "Finish, keep as failed" : "Finish and keep",
          () => app.episode("finish"), first)];
      }
      if (runs) return [button("ask", "Drive this episode", () => app.ask("lease.ask"), first)];
      return [button("start", "Start driving", () => app.episode("start"), first)];
    });
  }

  episode(s, mine, asks) {
    const { app } = this;
    const runs = Boolean(s.episode);
    const lost = runs && !s.evaluation?.success && s.evaluation?.failure;
    const result = s.evaluation?.success ? "Success" : lost ? `THE TASK IS LOST: ${s.evaluation.failure.replaceAll("_", " ")}.` : "";
    $("episode_text").className = lost ? "bad" : "";
    text($("episode_text"), s.busy ? `Please wait: ${s.busy} …`
      : s.waiting_for ? `The simulation waits for ${s.waiting_for}.`
        : runs ? `${s.episode.label}, ${clock(s.episode.seconds)}. ${result}` : "No episode runs.");
    const again = (what, words) => (asks === what ? `${words}: press again` : words);
    const key = JSON.stringify([runs, mine, s.lease?.holder, asks, Boolean(s.busy), s.paused]);
    children($("episode_buttons"), key, () => {
      const off = { disabled: !mine || Boolean(s.busy) };
      const made = runs ? [
        button("discard", again("discard", "Discard"), () => app.confirm("discard", () => app.episode("discard")),
          { ...off, className: asks === "discard" ? "asks" : "" }),
        button("redo", again("redo", "Redo"), () => app.confirm("redo", () => app.episode("redo")),
          { ...off, className: asks === "redo" ? "asks" : "" }),
      ] : [button("practise", "Practise, keep nothing", () => app.episode("practise"),
        { disabled: Boolean(s.busy) || app.role === "viewer" || Boolean(s.lease?.holder && !mine) })];
      made.push(s.paused ? button("resume", "Resume time", () => app.ask("time.resume"), off)
        : button("pause", "Pause time", () => app.ask("time.pause"), off));
      return made;
    });
    text($("recorders_text"), (s.recorders || []).map((one) =>
      `${one.name}: ${one.state === "finished" && !one.complete ? "file NOT complete" : RECORDER_WORDS[one.state] || one.state}` +
      `${one.silent_s ? ", DOES NOT ANSWER" : ""}, ${one.frames ?? 0} images${one.missed ? `, ${one.missed} missed` : ""}${one.message ? `. ${one.message}` : ""}`)
      .join("; ") || "No recorder is connected: practice only.");
    $("recorders_text").className = (s.recorders || []).some((one) => one.state === "failed" || one.missed || one.silent_s) ? "bad" : "quiet";
    const conditions = (s.evaluation?.conditions || []).map(condition);
    children($("conditions"), JSON.stringify(conditions), () =>
      conditions.map((one) => h("li", { className: one.holds ? "good" : "" }, said(one))));
  }

  setup(s, mine, asks) {
    const { app } = this;
    this.task ??= s.scenario?.task ?? null;
    this.seed ??= s.scenario?.seed ?? null;
    const label = s.scenario ? `${s.scenario.task || "episode"}-seed${s.scenario.seed}-` : "";
    $("label").placeholder = label ? `${label}…` : "";
    $("sentence").placeholder = s.scenario?.instruction || "";
    text($("setup_text"), `Now: ${s.scenario?.task || "no task"}, seed ${s.scenario?.seed ?? "–"}.`);
    const runs = Boolean(s.episode);
    const key = JSON.stringify([mine, runs, asks, Boolean(s.busy), this.task, this.seed, this.tasks.length, app.letters()]);
    children($("setup_buttons"), key, () => {
      const off = { disabled: !mine || runs || Boolean(s.busy) };
      const at = this.tasks.findIndex((one) => one.name === this.task);
      const other = (by) => () => {
        this.task = this.tasks[(at + by + this.tasks.length) % this.tasks.length].name;
        app.refresh();
      };
      const seed = (by) => () => {
        this.seed = Math.max(0, (this.seed || 0) + by);
        app.refresh();
      };
      const none = { disabled: off.disabled || this.tasks.length === 0 };
      return [
        h("span", { className: "pair" },
          button("task:less", "◀", other(-1), { ...none, "aria-label": "Task before" }),
          h("output", {}, this.task || "–"),
          button("task:more", "▶", other(1), { ...none, "aria-label": "Next task" })),
        h("span", { className: "pair" },
          button("seed:less", "−", seed(-1), { ...off, "aria-label": "Seed less" }),
          h("output", {}, `seed ${this.seed ?? "–"}`),
          button("seed:more", "+", seed(1), { ...off, "aria-label": "Seed more" })),
        button("reset", asks === "reset" ? "Set up: press again" : "Set up the scene",
          () => app.confirm("reset", () => app.ask("scene.reset", { task: this.task, seed: this.seed })),
          { ...off, className: asks === "reset" ? "asks" : "" }),
        ...(app.letters() ? [
          button("write:label", "Write the label", () => openLetters($("label")), off),
          button("write:sentence", "Write the instruction", () => openLetters($("sentence")), off),
        ] : []),
      ];
    });
  }

  control(s, mine, asks) {
    const { app } = this;
    const { lease = {}, people = [] } = s;
    const requests = lease.requests || [];
    text($("control_text"), [
      mine ? "You are in control." : lease.holder ? `${lease.holder} is in control.` : "No operator is in control: the first press takes it.",
      requests.length > 0 ? `${requests.join(", ")} asks for it.` : "",
    ].join(" "));
    const key = JSON.stringify([mine, lease.holder, requests, asks, app.role]);
    children($("control_buttons"), key, () => {
      if (app.role === "viewer") return [h("p", { className: "quiet" }, "You watch: this name may not drive.")];
      if (!mine) return [];
      return [button("give", "Give control back", () => app.ask("lease.give")),
        ...requests.map((name) => button(`give:${name}`, `Give control to ${name}`, () => app.ask("lease.give", { to: name })))];
    });
    children($("people"), JSON.stringify(people), () => people.map((one) => h("li", {},
      `${one.name} ${one.control ? "drives" : one.role === "viewer" ? "watches" : "may drive"}`)));
  }

  goal(s) {
    const { app } = this;
    const { goal } = s;
    const menu = app.candidates;
    const task = Boolean(s.scenario?.task);
    const key = JSON.stringify([goal?.id, menu, app.stage.picking, task, app.role]);
    children($("goal_buttons"), key, () => {
      if (app.role === "viewer") return [];
      if (goal) return [button("goal:cancel", "Cancel", () => app.cancelGoal())];
      if (menu) return this.menu(menu);
      // Never disabled: the rows of scanning stay, and a press says why it does nothing.
      return [button("pick", app.stage.picking ? "Choose in the image: now" : "Choose in the image",
        () => app.choosing(!app.stage.picking), { "aria-pressed": String(app.stage.picking) }),
      ...(task && !app.stage.picking ? [button("goal:turn", "Turn to the object", () => app.startGoal("task", "turn"))] : [])];
    });
    text($("goal_text"), goal ? `${goal.name}: ${goal.text || goal.stage} (${goal.at ?? 0} of ${goal.of ?? 0}). Any press stops it.`
      : menu ? this.words(menu)
        : app.stage.picking ? "Click an object in an image, or a place to put the object down." : "");
  }

  menu({ list, chosen }) {
    const { app } = this;
    const one = list[chosen];
    const words = { near: "Go near", take: "Take", put: "Put here" };
    return [
      ...(one?.actions || []).map((action) => button(`goal:${action}`, words[action] || action,
        () => app.startGoal(one.candidate, action), { className: "first" })),
      ...(list.length > 1 ? [button("goal:other", "Another object", () => app.otherCandidate())] : []),
      button("goal:none", "Cancel", () => app.closeMenu()),
    ];
  }

  words({ list, chosen, note }) {
    const one = list[chosen];
    if (!one) return note || "Nothing is there that the hand can reach.";
    return `${one.name}${one.note ? `, ${one.note}` : ""}`;
  }

  robot(s) {
    const robot = s.robot || {};
    const [ahead, left, up] = robot.hand || [];
    const rows = [
      ["Images", `${loopAge(s.control).text} old`],
      ["Time", s.paused ? "paused" : `${fixed(s.factor, 2)}× real time`],
      ["Speed", `${fixed(robot.speed?.[0], 2)} m/s, ${fixed(robot.speed?.[1], 2)} rad/s`],
      ["Hand", `${fixed(ahead, 2)} m ahead, ${fixed(left, 2)} left, ${fixed(up, 2)} up`],
      ["Gripper", `${fixed(robot.opening_mm, 0)} mm, ${(robot.pad_force || []).map((n) => `${fixed(n, 1)} N`).join(" / ") || "–"}`],
      ["Touches", (s.contacts || []).join("; ") || "nothing"],
      ...(robot.problem ? [["Arm", robot.problem]] : []),
    ];
    children($("robot_list"), JSON.stringify(rows), () =>
      rows.flatMap(([name, value]) => [h("dt", {}, name), h("dd", {}, value)]));
  }
}
