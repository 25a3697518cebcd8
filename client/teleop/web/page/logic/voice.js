// Voice commands. Pure: words in, action out. A phrase moves
// one step or presses a button; it never starts a motion that lasts.

const PHRASES = {
  "chair forward": { step: "chair.forward" }, "chair back": { step: "chair.back" },
  "chair left": { step: "chair.left" }, "chair right": { step: "chair.right" },
  "hand forward": { step: "hand.forward" }, "hand back": { step: "hand.back" },
  "hand left": { step: "hand.left" }, "hand right": { step: "hand.right" },
  "hand up": { step: "hand.up" }, "hand down": { step: "hand.down" },
  "roll left": { step: "turn.roll_minus" }, "roll right": { step: "turn.roll_plus" },
  "tip up": { step: "turn.pitch_minus" }, "tip down": { step: "turn.pitch_plus" },
  "swing left": { step: "turn.yaw_plus" }, "swing right": { step: "turn.yaw_minus" },
  "open gripper": { step: "grip.open" }, "close gripper": { step: "grip.close" },
  again: { again: true },
  slower: { speed: -1 }, faster: { speed: 1 },
  "go near": { menu: "near" }, "take it": { menu: "take" }, "put here": { menu: "put" }, "turn to it": { menu: "turn" }, cancel: { menu: "cancel" },
  "read aloud": { press: "read" }, "start driving": { press: "start" }, "finish episode": { press: "finish" },
};

/** Frequent recognition errors of words of the grammar. */
const HEARD_AS = {
  forwards: "forward", ahead: "forward", backwards: "back", backward: "back", stopp: "stop", halt: "stop",
  grip: "gripper", grippa: "gripper", write: "right", and: "hand",
};

/** All phrases, for the list on the page. */
export const GRAMMAR = ["stop", ...Object.keys(PHRASES)];

const words = (text) => text.toLowerCase().replace(/[^a-z ]/g, " ").split(/\s+/).filter(Boolean)
  .map((word) => HEARD_AS[word] || word);

/** Whether the words contain STOP; also checked in unfinished results. */
export const saysStop = (text) => words(text).includes("stop");

/**
 * Action of a finished result, or null. The phrase must be the whole result,
 * except for "please" and "the", so that talk in the room moves nothing.
 */
export function understand(text) {
  if (saysStop(text)) return { stop: true };
  const phrase = words(text).filter((word) => !["please", "the", "a"].includes(word)).join(" ");
  return Object.hasOwn(PHRASES, phrase) ? { ...PHRASES[phrase], phrase } : null;
}
