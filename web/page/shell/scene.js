// The frame of the scene: viser's page, whose panel of settings stands left of the scene. The drawer is closed by moving
// the frame to the left by the width of that panel.
const frame = document.getElementById("scene");
const ASKED = ["fixedDpr"]; // what an address may ask of viser
const BOXES = "input:not([type=checkbox]), textarea";
const TAKEN = 400; // [ms] in which a typed number reaches the server: viser holds changes back for 50 ms
const CLOSED = "drawer-closed";
const watching = [];
let leftAt = -TAKEN; // when a box of the settings was left last [ms]

export const inside = () => frame.contentDocument;
export const seat = () => inside()?.querySelector("[data-seat]")?.dataset.seat ?? "";

export function begin() {
  const given = new URLSearchParams(location.search);
  const asked = new URLSearchParams({ darkMode: "" });
  for (const name of ASKED) if (given.has(name)) asked.set(name, given.get(name));
  frame.addEventListener("load", () => {
    for (const watch of watching) watch(frame.contentWindow);
    mark();
  });
  // The page is drawn before the scene, which is twenty times as large.
  const load = () => (frame.src = `/scene/?${asked}`);
  if (document.readyState === "complete") load();
  else addEventListener("load", load, { once: true });
  addEventListener("resize", mark);
  whenLoaded((window) => {
    const left = ({ target }) => target.matches?.(BOXES) && (leftAt = performance.now());
    window.addEventListener("focusout", left, true);
  });
}

// Act once a number that stands in a box of the settings, but was not entered, has reached the server by viser's connection.
export function leaveBox(act) {
  inside()?.activeElement?.blur();
  const wait = leftAt + TAKEN - performance.now();
  if (wait > 0) setTimeout(act, wait);
  else act();
}

// Call a function with the window of the frame whenever it has loaded.
export function whenLoaded(watch) {
  watching.push(watch);
}

// Whether the settings can be seen.
export const isOpen = () => document.body.classList.contains("settings");

export function openSettings(on) {
  document.body.classList.toggle("settings", on);
  document.querySelector('[data-act="settings"]').setAttribute("aria-expanded", String(on));
  mark();
}

// What cannot be seen gets no focus either.
function mark() {
  inside()?.documentElement?.classList.toggle(CLOSED, !isOpen());
}
