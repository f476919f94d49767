// The scene: viser's page in a frame, of which the canvas alone is seen. The page draws the name of its seat there,
// by which the server knows that both belong to one visitor, see seats.py.
import { on, send } from "./link.js";

const frame = document.getElementById("scene");
const ASKED = ["fixedDpr"]; // what an address may ask of viser
const SEAT = 18; // random bytes of the name of a seat
const watching = [];
let name = "";
let isLoaded = false; // whether the page has loaded, before which the scene does not begin to
let wasOpen = false;

export const seat = () => name;

export function begin() {
  frame.addEventListener("load", () => {
    for (const watch of watching) watch(frame.contentWindow);
  });
  // The page is drawn before the scene, which is twenty times as large.
  const loaded = () => {
    isLoaded = true;
    load();
  };
  if (document.readyState === "complete") loaded();
  else addEventListener("load", loaded, { once: true });
  // After an outage viser would try every second, and give up the attempt before: a new seat connects at once.
  on("open", () => {
    // What the visitor watched is kept under the seat before.
    if (wasOpen) send({ type: "come_back", seat: name });
    if (wasOpen) load();
    wasOpen = true;
  });
}

// Open the scene at a new seat.
export function load() {
  if (!isLoaded) return;
  const given = new URLSearchParams(location.search);
  const asked = new URLSearchParams({ darkMode: "" });
  for (const name of ASKED) if (given.has(name)) asked.set(name, given.get(name));
  const random = crypto.getRandomValues(new Uint8Array(SEAT));
  name = btoa(String.fromCharCode(...random))
    .replaceAll("+", "-")
    .replaceAll("/", "_");
  frame.contentWindow.location.replace(`/scene/${name}?${asked}`);
}

// Call a function with the window of the frame whenever it has loaded.
export function whenLoaded(watch) {
  watching.push(watch);
}
