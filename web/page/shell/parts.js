// The parts of the page, which are asked for as they change, see board.py.
import { on, send } from "./link.js";
import { seat } from "./scene.js";

const MOVING = 100; // [ms] between two questions while the race moves
const REST = 200; // [ms] between two while it stands still
const PATIENCE = 5000; // [ms] after which an answer is no longer waited for
const shows = {};
let have = {};
let asked = 0; // when the last question was sent [ms]; 0: it is answered
let moves = false;
// the part that the open tab shows; null: it shows none
export const tab = { part: null };

// Call a function with each new content of a part.
export function show(name, shown) {
  (shows[name] ??= []).push(shown);
}

function ask() {
  if (!document.hidden && Date.now() - asked > PATIENCE) {
    asked = send({ type: "ask", have, seat: seat(), tab: tab.part }) ? Date.now() : 0;
  }
  setTimeout(ask, moves ? MOVING : REST);
}

export function begin() {
  // Another server counts from one again.
  on("open", () => ([have, asked] = [{}, 0]));
  on("parts", (answer) => {
    asked = 0;
    for (const [name, { version, content }] of Object.entries(answer.parts)) {
      have[name] = version;
      if (name === "now") moves = content.playing;
      for (const shown of shows[name] ?? []) shown(content);
    }
    for (const shown of shows.camera ?? []) shown(answer.camera);
  });
  ask();
}
