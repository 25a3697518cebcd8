// Speech recognition by the browser, while its button shows it. Off until the
// person turns it on: many browsers send the audio to a company's computers.

import { saysStop, understand } from "../logic/voice.js";

/** It stops listening after this long without a phrase, ms. */
const LISTEN_MS = 8000;

export class Voice {
  /** `received(meaning, text)` for a phrase, `stop()` as soon as STOP is recognized, `changed()`. */
  constructor(handlers) {
    this.handlers = handlers;
    this.recognition = null;
    this.listening = false;
  }

  static get possible() {
    return "SpeechRecognition" in window || "webkitSpeechRecognition" in window;
  }

  toggle(local) {
    if (this.listening) this.end();
    else this.begin(local);
  }

  begin(local) {
    if (!Voice.possible || this.listening) return;
    const Recognition = window.SpeechRecognition || window.webkitSpeechRecognition;
    const recognition = new Recognition();
    this.recognition = recognition;
    recognition.lang = "en-US";
    recognition.continuous = true;
    recognition.interimResults = true;
    // Recognition on this computer, where the browser supports it.
    if (local && "processLocally" in recognition) recognition.processLocally = true;
    let stopped = -1;
    recognition.onresult = (event) => {
      for (let index = event.resultIndex; index < event.results.length; index += 1) {
        const result = event.results[index];
        const words = result[0].transcript;
        if (saysStop(words)) {
          // STOP also in unfinished results, once for each result.
          if (stopped !== index) this.handlers.stop();
          stopped = index;
        } else if (result.isFinal) {
          this.handlers.received(understand(words), words);
          this.wait();
        }
      }
    };
    recognition.onend = () => this.ended(recognition);
    recognition.onerror = ({ error }) => {
      this.handlers.failed(error);
      this.ended(recognition);
    };
    recognition.start();
    this.listening = true;
    this.wait();
    this.handlers.changed();
  }

  wait() {
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.end(), LISTEN_MS);
  }

  end() {
    this.recognition?.stop();
    this.ended(this.recognition);
  }

  ended(recognition) {
    if (recognition !== this.recognition) return;
    clearTimeout(this.timer);
    this.recognition = null;
    this.listening = false;
    this.handlers.changed();
  }
}
