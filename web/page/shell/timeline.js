// The time line under the scene: laps, gates and incidents of each competitor, and the playback, see time_line.py.
import { make, say } from "./dom.js";
import { on, send } from "./link.js";
import { scale, text, ticks } from "./scales.js";
import { show } from "./store.js";
import { shown, timeAt, typedTime } from "./times.js";

const PAUSE = 60; // [ms] between two times that are sent while the pointer moves
const STEP = 0.1; // [s] of an arrow key
const APART = 64; // [px] between two numbers of seconds, at least
const line = document.querySelector(".time .line");
const part = (name) => document.querySelector(`.time ${name}`);
let now = { t: 0, end: 0, can_seek: false };
const seconds = make("div", { className: "seconds" });
let pressed = false;
let offered = []; // speeds of the playback [race seconds per second]

// Positions are shares of a length that grows while a flight is on: CSS reckons them.
function at(element, t) {
  element.style.setProperty("--t", t);
  return element;
}

function lane({ name, colour, end, marks }) {
  const flown = at(make("i", { className: end === null ? "flown live" : "flown" }), end ?? 0);
  flown.style.background = colour;
  const found = marks.map(([t, kind, title]) =>
    at(make("i", { className: `mark ${kind}`, title: `${name}: ${title}` }), t),
  );
  return make("div", { className: "lane", title: name }, flown, ...found);
}

function draw({ lanes, laps }) {
  const numbers = laps.slice(0, -1).map((t, k) => {
    const label = at(make("span", { textContent: laps.length > 12 ? String(k + 1) : `lap ${k + 1}` }), t);
    label.style.setProperty("--to", laps[k + 1]);
    return label;
  });
  const cursor = make("i", { className: "cursor" });
  line.replaceChildren(...lanes.map(lane), make("div", { className: "laps" }, ...numbers), seconds, cursor);
}

// The seconds below the laps; other ones are made as the race becomes longer, or the window has another width.
function drawSeconds() {
  if (!now.race) return;
  const width = line.clientWidth;
  const end = lengthOf(now);
  const found = ticks(scale(0, end, 0, width), width / APART).filter((t) => t < end * (1 - APART / 2 / width));
  const texts = found.map((t) => `${text(t)} s`);
  if (seconds.textContent === texts.join("")) return;
  seconds.replaceChildren(...found.map((t, k) => at(make("span", { textContent: texts[k] }), t)));
}

const lengthOf = ({ end }) => Math.max(end, 0.001); // of the line [s]

function set(found) {
  now = found;
  const end = lengthOf(now);
  line.style.setProperty("--end", end);
  line.style.setProperty("--now", Math.min(now.t, end));
  line.style.setProperty("--flown", Math.min(Math.max(now.flown, 0), end));
  drawSeconds();
  line.classList.toggle("fixed", !now.can_seek);
  line.ariaValueMax = shown(now.end);
  line.ariaValueNow = shown(now.t);
  line.ariaValueText = `${shown(now.t)} of ${shown(now.end)} s`;
  const play = part(".play");
  say(play, now.playing ? "pause" : "play");
  play.disabled = !now.race;
  for (const act of ["back", "on"]) part(`[data-act="${act}"]`).disabled = !now.race;
  part('[data-act="next"]').disabled = !now.has_next;
  const box = part(".t");
  if (document.activeElement !== box) box.value = shown(now.t);
  box.disabled = !now.can_seek;
  say(part(".end"), `of ${shown(now.end)} s`);
  const speed = part(".speed");
  const live = part(".to-live");
  live.disabled = !now.flying || !now.can_seek;
  live.ariaPressed = String(now.flying && now.is_live);
  offer(speed, now.speed);
}

const speedOption = (speed) => new Option(`${speed} x`, speed);

function setSpeeds(speeds) {
  if (JSON.stringify(speeds) === JSON.stringify(offered)) return;
  offered = speeds;
  part(".speed").replaceChildren(...speeds.map(speedOption));
  offer(part(".speed"), now.speed ?? 1);
}

// A speed that was asked for otherwise is in the list as well.
function offer(speed, wanted) {
  if (![...speed.options].some((option) => Number(option.value) === wanted)) speed.append(speedOption(wanted));
  if (document.activeElement !== speed) speed.value = String(wanted);
}

let waiting = 0;
let last = null;
function seek(t) {
  last = Math.min(Math.max(t, 0), now.end);
  if (waiting) return;
  send({ type: "seek", t: last });
  last = null;
  waiting = setTimeout(() => {
    waiting = 0;
    if (last !== null) seek(last);
  }, PAUSE);
}

function seekTo(event) {
  seek(timeAt(event.clientX, line.getBoundingClientRect(), now.end));
}

function typed(box) {
  const t = typedTime(box.value, now.end);
  if (t !== null) seek(t);
  box.blur();
}

export function begin() {
  part(".speed").onchange = ({ target }) => {
    send({ type: "set_speed", speed: Number(target.value) });
    target.blur();
  };
  draw({ lanes: [], laps: [] });
  show("time_line", (found) => {
    setSpeeds(found.speeds);
    draw(found);
  });
  show("now", set);
  addEventListener("resize", drawSeconds);
  on("close", () => (pressed = false));
  line.addEventListener("pointerdown", (event) => {
    if (event.button !== 0 || !now.can_seek) return;
    pressed = true;
    line.setPointerCapture(event.pointerId);
    seekTo(event);
  });
  line.addEventListener("pointermove", (event) => pressed && seekTo(event));
  for (const end of ["pointerup", "pointercancel"]) line.addEventListener(end, () => (pressed = false));
  line.addEventListener("keydown", (event) => {
    const steps = { ArrowLeft: now.t - STEP, ArrowRight: now.t + STEP, Home: 0, End: now.end };
    if (!(event.key in steps) || !now.can_seek) return;
    event.preventDefault();
    seek(steps[event.key]);
  });
  const box = part(".t");
  box.onfocus = () => box.select();
  // What was typed may be refused, or be the time that is shown already.
  box.onblur = () => (box.value = shown(now.t));
  box.onkeydown = (event) => {
    if (event.key === "Enter") typed(box);
    if (event.key === "Escape") box.blur();
  };
}
