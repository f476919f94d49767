// Flying by hand: reads a gamepad or the keyboard, sends the sticks to the server (joining.py), and shows the
// instruments of the flight over the scene. Keys of the page do nothing else while this visitor flies.
import { make } from "./dom.js";
import * as keys from "./keys.js";
import { on, send } from "./link.js";
import { seat } from "./scene.js";
import * as store from "./store.js";

const PERIOD = 12; // [ms] between two positions of the sticks
const DEAD = 0.04; // share of a gamepad's stick around its middle that counts as the middle
const SMOOTHING = 0.1; // share of a new latency in the one that is shown
// Keys: full deflection would turn the vehicle faster than a key can be tapped.
const KEY_DEFLECTION = 0.4;
const KEY_SPEED = 5; // [1/s] of a stick towards its key
const THROTTLE_SPEED = 1.2; // [1/s]
const KEYS = {
  KeyW: ["throttle", 1],
  KeyS: ["throttle", -1],
  KeyA: ["yaw", -1],
  KeyD: ["yaw", 1],
  ArrowUp: ["pitch", 1],
  ArrowDown: ["pitch", -1],
  ArrowLeft: ["roll", -1],
  ArrowRight: ["roll", 1],
};
const CHANNELS = ["roll", "pitch", "throttle", "yaw"];
// Axis of each channel and whether it is reversed: mode 2 of a gamepad, whose sticks count down as positive; and
// a remote control at the USB port, whose channels come in the order AETR.
const GAMEPAD = { roll: [2, false], pitch: [3, true], throttle: [1, true], yaw: [0, false] };
const REMOTE = { roll: [0, false], pitch: [1, false], throttle: [2, false], yaw: [3, false] };

let number = null; // of this visitor, once the sticks were asked for
let asked = false; // whether this visitor wants the sticks
let lost = false; // whether the link was lost while this visitor flew
let state = { phase: "none", hover: 0.5 };
let instruments = { speed: 0, height: 0, roll: 0, pitch: 0 };
let sticks = { roll: 0, pitch: 0, yaw: 0, throttle: 0 };
let latency = null; // [ms]
let ticking = null;
let last = 0; // [ms]
const pressed = new Set();

const mine = () => asked && number !== null && state.pilot === number;
const flies = () => mine() && (state.phase === "waiting" || state.phase === "flying");
const limited = (value, low, high) => Math.min(Math.max(value, low), high);

// The channels of gamepads, kept in this browser by the gamepad's name.

function stored() {
  try {
    return JSON.parse(localStorage.getItem("race channels")) ?? {};
  } catch {
    return {};
  }
}

function channelsOf(pad) {
  return stored()[pad.id] ?? (pad.mapping === "standard" ? GAMEPAD : REMOTE);
}

function setChannel(pad, channel, axis, reversed) {
  const channels = { ...channelsOf(pad), [channel]: [axis, reversed] };
  try {
    localStorage.setItem("race channels", JSON.stringify({ ...stored(), [pad.id]: channels }));
  } catch {
    // a browser that keeps nothing
  }
}

// The sticks as they are now

function gamepad() {
  return [...(navigator.getGamepads?.() ?? [])].find((pad) => pad?.connected && pad.axes.length >= 4) ?? null;
}

function fromGamepad(pad) {
  const channels = channelsOf(pad);
  const value = (channel) => {
    const [axis, reversed] = channels[channel];
    const position = limited(Number(pad.axes[axis]) || 0, -1, 1);
    return reversed ? -position : position;
  };
  const centred = (channel) => {
    const position = value(channel);
    return (Math.sign(position) * Math.max(Math.abs(position) - DEAD, 0)) / (1 - DEAD);
  };
  return {
    roll: centred("roll"),
    pitch: centred("pitch"),
    yaw: centred("yaw"),
    throttle: (value("throttle") + 1) / 2,
  };
}

// Without a key, the sticks return to the middle, and in flight the throttle to hovering.
function fromKeys(dt) {
  const goal = { roll: 0, pitch: 0, yaw: 0, throttle: 0 };
  for (const code of pressed) goal[KEYS[code][0]] += KEYS[code][1];
  const towards = (now, wanted, most) => now + limited(wanted - now, -most, most);
  const moved = {};
  for (const channel of ["roll", "pitch", "yaw"]) {
    moved[channel] = towards(sticks[channel], KEY_DEFLECTION * goal[channel], KEY_SPEED * dt);
  }
  const rest = state.phase === "flying" ? state.hover : 0;
  const most = state.hover + KEY_DEFLECTION * (1 - state.hover);
  const throttle = goal.throttle > 0 ? most : goal.throttle < 0 ? 0 : rest;
  moved.throttle = towards(sticks.throttle, throttle, THROTTLE_SPEED * dt);
  return moved;
}

// Taking the sticks, sending them, letting go

function take() {
  asked = send({ type: "take", seat: seat() });
  keys.over(layer);
  sticks = { roll: 0, pitch: 0, yaw: 0, throttle: 0 };
  last = performance.now();
  ticking ??= setInterval(tick, PERIOD);
}

function letGo() {
  if (asked) send({ type: "let_go" });
  asked = false;
  keys.leave(layer);
  latency = null;
  pressed.clear();
  clearInterval(ticking);
  ticking = null;
  show();
}

function tick() {
  const now = performance.now();
  const dt = Math.min((now - last) / 1000, 0.1);
  last = now;
  const pad = gamepad();
  sticks = pad ? fromGamepad(pad) : fromKeys(dt);
  if (lost) {
    // A new connection is another visitor to the server.
    lost = !send({ type: "take", seat: seat() });
  } else {
    lost = !send({ type: "sticks", ...sticks, stamp: now });
  }
}

// Keys: they fly, and do not reach viser's hotkeys and camera meanwhile.

const isTyping = (element) => !!element?.closest?.("input, textarea, select, [contenteditable=true]");

// Return whether a key flies, or would do something else on the page.
function isOurs({ target, key, code, ctrlKey, metaKey, altKey }) {
  if (!flies() || isTyping(target) || ctrlKey || metaKey || altKey) return false;
  return key.length === 1 || code in KEYS || key === "Escape";
}

const layer = {
  down(event) {
    if (!isOurs(event)) return null;
    event.preventDefault();
    if (event.key === "Escape") letGo();
    else if (event.code in KEYS) pressed.add(event.code);
    return keys.TAKEN;
  },
  up(event) {
    pressed.delete(event.code);
    return isOurs(event) ? keys.TAKEN : null;
  },
};

// The instruments

const SVG = "http://www.w3.org/2000/svg";

function drawn(tag, attributes, ...children) {
  const found = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) found.setAttribute(name, value);
  found.append(...children);
  return found;
}

const over = make("div", { className: "cockpit", ariaLabel: "Flight by hand" });
const sky = drawn(
  "g",
  { class: "sky" },
  drawn("path", { d: "M-90 0H-25M25 0H90" }),
  drawn("path", { class: "scale", d: "M-14-30H14M-14 30H14" }),
);
const wings = drawn("path", { class: "wings", d: "M-40 0H-12L0 8L12 0H40" });
const noteLine = make("div", { className: "note" });
noteLine.setAttribute("role", "status");
const channels = make(
  "details",
  {},
  make("summary", { textContent: "Channels of the gamepad" }),
  make("div", { className: "channels" }),
);
over.append(
  drawn(
    "svg",
    { class: "horizon", viewBox: "-100 -100 200 200", role: "img", "aria-label": "Artificial horizon" },
    sky,
    wings,
  ),
  make(
    "div",
    { className: "panel" },
    make("div", { className: "numbers" }),
    noteLine,
    make("div", { className: "buttons" }, make("button", { className: "take", type: "button" })),
    channels,
    make("div", { className: "link" }),
  ),
);
const part = (name) => over.querySelector(`.${name}`);
const [numbers, note, button, linkLine] = ["numbers", "note", "take", "link"].map(part);
button.addEventListener("click", () => (mine() ? letGo() : take()));
// Canvas and hotkeys of the page do not see what happens here.
for (const type of ["pointerdown", "wheel"]) over.addEventListener(type, (event) => event.stopPropagation());

const ARROWS = "arrow keys: roll and pitch";
const KEYBOARD = `W, S: throttle · A, D: yaw · ${ARROWS}`;
const STICKS = "left stick: throttle and yaw · right stick: pitch and roll";

function noteNow(pad) {
  if (state.phase === "over") return "The flight has ended: START or Restart begins another";
  if (!mine()) return state.pilot === null ? "The race waits for a person who flies" : "Another visitor flies";
  if (state.silent) return "FAILSAFE: no sticks arrive. No rotation, the vehicle sinks";
  if (state.phase === "flying") return "";
  if (!state.was_down) return "Throttle down first";
  return pad ? "Raise the throttle to start" : "Hold W to start";
}

function show() {
  const pad = gamepad();
  over.style.display = state.phase === "none" ? "none" : "";
  part("horizon").style.display = flies() ? "" : "none";
  if (state.phase === "none") return;
  const text = noteNow(pad);
  if (note.textContent !== text) note.textContent = text;
  note.classList.toggle("alarm", !!state.silent);
  button.textContent = mine() ? "Let go (Esc)" : "Take the sticks";
  button.hidden = state.phase === "over";
  button.disabled = !mine() && state.pilot !== null && state.pilot !== undefined;
  numbers.hidden = !mine();
  numbers.textContent =
    `${instruments.speed.toFixed(1)} m/s · ${instruments.height.toFixed(1)} m high · ` +
    `throttle ${Math.round(100 * sticks.throttle)}\u00a0%`;
  // Turned about the middle by roll, and moved by pitch: 1 unit a degree.
  sky.setAttribute("transform", `rotate(${-instruments.roll}) translate(0 ${limited(instruments.pitch, -90, 90)})`);
  const input = pad ? `gamepad ${pad.id.slice(0, 40)}: ${STICKS}` : `keyboard: ${KEYBOARD}`;
  const delay = latency === null ? "-" : latency.toFixed(0);
  linkLine.textContent = `link ${delay} ms both ways · behind ${state.behind} · ${input}`;
  showChannels(pad);
}

// A row for each channel: its axis, whether it is reversed, and its position.
let rowsOf = "";
function showChannels(pad) {
  const details = over.querySelector("details");
  details.style.display = pad && mine() ? "" : "none";
  if (!pad) return;
  if (rowsOf !== pad.id) {
    rowsOf = pad.id;
    part("channels").replaceChildren(...CHANNELS.map((channel) => channelRow(pad, channel)));
  }
  for (const channel of CHANNELS) {
    over.querySelector(`meter[data-channel=${channel}]`).value = sticks[channel];
  }
}

function channelRow(pad, channel) {
  const [axis, reversed] = channelsOf(pad)[channel];
  const row = document.createElement("label");
  const choice = document.createElement("select");
  choice.setAttribute("aria-label", `axis of ${channel}`);
  choice.append(...pad.axes.map((_, k) => new Option(`axis ${k}`, k, k === axis, k === axis)));
  const box = document.createElement("input");
  box.type = "checkbox";
  box.checked = reversed;
  box.setAttribute("aria-label", `${channel} reversed`);
  const meter = document.createElement("meter");
  Object.assign(meter, { min: channel === "throttle" ? 0 : -1, max: 1 });
  meter.dataset.channel = channel;
  const changed = () => setChannel(pad, channel, Number(choice.value), box.checked);
  choice.addEventListener("change", changed);
  box.addEventListener("change", changed);
  row.append(channel, choice, box, "reversed", meter);
  return row;
}

export function begin() {
  on("heard", ({ stamp }) => {
    const taken = performance.now() - stamp;
    latency = latency === null ? taken : latency + SMOOTHING * (taken - latency);
  });
  on("taken", (answer) => {
    number = answer.number;
    if (!answer.yours) letGo();
  });
  on("instruments", (shown) => {
    instruments = shown;
    show();
  });
  store.show("by_hand", (found) => {
    state = found;
    show();
  });
  // The focus may go to the frame of the scene, whose keys fly as well.
  addEventListener("blur", () => document.activeElement?.tagName !== "IFRAME" && pressed.clear());
  document.querySelector(".viewport").append(over);
  over.style.display = "none";
  setInterval(() => state.phase !== "none" && show(), 100);
}
