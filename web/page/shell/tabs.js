// The tabs beside the scene: charts, and the tables and the map that the server writes, see elements.py.
import { CHARTS } from "./charts.js";
import { grown, make } from "./dom.js";
import { alsoShows, ask } from "./parts.js";
import * as seeds from "./seeds.js";
import { show } from "./store.js";

const SEEDS = "Seeds";
// the part of the server that each shows
const TABLES = { Laps: "laps", Events: "events", Planner: "planner" };
const panes = {};
let open; // the part of the open tab; undefined: it has none

function choose(name) {
  for (const [title, pane] of Object.entries(panes)) {
    pane.hidden = title !== name;
    const tab = document.getElementById(`tab-${title}`);
    tab.ariaSelected = String(title === name);
    tab.tabIndex = title === name ? 0 : -1;
  }
  open = { ...TABLES, Spectrum: "chatter", Seeds: "seeds" }[name];
  dispatchEvent(new Event("resize")); // charts draw themselves
  ask();
}

// A tree into an element, once it can be seen.
function fill(element, part) {
  show(part, (node) => element.replaceChildren(grown(node)));
}

export function begin() {
  alsoShows(() => (open ? [open] : []));
  const list = document.querySelector(".tabs");
  const place = document.querySelector(".panes");
  const names = [...CHARTS, ...Object.keys(TABLES), SEEDS];
  for (const name of names) {
    const tab = make("button", { id: `tab-${name}`, type: "button", textContent: name, onclick: () => choose(name) });
    tab.setAttribute("role", "tab");
    tab.setAttribute("aria-controls", `pane-${name}`);
    list.append(tab);
    const pane = (panes[name] = make("div", { id: `pane-${name}`, className: "pane" }));
    pane.setAttribute("role", "tabpanel");
    pane.setAttribute("aria-label", name);
    if (CHARTS.includes(name)) pane.append(make("div", { className: "race-charts" }));
    if (CHARTS.includes(name)) pane.firstChild.dataset.charts = name;
    else if (name === SEEDS) seeds.begin(pane);
    else fill(pane.appendChild(make("div", { className: "tree" })), TABLES[name]);
    place.append(pane);
  }
  const chatter = make("div", { className: "tree" });
  panes.Spectrum.append(chatter);
  fill(chatter, "chatter");
  fill(document.querySelector(".map"), "map");
  list.addEventListener("keydown", (event) => {
    const by = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (!by) return;
    const now = names.findIndex((name) => !panes[name].hidden);
    const next = names[(now + by + names.length) % names.length];
    choose(next);
    document.getElementById(`tab-${next}`).focus();
  });
  choose(CHARTS[0]);
}
