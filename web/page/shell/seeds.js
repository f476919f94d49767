// The tab Seeds: what a line-up came to over several seeds, as they come in, see seeds_table.py.
import { make } from "./dom.js";
import { show } from "./store.js";

const NONE =
  "Set Seeds beside START to fly several seeds in a row: means with their 95 % intervals stand here as they come in.";

function coloured(text, colour) {
  const found = make("b", { textContent: text });
  found.style.color = colour;
  return found;
}

function tableOf(heads, rows) {
  const row = (tag, cells) => make("tr", {}, ...cells.map((cell) => make(tag, {}, cell)));
  return make(
    "table",
    { className: "figures" },
    make("thead", {}, row("th", heads)),
    make("tbody", {}, ...rows.map((cells) => row("td", cells))),
  );
}

export function begin(pane) {
  const place = make("div", { className: "tree" });
  pane.append(place);
  show("seeds", ({ said, headline, seeds, rows, pairs }) => {
    const parts = [make("p", { textContent: said || NONE, className: said ? "" : "note" })];
    if (headline.length)
      parts.push(make("p", {}, ...headline.map(({ text, colour }) => (colour ? coloured(text, colour) : text))));
    if (rows.length) {
      const means = rows.map((row) => [coloured(row.name, row.colour), row.finished, row.time, row.chatter]);
      parts.push(tableOf(["run", "finished", "time [s]", "chatter [m/s²/s]"], means));
      const differences = pairs.map(({ names, colours, difference }) => [
        make("span", {}, coloured(names[0], colours[0]), " − ", coloured(names[1], colours[1])),
        difference,
      ]);
      if (differences.length) parts.push(tableOf(["paired by seed", "time [s]"], differences));
      const each = rows.map((row) => [coloured(row.name, row.colour), ...row.times]);
      parts.push(tableOf(["run", ...seeds.map((seed) => `seed ${seed}`)], each));
      parts.push(
        make("p", {
          className: "note",
          textContent: "mean ± half of Student's 95 % interval, of time and chatter of the flights that finished",
        }),
      );
    }
    place.replaceChildren(...parts);
  });
}
