// On-screen letters for a text field, for users without a keyboard: with
// scanning, dwelling or a stick.

import { $, button, h } from "./dom.js";

const ROWS = ["abcdef", "ghijkl", "mnopqr", "stuvwx", "yz.,-_", "012345", "6789!?"];

let field = null;
let large = false;

/** Opens the letters for a field. */
export function openLetters(input) {
  field = input;
  draw();
  $("letters").hidden = false;
}

export function closeLetters() {
  field = null;
  $("letters").hidden = true;
}

export const lettersOpen = () => field !== null;

function type(letter) {
  field.value += letter;
  field.dispatchEvent(new Event("input", { bubbles: true }));
  show();
}

function show() {
  const shown = field.type === "password" ? "•".repeat(field.value.length) : field.value;
  $("letters").querySelector("p").textContent = `${field.labels[0]?.textContent || ""}: ${shown}`;
}

function draw() {
  const rows = ROWS.map((row) => {
    const letters = [...row].map((letter) => (large ? letter.toUpperCase() : letter));
    return h("div", { className: "buttons", "data-row": letters.join(" ") },
      ...letters.map((letter) => button(`letter:${letter}`, letter, () => type(letter))));
  });
  const last = h("div", { className: "buttons", "data-row": "Letters" },
    button("letter:done", "Done", closeLetters),
    button("letter:delete", "Delete", () => {
      field.value = field.value.slice(0, -1);
      type("");
    }),
    button("letter:space", "Space", () => type(" ")),
    button("letter:large", large ? "Small letters" : "Large letters", () => {
      large = !large;
      draw();
    }));
  $("letters").replaceChildren(h("p", {}, ""), last, ...rows);
  show();
}
