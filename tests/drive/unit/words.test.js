import assert from "node:assert/strict";
import { readdirSync, readFileSync } from "node:fs";
import { test } from "node:test";

import { PREDICATES, clock, condition, recording, said, size, unrecorded } from "../../../client/teleop/web/page/logic/words.js";

test("every predicate of the tasks has words", () => {
  const folder = new URL("../../../server/src/tasks/predicates/", import.meta.url);
  const text = readFileSync(new URL("mod.rs", folder), "utf8");
  const [, inside] = /enum AnyPredicate \{([^}]*)\}/.exec(text);
  const names = [...inside.matchAll(/^ {4}([A-Z][A-Za-z]+)\(/gm)].map(([, name]) =>
    name.replace(/(?!^)[A-Z]/g, (letter) => `_${letter}`).toLowerCase());
  assert.ok(names.length > 10 && readdirSync(folder).length > 3);
  assert.deepEqual([...PREDICATES].sort(), names.sort());
});

test("conditions are said in plain words", () => {
  const words = (name, holds) => said(condition({ name, holds }));
  assert.equal(words("lifted_and_held(mustard_bottle)", false), "mustard bottle in the hand: not yet");
  assert.equal(words("inside(knife, placemat)", true), "knife on the placemat: yes");
  assert.equal(words("clear_of_person", false), "nothing presses the person: NO");
  assert.equal(words("constructor", false), "constructor: NO");
  assert.equal(condition({ name: "chair_stopped", holds: false }).aim, false);
});

const episode = (more = {}) => ({ episode: { seconds: 62.4, ...more }, recorders: [{ state: "ready", frames: 1240 }] });

test("the recording is shown with its time and size", () => {
  assert.deepEqual(recording({ ...episode(), recorded_bytes: 12_400_000 }), { text: "● Recording 1:02, 12 MB", state: "good" });
  assert.equal(recording(episode()).text, "● Recording 1:02, 1240 images");
  assert.equal(recording({ ...episode(), recorders: [] }).state, "bad");
  assert.equal(recording({ ...episode(), recorders: [{ state: "failed" }] }).state, "bad");
  assert.equal(recording({ ...episode(), recorders: [{ state: "ready", silent_s: 4 }] }).state, "bad");
  assert.equal(recording({ ...episode({ practice: true }), recorders: [] }).state, "careful");
  assert.deepEqual(recording({ episode: null, recorders: [{ state: "idle" }] }), { text: "Not recording", state: "" });
  assert.equal(clock(3.9), "0:03");
  assert.deepEqual([size(12_000), size(2.34e9)], ["12 kB", "2.3 GB"]);
});

test("an episode without a recorder is unrecorded, practice is not", () => {
  assert.equal(unrecorded({ ...episode(), recorders: [] }), true);
  assert.equal(unrecorded({ ...episode(), recorders: [{ state: "failed" }] }), true);
  assert.equal(unrecorded(episode()), false);
  assert.equal(unrecorded({ ...episode({ practice: true }), recorders: [] }), false);
  assert.equal(unrecorded({ episode: null, recorders: [] }), false);
  assert.equal(unrecorded({ ...episode(), recorders: null }), false, "not known yet");
});
