// The table of stored runs and the reports of campaigns, over the page. runs_panel.py sends what it shows; all of it is
// set as text, never as HTML. An address with ?run=NAME&run=NAME2&t=3.2&camera=chase shows these runs, one with
// ?line_up=TEXT sets up the next START.
import { copy, make } from "./dom.js";
import { figureOf } from "./figure.js";
import * as keys from "./keys.js";
import { on, send } from "./link.js";
import { nodesOf } from "./report_blocks.js";
import { fits, order } from "./run_rows.js";
import { seat } from "./scene.js";
import { show } from "./store.js";

const MOST = 300; // rows that are shown; the filter finds the others
let columns = []; // their keys, titles and digits, which the server sends
let rows = [];
let together = 1; // runs side by side, at most, which the server sends
let sort = { key: "when", down: true };
const chosen = new Set(); // names of rows
let opened = null; // name of the row whose texts are shown
const wordings = {}; // by name

const filter = make("input", {
  type: "search",
  placeholder: "filter: words that a row has",
  ariaLabel: "Filter the runs",
});
const count = make("span", { className: "count" });
const compare = make("button", { textContent: "Replay", onclick: () => replay([...chosen]) });
const against = make("button", {
  textContent: "Fly against",
  onclick: () => leave({ type: "fly_against", names: [...chosen] }),
});
const remark = make("div", { className: "remark", role: "status" });
const table = make("table");
const reports = make("div", { className: "reports" });
const sheet = make("section", { className: "race-sheet", hidden: true, ariaLabel: "Runs and campaigns" });
sheet.setAttribute("role", "dialog");
const tabs = ["Runs", "Campaigns"].map((name) => make("button", { textContent: name, onclick: () => showTab(name) }));
const close = make("button", { textContent: "Close", onclick: () => open(false) });
const runs = make(
  "div",
  { className: "runs" },
  make("div", { className: "tools" }, filter, count, compare, against),
  make("div", { className: "scroll" }, table),
);
sheet.append(make("div", { className: "tools" }, ...tabs, remark, close), runs, reports);

// Rows are drawn once a visitor pauses: drawing 300 of them at every key held the typing up.
let typing = 0;
filter.oninput = () => {
  clearTimeout(typing);
  typing = setTimeout(draw, 150);
};

export function open(on = sheet.hidden) {
  sheet.hidden = !on;
  remark.textContent = "";
  if (on) keys.over(layer);
  else keys.leave(layer);
  if (on) filter.focus();
  // What is hidden keeps the focus until the next picture is drawn, and would take the keys pressed until then.
  else if (sheet.contains(document.activeElement)) document.activeElement.blur();
}

function showTab(name) {
  for (const tab of tabs) tab.ariaPressed = String(tab.textContent === name);
  runs.hidden = name !== "Runs";
  reports.hidden = name !== "Campaigns";
  if (name === "Campaigns") send({ type: "list_reports" });
}

function draw() {
  const words = filter.value.toLowerCase().split(/\s+/);
  const found = rows.filter((row) => fits(row, words, columns)).sort(order(sort));
  const shown = found.slice(0, MOST);
  count.textContent =
    `${found.length} of ${rows.length}` + (found.length > MOST ? `, the first ${MOST} are shown` : "");
  compare.textContent = chosen.size > 1 ? `Compare ${chosen.size}` : "Replay";
  compare.disabled = against.disabled = chosen.size === 0;
  const focus = document.activeElement?.dataset?.key;
  const none = make("td", {
    colSpan: columns.length + 2,
    textContent: rows.length ? "No run has all of these words." : "No run is stored yet.",
  });
  const body = shown.length ? shown.flatMap(drawn) : [make("tr", {}, none)];
  table.replaceChildren(head(), make("tbody", {}, ...body));
  if (focus) table.querySelector(`[data-key="${CSS.escape(focus)}"]`)?.focus();
}

function head() {
  const cells = columns.map(({ key, title, digits }) => {
    const mark = sort.key !== key ? "" : sort.down ? " ▾" : " ▴";
    const button = make("button", { textContent: title + mark, onclick: () => sortBy(key) });
    button.dataset.key = `sort ${key}`;
    const cell = make("th", { className: digits === null ? "" : "number" }, button);
    if (mark) cell.ariaSort = sort.down ? "descending" : "ascending";
    return cell;
  });
  return make("thead", {}, make("tr", {}, make("th"), ...cells, make("th")));
}

function sortBy(key) {
  sort = { key, down: sort.key === key ? !sort.down : key === "when" };
  draw();
}

// The row of a run, and its texts below it if they are asked for.
function drawn(row) {
  if (row.problem) {
    const what = make("td", {
      colSpan: columns.length,
      className: "problem",
      textContent: `${row.name}: ${row.problem}`,
    });
    return [make("tr", {}, make("td"), make("td", { textContent: row.cells.when }), what)];
  }
  const pick = make("input", { type: "checkbox", checked: chosen.has(row.name), ariaLabel: `Choose ${row.name}` });
  pick.dataset.key = `pick ${row.name}`;
  pick.onchange = () => choose(row.name, pick.checked);
  const cells = columns.map(({ key, digits, is_long: long }) => {
    const value = row.cells[key];
    const text = value === null ? "" : digits === null ? value : value.toFixed(digits);
    const bad =
      (key === "changes" && value > 0) || (key === "outcome" && row.cells.time === null && row.vehicles === 1);
    const title = long ? text : "";
    return make("td", {
      textContent: text,
      title,
      className: (digits === null ? "" : "number") + (bad ? " bad" : "") + (long ? " long" : ""),
    });
  });
  const acts = make(
    "td",
    { className: "acts" },
    act("replay", row, () => replay([row.name])),
    act("take over", row, () => leave({ type: "take_over", name: row.name })),
    act("fly again", row, () => leave({ type: "fly_again", name: row.name })),
    act("copy ...", row, () => word(row.name)),
  );
  const line = make(
    "tr",
    { title: row.name, className: opened === row.name ? "open" : "" },
    make("td", {}, pick),
    ...cells,
    acts,
  );
  return opened === row.name ? [line, make("tr", {}, texts(row))] : [line];
}

function act(what, row, onclick) {
  const button = make("button", { textContent: what, onclick });
  button.dataset.key = `${what} ${row.name}`;
  return button;
}

function texts(row) {
  const cell = make("td", { colSpan: columns.length + 2, className: "texts" });
  const wording = wordings[row.name];
  if (!wording) return Object.assign(cell, { textContent: "..." });
  const address = new URL("?" + new URLSearchParams({ run: row.name }), document.baseURI).href;
  const lines = [
    ["command", wording.command],
    ["Python", wording.python],
    ["link", address],
  ];
  for (const [name, text] of lines) {
    const copied = make("button", {
      textContent: "copy",
      ariaLabel: `Copy the ${name}`,
      onclick: () => copy(text, copied),
    });
    cell.append(make("div", {}, copied, make("b", { textContent: name }), make("code", { textContent: text })));
  }
  if (wording.remark)
    cell.append(make("div", { className: "bad", textContent: `may not give the same bits: ${wording.remark}` }));
  return cell;
}

function choose(name, on) {
  if (on) chosen.add(name);
  else chosen.delete(name);
  if (chosen.size > together) chosen.delete(chosen.values().next().value);
  draw();
}

function word(name) {
  opened = opened === name ? null : name;
  if (opened && !wordings[name]) send({ type: "word_run", name });
  draw();
}

function replay(names) {
  leave({ type: "replay_runs", names });
}

// Close the sheet and send a request, whose result is seen behind the sheet; a remark opens it again.
function leave(message) {
  open(false);
  send(message);
}

function received(message) {
  rows = message.rows;
  together = message.together;
  columns = Object.entries(message.columns).map(([key, column]) => ({ key, ...column }));
  const names = new Set(rows.filter((row) => !row.problem).map((row) => row.name));
  for (const name of chosen) if (!names.has(name)) chosen.delete(name);
  draw();
}

// Show the runs that the address names, and to this visitor its time, camera and view.
function follow(asked) {
  if (asked.get("line_up")) send({ type: "set_up", line_up: asked.get("line_up") });
  const names = asked.getAll("run").slice(0, together);
  if (!names.length) return;
  const t = Number(asked.get("t") ?? NaN);
  if (asked.get("ghosts")) setView("ghosts", asked.get("ghosts"));
  if (asked.get("limit") === "1") setView("limit", true);
  send({ type: "replay_runs", names, ...(t >= 0 && { t }) });
  if (asked.get("camera")) chooseCamera(asked.get("camera"));
}

// As the form of the view does: the server knows the values, and refuses any other.
function setView(field, value) {
  send({ type: "set_field", form: "view", field, value });
}

// The camera is the visitor's own: it is chosen once the scene has one.
function chooseCamera(mode) {
  let isAsked = false;
  show("camera", (now) => {
    if (!now || isAsked) return;
    isAsked = true;
    send({ type: "camera", seat: seat(), mode });
  });
}

// The keys of the race do not act beneath a table that is over it, wherever the focus is: after a click with the
// mouse it is on the page.
const layer = {
  down(event) {
    const closes = event.key === "Escape" || (event.key === "t" && !event.target.matches?.("input"));
    if (closes) open(false);
    return closes || !sheet.contains(event.target) ? keys.TAKEN : keys.LEFT;
  },
};

export function begin() {
  document.body.append(sheet);
  showTab("Runs");
  let isFirst = true;
  on("open", () => send({ type: "list_runs" }));
  on("runs", (message) => {
    received(message);
    if (isFirst) follow(new URLSearchParams(location.search));
    isFirst = false;
  });
  on("run_wording", (message) => {
    wordings[message.name] = message;
    draw();
  });
  on("remark", ({ text }) => {
    if (sheet.hidden) open(true);
    if (opened && !wordings[opened]) opened = null; // its texts do not come
    draw();
    remark.textContent = text;
  });
  on("reports", ({ rows }) => {
    const none = make("p", { textContent: "No campaign beside the folder of runs: race compare makes one." });
    const list = rows.map((row) => {
      const name = row.title || "all that was flown";
      const show = make("button", { textContent: name, onclick: () => send({ type: "show_report", name: row.name }) });
      show.dataset.report = row.name;
      return make("div", {}, make("span", { textContent: `${row.when}  ${row.campaign}` }), show);
    });
    reports.replaceChildren(
      make("div", { className: "list" }, ...(list.length ? list : [none])),
      make("div", { className: "report" }),
    );
  });
  on("report", (message) => {
    const figure = message.figure ? [figureOf(message)] : [];
    for (const one of reports.querySelectorAll("[data-report]"))
      one.ariaPressed = String(one.dataset.report === message.name);
    reports.querySelector(".report").replaceChildren(...figure, ...message.document.blocks.flatMap(nodesOf));
  });
}
