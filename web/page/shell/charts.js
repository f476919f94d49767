// Charts in which one can work, see charts.py: signals over time, gaps over place, spectra. They are drawn on a
// canvas in each element with data-charts. The pointer shows the values there; pressing and dragging moves the
// replay; the wheel zooms; a double click shows everything, or follows the race again.
import { make } from "./dom.js";
import { isOpen, on, send } from "./link.js";
import { alsoShows } from "./parts.js";
import { extent, rowsIn, scale, text, ticks, valueAt, zoomed, zoomedInTime } from "./scales.js";
import { show } from "./store.js";

const SPAN = 6; // [s] that are shown at first
// The tabs with charts: one with curves over time, which the page requests frame by frame, and those with
// curves that a part of the page has, see Curves in charts.py.
const CURVES = ["Gap", "Spectrum"];
export const CHARTS = ["Signals", ...CURVES];
const SHOWN = 5; // signals that are shown at first
const AHEAD = 1 / 3; // share of the window after the present time
const HEIGHT = 7.5; // of a chart of many [rem]
const TALL = 13; // of another one [rem]
const MARGIN = { left: 52, right: 10, top: 6, bottom: 22 }; // [px]
const LAPS = 16; // height of the line that names the laps [px]
const RECORDED = [8, 5]; // dashes of a recorded run beside live flights, which are solid [px]
const HINT = "press or drag: move the time; Ctrl + wheel: zoom; double click: all";
const GRID = "#2c3038";
const TEXT = "#b4bcc8";

let race = { race: 0, lines: [], frames: [], laps: [], t: 0, end: 0, is_playing: false }; // of the charts over time
let signals = [];
let curves = { race: 0, lines: [], charts: [] }; // of the others
const off = new Set(); // titles of the signals that are not shown
const hidden = new Set(); // names of the competitors that are not shown
let time = { from: 0, span: SPAN, follows: true }; // the window of all charts over time
const zooms = {}; // the window of a chart over place or frequency, by its title
let pointer = null; // { key, x }: the place of the pointer, on all charts over the same axis
let pressed = false;
let isAsked = false; // whether a question waits at the server

// Whether the charts of a tab can be seen; what cannot be seen is not asked for.
const isSeen = (tab) => document.querySelector(`[data-charts="${tab}"]`).clientWidth > 0;

// Ask for what this page lacks; the answer comes once there is something.
function ask() {
  if (isAsked || !isOpen() || !isSeen("Signals") || document.hidden) return;
  const frames = race.frames.map((columns) => columns.t.length);
  const { t, is_playing } = race;
  isAsked = send({ type: "ask_signals", race: race.race, frames, t, is_playing });
}

function received(answer) {
  isAsked = false;
  const isNew = answer.signals !== null;
  if (isNew) {
    if (!signals.length) answer.signals.slice(SHOWN).forEach(([title]) => off.add(title));
    signals = answer.signals;
    time = { from: 0, span: SPAN, follows: true };
    hidden.clear();
  }
  const frames = isNew ? answer.frames.map(() => ({ t: [] })) : race.frames;
  answer.frames.forEach(({ start, columns }, k) => {
    // What has come in another order is asked for anew.
    if (start !== frames[k].t.length) return;
    for (const [name, values] of Object.entries(columns)) {
      frames[k][name] ??= [];
      for (const value of values) frames[k][name].push(value);
    }
  });
  race = { ...answer, frames, lines: toldApart(answer.lines) };
  follow();
  draw();
  ask();
}

function receivedCurves(found) {
  if (found.race !== curves.race) hidden.clear();
  curves = { ...found, lines: toldApart(found.lines) };
  draw();
}

// Beside live flights recorded runs are dashed, and named as such.
function toldApart(lines) {
  const recorded = lines.filter((line) => line.is_recorded).length;
  if (!recorded || recorded === lines.length) return lines;
  return lines.map((line) =>
    line.is_recorded ? { ...line, dash: RECORDED, kind: "recorded " } : { ...line, dash: [], kind: "live " },
  );
}

// Keep the present time in the window, but not under a hand.
function follow() {
  if (pressed || !time.follows) return;
  const at = race.t - time.from;
  const shown = time.span * (1 - AHEAD);
  const moves = race.is_playing ? at !== shown : at < 0 || at > time.span;
  if (moves) time.from = Math.max(race.t - shown, 0);
}

// The charts of an element, as they are now: each has a title, lines and a window.
function chartsOf(tab) {
  if (tab !== "Signals") return curves.charts.filter((curve) => curve.tab === tab).map(overPlace);
  return race.lines.length ? signals.filter(([title]) => !off.has(title)).map(overTime) : [];
}

function overTime([title, column, command], k) {
  const lines = [];
  race.lines.forEach((line, k) => {
    const { t, ...columns } = race.frames[k];
    if (command) lines.push({ ...line, what: "commanded", dash: [1, 2], width: 1, x: t, y: columns[command] ?? [] });
    lines.push({ ...line, what: command ? "delivered" : "", width: 2, x: t, y: columns[column] ?? [] });
  });
  const window = [time.from, time.from + time.span];
  return {
    key: "t",
    title,
    lines,
    window,
    mark: race.t,
    unit: "t [s]",
    bounds: race.laps,
    namesLaps: k === 0,
    seek: race.can_seek ? (t) => ({ type: "seek", t }) : null,
  };
}

function overPlace(curve) {
  const lines = curves.lines.map((line, k) => ({ ...line, what: "", width: 2, x: curve.x, y: curve.y[k] ?? [] }));
  const window = zooms[curve.title] ?? [curve.x[0], curve.x.at(-1)];
  const begins = curve.seeks_from;
  const seek = begins !== null ? (place) => ({ type: "seek_place", place: place + begins }) : null;
  return {
    key: curve.x_title,
    title: curve.title,
    lines,
    window,
    mark: curve.mark,
    unit: curve.x_title,
    isLog: curve.is_log,
    seek,
  };
}

function paint(canvas, chart) {
  const width = canvas.clientWidth;
  const height = canvas.clientHeight;
  if (!width) return;
  const dpr = window.devicePixelRatio || 1;
  if (canvas.width !== Math.round(width * dpr)) canvas.width = Math.round(width * dpr);
  if (canvas.height !== Math.round(height * dpr)) canvas.height = Math.round(height * dpr);
  const g = canvas.getContext("2d");
  g.setTransform(dpr, 0, 0, dpr, 0, 0);
  g.clearRect(0, 0, width, height);
  const top = MARGIN.top + (chart.namesLaps ? LAPS : 0);
  const [right, bottom] = [width - MARGIN.right, height - MARGIN.bottom];
  const x = scale(...chart.window, MARGIN.left, right, chart.isLog);
  const y = scale(...extent(chart, hidden), bottom, top, chart.isLog);
  canvas.scaleX = x;
  const letters = Math.max(12, 0.8 * parseFloat(getComputedStyle(document.documentElement).fontSize));
  g.font = `${letters}px system-ui, sans-serif`;
  g.fillStyle = TEXT;
  g.strokeStyle = GRID;
  g.lineWidth = 1;
  g.textAlign = "right";
  g.textBaseline = "middle";
  for (const v of ticks(y, height / 40)) {
    rule(g, MARGIN.left, y.at(v), right, y.at(v));
    g.fillText(text(v), MARGIN.left - 5, y.at(v));
  }
  g.textBaseline = "top";
  g.fillText(chart.unit, right, bottom + 4);
  g.textAlign = "center";
  const free = right - g.measureText(chart.unit).width - 6; // left of the name of the axis
  for (const v of ticks(x, width / 70)) {
    rule(g, x.at(v), top, x.at(v), bottom);
    if (x.at(v) + g.measureText(text(v)).width / 2 < free) g.fillText(text(v), x.at(v), bottom + 4);
  }
  if (chart.namesLaps) nameLaps(g, chart, x, right);
  g.save();
  g.beginPath();
  g.rect(MARGIN.left, top, right - MARGIN.left, bottom - top);
  g.clip();
  g.strokeStyle = "#565f6e";
  for (const lap of chart.bounds ?? []) rule(g, x.at(lap), top, x.at(lap), bottom);
  for (const line of chart.lines) if (!hidden.has(line.name)) stroke(g, line, chart.window, x, y);
  g.setLineDash([3, 3]);
  g.strokeStyle = "#fff";
  rule(g, x.at(chart.mark), top, x.at(chart.mark), bottom);
  g.setLineDash([]);
  if (pointer?.key === chart.key) {
    g.strokeStyle = TEXT;
    rule(g, x.at(pointer.x), top, x.at(pointer.x), bottom);
  }
  g.restore();
}

// The first competitor's laps with their times, above the part of each that is in the window.
function nameLaps(g, chart, x, right) {
  const ends = chart.bounds;
  g.fillStyle = chart.lines[0]?.colour ?? TEXT;
  for (let k = 1; k < ends.length; k++) {
    const [from, to] = [Math.max(x.at(ends[k - 1]), MARGIN.left), Math.min(x.at(ends[k]), right)];
    const long = `lap ${k}: ${(ends[k] - ends[k - 1]).toFixed(3)} s`;
    const name = [long, `lap ${k}`, `${k}`].find((one) => g.measureText(one).width < to - from - 6);
    if (name) g.fillText(name, (from + to) / 2, MARGIN.top - 2);
  }
}

function rule(g, x1, y1, x2, y2) {
  g.beginPath();
  g.moveTo(x1, y1);
  g.lineTo(x2, y2);
  g.stroke();
}

// At most some points a pixel: the least and the greatest of each group of frames.
function stroke(g, line, window, x, y) {
  const [first, last] = rowsIn(line, window);
  const group = Math.max(1, Math.floor((last - first) / 1500));
  g.strokeStyle = line.colour;
  g.lineWidth = line.width;
  g.setLineDash(line.dash);
  g.globalAlpha = line.what === "commanded" ? 0.9 : 1;
  g.beginPath();
  let isGap = true;
  for (let i = first; i < last; i += group) {
    let [low, high] = [i, i];
    for (let k = i; k < Math.min(i + group, last); k++) {
      if (line.y[k] < line.y[low]) low = k;
      if (line.y[k] > line.y[high]) high = k;
    }
    for (const k of group > 1 ? [Math.min(low, high), Math.max(low, high)] : [i]) {
      if (line.y[k] === null) {
        isGap = true;
        continue;
      }
      const [px, py] = [x.at(line.x[k]), y.at(line.y[k])];
      if (isGap) g.moveTo(px, py);
      else g.lineTo(px, py);
      isGap = false;
    }
  }
  g.stroke();
  g.setLineDash([]);
  g.globalAlpha = 1;
}

function legend(chart) {
  const at = pointer?.key === chart.key ? pointer.x : chart.mark;
  const shown = chart.lines.filter((line) => !hidden.has(line.name));
  const items = shown
    .filter((line) => line.what !== "commanded")
    .map((line) => {
      const swatch = make("i", { className: "swatch" });
      swatch.style.borderTop = `${line.width + 1}px ${line.dash.length ? "dashed" : "solid"} ${line.colour}`;
      const value = (one) =>
        make("b", { textContent: valueAt(one, at, chart.key === "t" || pointer?.key === chart.key) || "–" });
      const command = shown.find((one) => one.what === "commanded" && one.name === line.name);
      return make(
        "span",
        {},
        swatch,
        `${line.kind ?? ""}${line.name} `,
        value(line),
        ...(command ? [" commanded ", value(command)] : []),
      );
    });
  return [
    make("span", {
      className: "at",
      textContent: chart.unit.replace(/(?: \[(.*)\])?$/, ` ${at.toFixed(2)} $1`).trim(),
    }),
    ...items,
  ];
}

// The choice of signals and competitors, and of the window.
function tools() {
  const checks = signals.map(([title]) =>
    check(title.replace(/ \[.*/, ""), !off.has(title), (on) => toggle(off, title, !on)),
  );
  const names =
    race.lines.length > 1
      ? race.lines.map(({ name }) => check(name, !hidden.has(name), (on) => toggle(hidden, name, !on)))
      : [];
  const windows = [
    ["6 s", SPAN],
    ["lap", lapSpan()],
    ["all", null],
  ].map(([label, span]) =>
    make("button", { textContent: label, ariaLabel: `Show ${label}`, onclick: () => showSpan(span) }),
  );
  const closer = [
    ["–", 1.5],
    ["+", 1 / 1.5],
  ].map(([label, factor]) =>
    make("button", {
      textContent: label,
      ariaLabel: factor < 1 ? "Zoom in" : "Zoom out",
      onclick: () => zoom(overTime(signals[0]), race.t, factor),
    }),
  );
  const choice = make("details", {}, make("summary", { textContent: "signals" }), ...checks);
  return [...windows, ...closer, ...names, choice];
}

function lapSpan() {
  const [a, b] = race.laps.length > 1 ? race.laps.slice(-2) : [0, SPAN];
  return Math.max(b - a, 1);
}

function showSpan(span) {
  if (span === null) time = { from: 0, span: Math.max(race.end, 1), follows: false };
  else time = { from: Math.max(race.t - span * (1 - AHEAD), 0), span, follows: true };
  draw();
}

function check(label, checked, change) {
  const box = make("input", { type: "checkbox", checked });
  box.onchange = () => change(box.checked);
  return make("label", {}, box, label);
}

function toggle(set, name, on) {
  if (on) set.add(name);
  else set.delete(name);
  draw();
}

let isDue = false;
function draw() {
  if (isDue) return;
  isDue = true;
  requestAnimationFrame(() => {
    isDue = false;
    document.querySelectorAll("[data-charts]").forEach((place) => place.clientWidth && drawIn(place));
  });
}

function drawIn(place) {
  const tab = place.dataset.charts;
  const charts = chartsOf(tab);
  build(place, tab, charts);
  [...place.querySelectorAll(".race-chart")].forEach((box, k) => {
    box.chart = charts[k];
    box.querySelector(".legend").replaceChildren(...legend(charts[k]));
    paint(box.querySelector("canvas"), charts[k]);
  });
}

// Elements for these charts, made anew if other charts are wanted.
function build(place, tab, charts) {
  const wanted = JSON.stringify([
    tab,
    (tab === "Signals" ? race : curves).race,
    charts.map(({ title }) => title),
    (tab === "Signals" ? race : curves).lines.map(({ name }) => name),
    [...hidden],
  ]);
  if (place.built === wanted && place.childElementCount) return;
  place.built = wanted;
  const opened = place.querySelector("details")?.open;
  const boxes = charts.map((chart) => {
    const canvas = make("canvas");
    canvas.style.height = `${tab === "Signals" ? HEIGHT + (chart.namesLaps ? 1 : 0) : TALL}rem`;
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", chart.title);
    canvas.title = HINT;
    listen(canvas);
    return make(
      "div",
      { className: "race-chart" },
      make("h4", { textContent: chart.title }),
      make("div", { className: "legend" }),
      canvas,
    );
  });
  const above = tab === "Signals" && race.lines.length ? [make("div", { className: "tools" }, ...tools())] : [];
  place.replaceChildren(...above, ...boxes);
  if (opened) place.querySelector("details").open = true;
}

function listen(canvas) {
  const chart = () => canvas.parentElement.chart;
  const at = (event) => canvas.scaleX.of(event.clientX - canvas.getBoundingClientRect().left);
  canvas.addEventListener("pointermove", (event) => {
    pointer = { key: chart().key, x: at(event) };
    if (pressed) seek(chart(), pointer.x);
    draw();
  });
  canvas.addEventListener("pointerleave", () => {
    pointer = null;
    draw();
  });
  canvas.addEventListener("pointerdown", (event) => {
    if (event.button !== 0 || !chart().seek) return;
    pressed = true;
    canvas.setPointerCapture(event.pointerId);
    seek(chart(), at(event));
  });
  for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, () => (pressed = false));
  canvas.addEventListener(
    "wheel",
    (event) => {
      // Pinching, and the wheel with Ctrl or Shift, zoom; the wheel alone scrolls the panel.
      if (!event.ctrlKey && !event.shiftKey) return;
      event.preventDefault();
      zoom(chart(), at(event), 1.25 ** Math.sign(event.deltaY || event.deltaX));
    },
    { passive: false },
  );
  canvas.addEventListener("dblclick", () => {
    if (chart().key === "t") showSpan(time.follows ? null : SPAN);
    else delete zooms[chart().title];
    draw();
  });
}

function zoom(chart, x, factor) {
  if (chart.key === "t") time = { ...time, ...zoomedInTime(chart.window, x, factor, Math.max(race.end, SPAN)) };
  else zooms[chart.title] = zoomed(chart.window, x, factor, chart.isLog);
  draw();
}

// The time of the pointer, at most some times a second; the last one counts.
let seeking = 0;
let wanted = null;
function seek(chart, x) {
  wanted = chart.seek?.(Math.max(x, 0)) ?? null;
  if (!seeking && wanted) {
    send(wanted);
    wanted = null;
    seeking = setTimeout(() => {
      seeking = 0;
      if (wanted) send(wanted);
      wanted = null;
    }, 60);
  }
}

export function begin() {
  on("open", () => {
    isAsked = false;
    ask();
  });
  on("signals", received);
  show("curves", receivedCurves);
  alsoShows(() => (CURVES.some(isSeen) ? ["curves"] : []));
  // Another tab, or another size
  addEventListener("resize", () => {
    draw();
    ask();
  });
  document.addEventListener("visibilitychange", ask);
  new ResizeObserver(draw).observe(document.querySelector(".panes"));
}
