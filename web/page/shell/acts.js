// What buttons and keys do. Keys act in the page and in the frame of the scene, but not in a box that is typed into.
import { make } from "./dom.js";
import * as drawer from "./drawer.js";
import * as head from "./head.js";
import * as keys from "./keys.js";
import { send } from "./link.js";
import * as notes from "./notes.js";
import * as runs from "./runs.js";
import * as scene from "./scene.js";
import { latest, show } from "./store.js";

// While a race is on the scene has all the room; the settings can be opened again.
function start() {
  const box = document.querySelector(".seeds .count");
  const asked = Math.round(Number(box.value)) || 1;
  box.value = Math.min(Math.max(asked, Number(box.min)), Number(box.max));
  document.activeElement.blur(); // a number that stands in a box counts first
  if (!send({ type: "start", seeds: Number(box.value) })) return;
  // The server tells why a line-up cannot be flown, where it is set up.
  if (latest("next")?.problem) return;
  head.starting();
  drawer.open(false);
}

const ACTS = {
  start,
  stop: () => send({ type: "stop" }),
  restart: () => send({ type: "restart" }),
  play: () => send({ type: "play", on: !latest("now")?.playing }),
  back: () => send({ type: "step", steps: -1 }),
  on: () => send({ type: "step", steps: 1 }),
  next: () => send({ type: "next_event" }),
  live: () => send({ type: "live" }),
  follow: () => send({ type: "follow_next", seat: scene.seat() }),
  settings: () => drawer.open(!drawer.isOpen()),
  runs: () => runs.open(),
  present,
  help,
};

// key, what it does, and how
const KEYS = [
  [" ", "pause, continue", () => send({ type: "play" })],
  ["n", "one step", ACTS.on],
  ["b", "one step back", ACTS.back],
  ["s", "start", start],
  ["x", "stop", ACTS.stop],
  ["r", "restart", ACTS.restart],
  ["e", "next event", ACTS.next],
  ["l", "live: watch the flight as it is at this moment", ACTS.live],
  ["c", "camera: free, chase, top, FPV", () => send({ type: "camera", seat: scene.seat() })],
  ["f", "follow the next competitor, or the leader", ACTS.follow],
  ["t", "table of runs, and campaigns", ACTS.runs],
  ["d", "settings: open, close", ACTS.settings],
  ["p", "present: large letters, no settings", present],
  ["h", "help: these keys", help],
];
const HELP =
  "Sliders act at the next plan. A flight whose numbers were changed in flight is marked interactive and cannot be " +
  "compared with others.";

function present() {
  const on = document.body.classList.toggle("present");
  document.querySelector('[data-act="present"]').ariaPressed = String(on);
  if (on) drawer.open(false);
  dispatchEvent(new Event("resize"));
}

function help() {
  const name = (key) => (key === " " ? "space" : key.toUpperCase());
  const rows = KEYS.map(([key, what]) =>
    make("tr", {}, make("td", {}, make("kbd", { textContent: name(key) })), make("td", { textContent: what })),
  );
  notes.openWindow(
    "Keys",
    [make("table", {}, ...rows), make("p", { className: "note", textContent: HELP })],
    [["Close", null]],
  );
}

const TYPING = "input:not([type=checkbox]):not([type=radio]), textarea, select, [contenteditable=true]";
const PRESSED = "button, summary, [role=button], [role=tab], [role=option], [type=checkbox]";

function key(event) {
  if (event.ctrlKey || event.altKey || event.metaKey || event.repeat || event.defaultPrevented) return;
  const { target } = event;
  if (target.closest?.(TYPING)) return;
  // The space bar presses the button that has the focus.
  if (event.key === " " && target.closest?.(PRESSED)) return;
  const found = KEYS.find(([name]) => name === event.key.toLowerCase());
  if (!found) return;
  event.preventDefault();
  found[2]();
}

export function begin() {
  document.body.addEventListener("click", (event) => {
    const pressed = event.target.closest("[data-act], [data-camera]");
    if (pressed?.dataset.act) ACTS[pressed.dataset.act]();
    if (pressed?.dataset.camera) send({ type: "camera", seat: scene.seat(), mode: pressed.dataset.camera });
    // Clicked with the mouse, a button keeps no focus: the space bar would press it again instead of pausing.
    if (event.detail > 0) event.target.closest("button, summary")?.blur();
  });
  keys.setPage(key);
  keys.listen(window);
  scene.whenLoaded(keys.listen);
  // A scene that is opened again, as after an outage, has the camera that was chosen before.
  let chosen = "";
  let isLost = false;
  show("camera", (mode) => {
    if (mode && isLost && chosen && mode !== chosen) send({ type: "camera", seat: scene.seat(), mode: chosen });
    else if (mode) chosen = mode;
    isLost = !mode;
    for (const button of document.querySelectorAll("[data-camera]"))
      button.ariaPressed = String(button.dataset.camera === mode);
  });
}
