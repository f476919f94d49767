// While the server is away: what it is needed for is disabled, and what is not sent is told. After another start of the
// server, the set-up that this window had is offered again.
import { make } from "./dom.js";
import { on, send } from "./link.js";
import * as notes from "./notes.js";
import { offered } from "./set_up.js";
import { show } from "./store.js";

const NEED_SERVER = [
  ".commands :is(.seeds, [data-act=start], [data-act=stop])",
  ".drawer",
  ".cameras",
  ".playback > :not(.notes)",
  ".line",
].join(", ");
const KEPT = "set-up"; // of this window, over a reload and over a restart of the server
const SET_UP_BEFORE = "START had other competitors or settings before, which this window has kept.";

function set(isAway) {
  document.body.classList.toggle("away", isAway);
  for (const element of document.querySelectorAll(NEED_SERVER)) element.inert = isAway;
}

function offer(line_up) {
  const text = make("p", { textContent: SET_UP_BEFORE });
  const setUp = () => send({ type: "set_up", line_up });
  notes.openWindow(
    "The server has started again",
    [text],
    [
      ["Set it up again", setUp, "main"],
      ["Leave it", null],
    ],
  );
}

export function begin() {
  for (const type of ["open", "heard"]) on(type, () => set(false));
  for (const type of ["close", "silent"]) on(type, () => set(true));
  on("unsent", () => notes.note("error", "Not sent", "the server is away"));
  show("next", (next) => {
    try {
      const { keep, offers } = offered(JSON.parse(sessionStorage.getItem(KEPT)), next);
      sessionStorage.setItem(KEPT, JSON.stringify(keep));
      if (offers) offer(offers);
    } catch {
      // a browser that keeps nothing
    }
  });
}
