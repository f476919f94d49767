// The parts of the page. A question waits at the server until some have changed, or for a second, see board.py.
import { isOpen, on, send } from "./link.js";
import * as scene from "./scene.js";
import { put } from "./store.js";

let have = {};
const also = []; // functions that return the names of parts that are shown beside those that every page shows

// Fetch these parts, too, while they are shown.
export function alsoShows(names) {
  also.push(names);
}

// Ask for what changes; of several questions the server keeps the last one. A hidden page asks once it is shown.
export function ask() {
  if (!isOpen() || document.hidden) return;
  const shown = also.flatMap((names) => names());
  send({ type: "ask", have, seat: scene.seat(), shows: shown });
}

export function begin() {
  // Another server counts from one again.
  on("open", () => {
    have = {};
    ask();
  });
  on("parts", (answer) => {
    for (const [name, { version, content }] of Object.entries(answer.parts)) {
      have[name] = version;
      put(name, content);
    }
    put("camera", answer.camera);
    scene.heardOf(answer.camera !== "");
    ask();
  });
  document.addEventListener("visibilitychange", ask);
}
