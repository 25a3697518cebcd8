// Elements. External texts are set as text, never as markup.

export const $ = (id) => document.getElementById(id);

/** An element with properties, `data-` and `aria-` attributes, and children. */
export function h(tag, props = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(props)) {
    if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
    else if (name.includes("-") || name === "for" || name === "role") made.setAttribute(name, value);
    else made[name] = value;
  }
  made.append(...children.filter((child) => child !== null && child !== undefined));
  return made;
}

/** A button that scanning, dwelling and voice find by `item`. */
export function button(item, text, onclick, more = {}) {
  return h("button", { type: "button", "data-item": item, onclick, ...more }, text);
}

/** Sets a text only when it changes: live regions speak on every change. */
export function text(element, value) {
  if (element.textContent !== value) element.textContent = value;
}

/** Sets children only when `key` changes, so that focus and frames stay. */
export function children(element, key, make) {
  if (element.made === key) return;
  element.made = key;
  element.replaceChildren(...make());
}

/** Whether an element uses keys itself, so that keys must not drive. */
export function takesKeys(element) {
  return Boolean(element) && element !== document.body && element.id !== "stage" &&
    element.matches("button, input, select, textarea, a[href], summary, [contenteditable]");
}

/** Order of the rows for scanning; rows that are not listed are last. */
const ORDER = ["Alarm", "Letters", "Drawer", "Start", "Again", "Object", "Pads", "Chair", "Hand", "Turn hand", "Gripper", "Voice",
  "Finish", "Speed", "How buttons drive", "Episode", "Control", "Instruction"];
const rank = (row) => {
  const at = ORDER.indexOf(row.dataset.row);
  return at < 0 ? ORDER.length : at;
};

/** Rows of the buttons that can be pressed now, for scanning: [{id, label, items}]. */
export function rowsOf(root) {
  const rows = [];
  const all = [...root.querySelectorAll("[data-row]")];
  for (const row of all.sort((a, b) => rank(a) - rank(b))) {
    if (!row.checkVisibility()) continue;
    const items = [...row.querySelectorAll("button[data-item]")]
      .filter((one) => !one.disabled && one.checkVisibility())
      .map((one) => ({ id: one.dataset.item, label: one.getAttribute("aria-label") || one.textContent }));
    if (items.length > 0) rows.push({ id: `row:${row.dataset.row}`, label: row.dataset.row, items });
  }
  return rows;
}

/** The element of an item or a row. */
export function elementOf(id) {
  const name = id.startsWith("row:") ? `[data-row="${CSS.escape(id.slice(4))}"]` : `[data-item="${CSS.escape(id)}"]`;
  return [...document.querySelectorAll(name)].find((one) => one.checkVisibility()) || null;
}
