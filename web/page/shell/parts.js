// The parts of the page, which are asked for as they change, see board.py.
import { isOpen, on, send } from "./link.js";
import * as scene from "./scene.js";
import { latest, put } from "./store.js";

const MOVING = 100; // [ms] between two questions while the race moves
const REST = 200; // [ms] between two while it stands still
const PATIENCE = 5000; // [ms] after which an answer is no longer waited for
let have = {};
let asked = 0; // when the last question was sent [ms]; 0: it is answered
let next = 0;
const also = []; // functions that return the names of parts that are shown beside those that every page shows

// Fetch these parts, too, while they are shown.
export function alsoShows(names) {
  also.push(names);
}

// Ask for what has changed, and again after a pause.
export function ask() {
  clearTimeout(next);
  if (isOpen() && !document.hidden && Date.now() - asked > PATIENCE) {
    const shown = also.flatMap((names) => names());
    send({ type: "ask", have, seat: scene.seat(), shows: shown });
    asked = Date.now();
  }
  next = setTimeout(ask, latest("now")?.playing ? MOVING : REST);
}

export function begin() {
  // Another server counts from one again.
  on("open", () => {
    [have, asked] = [{}, 0];
    ask();
  });
  on("parts", (answer) => {
    asked = 0;
    for (const [name, { version, content }] of Object.entries(answer.parts)) {
      have[name] = version;
      put(name, content);
    }
    put("camera", answer.camera);
    scene.heardOf(answer.camera !== "");
  });
  ask();
}
