// The scene: viser's page in a frame, of which the canvas alone is seen. The page draws the name of its seat there,
// by which the server knows that both belong to one visitor, see seats.py.
import { on, send } from "./link.js";

const frame = document.getElementById("scene");
const ASKED = ["fixedDpr"]; // what an address may ask of viser
const SEAT = 18; // random bytes of the name of a seat
const KEPT = "seat"; // in this window, from the page's end to its next load
const LOADED = 30000; // [ms] from the document to the scene's own connection, at the first attempt
const LOST = 8000; // [ms] without this connection until the scene is opened again
const loading = document.querySelector(".viewport .loading");
const watching = [];
let name = "";
let since = 0; // when the scene's document had come, or its connection was lost [ms]; 0: neither
let patience = LOADED; // [ms] from then until the scene is opened again
let attempts = 0; // without a connection; each is given twice the time of the one before
let isBegun = false; // whether the scene is opened, or about to be
let wasOpen = false;

export const seat = () => name;

export function begin() {
  frame.addEventListener("load", () => {
    since = name ? Date.now() : 0;
    for (const watch of watching) watch(frame.contentWindow);
  });
  // After an outage viser would try every second, and give up the attempt before: a new seat connects at once.
  on("open", () => {
    // What the visitor watched, and the flight that it began, are kept under the seat before.
    const before = wasOpen ? name : keptSeat();
    if (before) send({ type: "come_back", seat: before });
    if (wasOpen) load();
    wasOpen = true;
  });
  addEventListener("pagehide", () => {
    try {
      sessionStorage.setItem(KEPT, name);
    } catch {
      // a browser that keeps nothing
    }
  });
}

// The seat before this page was loaded again; empty: there was none. A copy of the window does not find it.
function keptSeat() {
  try {
    const kept = sessionStorage.getItem(KEPT) ?? "";
    sessionStorage.removeItem(KEPT);
    return kept;
  } catch {
    return "";
  }
}

// The server says whether the scene has its connection. A document that still comes is waited for. The scene is opened
// once the first answer is drawn, as it keeps the browser busy for half a second and more.
export function heardOf(isConnected) {
  if (!isBegun) requestAnimationFrame(() => requestAnimationFrame(() => name || load()));
  isBegun = true;
  loading.hidden = isConnected;
  if (isConnected) [since, patience, attempts] = [0, LOST, 0];
  else if (!since && patience === LOST) since = Date.now();
  else if (since && Date.now() - since > patience) load();
}

// Open the scene at a new seat.
function load() {
  [since, patience] = [0, LOADED * 2 ** attempts++];
  const given = new URLSearchParams(location.search);
  const asked = new URLSearchParams({ darkMode: "" });
  for (const name of ASKED) if (given.has(name)) asked.set(name, given.get(name));
  const random = crypto.getRandomValues(new Uint8Array(SEAT));
  name = btoa(String.fromCharCode(...random))
    .replaceAll("+", "-")
    .replaceAll("/", "_");
  frame.contentWindow.location.replace(new URL(`scene/${name}?${asked}`, document.baseURI));
}

// Call a function with the window of the frame whenever it has loaded.
export function whenLoaded(watch) {
  watching.push(watch);
}
