// What the last race came to, from the stored runs, where the page is empty before START.
import { make } from "./dom.js";
import { on, send } from "./link.js";
import { lastRace } from "./run_rows.js";
import { show } from "./store.js";

const place = document.querySelector(".last");
// heads, and the texts below them
const COLUMNS = [
  ["", ({ flown_by, numbers }) => [flown_by, numbers].filter(Boolean).join(" ")],
  ["time [s]", ({ time }) => (time === null ? "" : time.toFixed(3))],
  ["limit", ({ above }) => (above === null ? "" : `+${above.toFixed(1)} %`)],
  ["outcome", ({ outcome }) => outcome],
];

const rowOf = (tag, texts) => make("tr", {}, ...texts.map((textContent) => make(tag, { textContent })));

function draw({ rows, together }) {
  const found = lastRace(rows, together);
  if (!found.length) return place.replaceChildren();
  const { course, when } = found.at(-1).cells;
  const replay = make("button", {
    type: "button",
    textContent: "Replay it",
    onclick: () => send({ type: "replay_runs", names: found.map(({ name }) => name) }),
  });
  // A course whose limit nobody knows has no such column.
  const columns = COLUMNS.filter(([, textOf], k) => k === 0 || found.some(({ cells }) => textOf(cells)));
  const heads = columns.map(([head]) => head);
  const body = found.map(({ cells }) => columns.map(([, textOf]) => textOf(cells)));
  place.replaceChildren(
    make("h2", { textContent: `The last race: ${course}, ${when}` }),
    make(
      "table",
      { className: "figures" },
      make("thead", {}, rowOf("th", heads)),
      make("tbody", {}, ...body.map((texts) => rowOf("td", texts))),
    ),
    replay,
  );
}

export function begin() {
  on("runs", draw);
  show("now", ({ race }) => (place.hidden = race > 0));
}
