// What the last race came to, from the stored runs, where the page is empty before START.
import { make } from "./dom.js";
import { on, send } from "./link.js";
import { lastRace } from "./run_rows.js";
import { show } from "./store.js";

const place = document.querySelector(".last");
const HEADS = ["", "time [s]", "above limit", "outcome"];

function rowOf({ cells }) {
  const name = [cells.flown_by, cells.numbers].filter(Boolean).join(" ");
  const time = cells.time === null ? "" : cells.time.toFixed(3);
  const above = cells.above === null ? "" : `${cells.above.toFixed(1)} %`;
  return make("tr", {}, ...[name, time, above, cells.outcome].map((textContent) => make("td", { textContent })));
}

function draw({ rows, together }) {
  const found = lastRace(rows, together);
  if (!found.length) return place.replaceChildren();
  const { course, when } = found.at(-1).cells;
  const replay = make("button", {
    type: "button",
    textContent: "Replay it",
    onclick: () => send({ type: "replay_runs", names: found.map(({ name }) => name) }),
  });
  const heads = HEADS.map((textContent) => make("th", { textContent }));
  place.replaceChildren(
    make("h2", { textContent: `The last race: ${course}, ${when}` }),
    make(
      "table",
      { className: "figures" },
      make("thead", {}, make("tr", {}, ...heads)),
      make("tbody", {}, ...found.map(rowOf)),
    ),
    replay,
  );
}

export function begin() {
  on("runs", draw);
  show("now", ({ race }) => (place.hidden = race > 0));
}
