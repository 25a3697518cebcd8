// Panels of the newest situation: chips, episode, control, robot, messages.

import { loopAge } from "../logic/rights.js";
import { $, button, children, h, text } from "./dom.js";
import { openLetters } from "./letters.js";
import { alarm } from "./sound.js";

const RECORDER_WORDS = {
  idle: "ready", ready: "recording", finishing: "writing the file", finished: "file finished", failed: "FAILED",
};
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
  }

  /** Updates everything from a situation. */
  show(s, now) {
    const mine = Boolean(s.lease?.mine);
    const asks = this.app.confirmation.asks(now);
    this.alarms(s);
    this.chips(s, mine);
    text($("instruction"), s.episode?.instruction || s.scenario?.instruction || "");
    this.episode(s, mine, asks);
    this.setup(s, mine, asks);
    this.control(s, mine, asks);
    this.goal(s);
    this.robot(s);
  }

  /** An alarm stays until the person acknowledges it, or it is over. */
  alarms(s) {
    const { read, settings, role } = this.app;
    // A viewer cannot act on alarms.
    const all = role === "viewer" ? [] : s.alarms || [];
    for (const words of read) if (!all.includes(words)) read.delete(words);
    const list = all.filter((words) => !read.has(words));
    const fresh = list.some((words) => !this.alarmed.includes(words));
    this.alarmed = list;
    if (fresh && settings.sound) alarm();
    children($("alarms"), JSON.stringify(list), () => list.map((words, index) => h("div", {}, h("p", {}, words),
      button(`alarm:${index}`, "I have read this", () => {
        read.add(words);
        this.app.refresh();
      }))));
  }

  chips(s, mine) {
    const age = loopAge(s.control);
    const recorder = this.recorderWords(s);
    const list = [
      ["Connection", s.link === "open" ? "connected" : `robot: ${s.link || "unknown"}`, s.link === "open" ? "good" : "bad"],
      ["Loop age", `loop ${age.text}`, age.state],
      ["Control", mine ? "you drive" : s.lease?.holder ? `${s.lease.holder} drives` : "control is free", mine ? "good" : "careful"],
      ["Episode", !s.episode ? "no episode" : s.evaluation?.failure ? `episode ${s.episode.number}: TASK LOST`
        : `episode ${s.episode.number}  ${fixed(s.episode.seconds, 0)} s`, !s.episode ? "" : s.evaluation?.failure ? "bad" : "good"],
      ["Recorder", ...recorder],
      ["Time", s.paused ? "paused" : `${fixed(s.factor, 2)}× time`, s.paused || s.factor < 0.8 ? "careful" : ""],
    ];
    const usual = (name, state) => (name === "Connection" && state === "good") || (name === "Time" && state === "");
    children($("chips"), JSON.stringify(list), () => list.map(([name, words, state]) =>
      h("li", { className: `${state} ${usual(name, state) ? "usual" : ""}` }, words)));
    $("chips").hidden = false;
  }

  recorderWords(s) {
    const recorders = s.recorders || [];
    const missed = recorders.reduce((total, one) => total + (one.missed || 0), 0);
    const ready = recorders.filter((one) => one.state === "ready").length;
    if (s.episode?.practice) return ["practice: nothing is kept", "careful"];
    if (recorders.some((one) => one.state === "failed")) return ["recorder FAILED", "bad"];
    if (recorders.some((one) => one.silent_s)) return ["a recorder DOES NOT ANSWER", "bad"];
    if (missed > 0) return [`${missed} samples missed`, "bad"];
    if (s.episode && ready > 0) return [`● recording × ${ready}`, "good"];
    if (s.episode) return ["NOT RECORDED", "bad"];
    if (recorders.length === 0) return ["no recorder", "careful"];
    return [recorders.length === 1 ? "1 recorder" : `${recorders.length} recorders`, ""];
  }

  episode(s, mine, asks) {
    const { app } = this;
    const runs = Boolean(s.episode);
    const lost = runs && !s.evaluation?.success && s.evaluation?.failure;
    const result = s.evaluation?.success ? "Success" : lost ? `THE TASK IS LOST: ${s.evaluation.failure.replaceAll("_", " ")}.` : "";
    $("episode_text").className = lost ? "bad" : "";
    text($("episode_text"), s.busy ? `Please wait: ${s.busy} …`
      : s.waiting_for ? `The simulation waits for ${s.waiting_for}.`
        : runs ? `${s.episode.label}, ${fixed(s.episode.seconds, 0)} s. ${result}` : "No episode runs.");
    const again = (what, words) => (asks === what ? `${words}: press again` : words);
    const practice = Boolean(s.episode?.practice);
    const key = JSON.stringify([runs, mine, asks, Boolean(s.busy), s.paused, practice, lost]);
    children($("episode_buttons"), key, () => {
      const off = { disabled: !mine || Boolean(s.busy) };
      const made = runs ? [
        button("finish", practice ? "Finish practice" : lost ? "Finish, keep as failed" : "Finish and keep", () => app.episode("finish"), { ...off, className: "first" }),
        button("discard", again("discard", "Discard"), () => app.confirm("discard", () => app.episode("discard")),
          { ...off, className: asks === "discard" ? "asks" : "" }),
        button("redo", again("redo", "Redo"), () => app.confirm("redo", () => app.episode("redo")),
          { ...off, className: asks === "redo" ? "asks" : "" }),
      ] : [button("start", "Start episode", () => app.episode("start"), { ...off, className: "first" }),
        button("practise", "Practise, keep nothing", () => app.episode("practise"), off)];
      made.push(s.paused ? button("resume", "Resume time", () => app.ask("time.resume"), off)
        : button("pause", "Pause time", () => app.ask("time.pause"), off));
      return made;
    });
    text($("recorders_text"), (s.recorders || []).map((one) =>
      `${one.name}: ${one.state === "finished" && !one.complete ? "file NOT complete" : RECORDER_WORDS[one.state] || one.state}` +
      `${one.silent_s ? ", DOES NOT ANSWER" : ""}, ${one.frames ?? 0} images${one.missed ? `, ${one.missed} missed` : ""}${one.message ? `. ${one.message}` : ""}`)
      .join("; ") || "No recorder is connected: an episode cannot start, practice can.");
    $("recorders_text").className = (s.recorders || []).some((one) => one.state === "failed" || one.missed || one.silent_s) ? "bad" : "quiet";
    const conditions = s.evaluation?.conditions || [];
    children($("conditions"), JSON.stringify(conditions.map((one) => [one.name, one.holds])), () =>
      conditions.map((one) => h("li", { className: one.holds ? "good" : "" }, `${one.name}: ${one.holds ? "yes" : "no"}`)));
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
      mine ? "You are in control." : lease.holder ? `${lease.holder} is in control.` : "Control is free.",
      requests.length > 0 ? `${requests.join(", ")} asks for it.` : "",
    ].join(" "));
    const key = JSON.stringify([mine, lease.holder, requests, asks, app.role]);
    children($("control_buttons"), key, () => {
      if (app.role === "viewer") return [h("p", { className: "quiet" }, "This name watches only.")];
      if (mine) {
        return [button("give", "Give control back", () => app.ask("lease.give")),
          ...requests.map((name) => button(`give:${name}`, `Give control to ${name}`, () => app.ask("lease.give", { to: name })))];
      }
      const ask = button("ask", "Ask for control", () => app.ask("lease.ask"), { className: "first" });
      if (!lease.holder) return [ask];
      return [ask, button("take", asks === "take" ? `Take it from ${lease.holder}: press again` : "Take control",
        () => app.confirm("take", () => app.ask("lease.take")), { className: asks === "take" ? "asks" : "" })];
    });
    children($("people"), JSON.stringify(people), () => people.map((one) => h("li", {},
      `${one.name} ${one.control ? "drives" : one.role === "viewer" ? "watches" : "may drive"}`)));
  }

  goal(s) {
    const { app } = this;
    const { goal } = s;
    const menu = app.candidates;
    const key = JSON.stringify([goal?.id, menu, app.stage.picking, app.driver.lock]);
    children($("goal_buttons"), key, () => {
      if (goal) return [button("goal:cancel", "Cancel", () => app.cancelGoal())];
      if (menu) return this.menu(menu);
      return [button("pick", app.stage.picking ? "Choose in the image: now" : "Choose in the image",
        () => app.choosing(!app.stage.picking),
        { "aria-pressed": String(app.stage.picking), disabled: Boolean(app.driver.lock) })];
    });
    text($("goal_text"), goal ? `${goal.name}: ${goal.text || goal.stage} (${goal.at ?? 0} of ${goal.of ?? 0})`
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
