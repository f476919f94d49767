// The tower: fixed columns, a row for each competitor, see tower.py.
import { dashed, make, say } from "./dom.js";
import { show } from "./store.js";

const HEADS = [
  ["", "place"],
  ["", "name"],
  ["lap", "lap"],
  ["int", "interval", "interval to the one ahead [s]"],
  ["gap", "gap", "gap to the leader [s]"],
  ["last", "last", "last lap [s]"],
  ["best", "best", "best lap [s]"],
  ["time", "timed", "time of this lap; of the race once it is finished [s]"],
  ["limit", "above", "above the best known limit"],
  ["hits", "hits", "gates, obstacles, vehicles and ground that were hit"],
  [
    "chatter",
    "chatter",
    "total variation of the commanded thrust [m/s²/s]: jumps that no motor can follow; less is better",
  ],
];
const NOTE = "purple: best of all, green: own best; chatter [m/s²/s]: less is better";

function row() {
  const cells = HEADS.map(([, name]) => make("td", { className: name }));
  const of = Object.fromEntries(HEADS.map(([, name], k) => [name, cells[k]]));
  const line = make("i", { className: "swatch" });
  of.place.append(make("span"), line);
  of.name.append(make("b"));
  const bar = make("i", { className: "bar" });
  of.chatter.append(make("span"), bar);
  const sectors = make("div", { className: "sectors" });
  const progress = make("i");
  const below = make("td", {}, sectors, make("div", { className: "progress" }, progress));
  return {
    row: make("tr", {}, ...cells),
    under: make("tr", { className: "under" }, below),
    below,
    of,
    line,
    bar,
    sectors,
    progress,
  };
}

// The hits, none as well, and misses, if there are any.
const hitsOf = ({ hits, misses }) => String(hits) + (misses ? ` + ${misses} miss` : "");

function fill(parts, found) {
  const { of, bar, sectors, progress } = parts;
  const name = of.name.querySelector("b");
  dashed(parts.line, found.colour, found.dash);
  of.name.title = found.name;
  name.style.color = found.colour;
  say(name, found.is_recorded ? `${found.name} (recorded)` : found.name);
  for (const key of ["lap", "interval", "gap", "above"]) say(of[key], found[key]);
  say(of.place.firstChild, String(found.place));
  say(of.timed, found.time);
  of.timed.classList.toggle("out", found.is_out);
  for (const key of ["last", "best"]) {
    say(of[key], found[key].text);
    of[key].dataset.mark = found[key].mark;
  }
  say(of.hits, hitsOf(found));
  of.hits.classList.toggle("out", found.hits + found.misses > 0);
  say(of.chatter.querySelector("span"), found.chatter);
  bar.style.setProperty("--share", found.chatter_share);
  bar.style.background = found.colour;
  if (sectors.childElementCount !== found.sectors.length)
    sectors.replaceChildren(...found.sectors.map(() => make("i")));
  found.sectors.forEach(([title, mark], k) => {
    sectors.children[k].title = title;
    sectors.children[k].dataset.mark = mark;
  });
  progress.style.setProperty("--share", found.progress);
  progress.style.background = found.colour;
  parts.row.title = found.result;
}

export function begin() {
  const place = document.querySelector(".tower");
  const heads = HEADS.map(([text, name, title]) =>
    make("th", { className: name, textContent: text, title: title ?? "" }),
  );
  const title = make("caption");
  const body = make("tbody");
  const note = make("p", { className: "note" });
  const table = make("table", {}, title, make("thead", {}, make("tr", {}, ...heads)), body);
  place.append(table, note);
  let rows = [];
  // The row of sectors is as wide as the columns for which there is room, see shell.css.
  const fit = () => {
    const columns = heads.filter((head) => head.clientWidth).length;
    for (const { below } of rows) if (columns && below.colSpan !== columns) below.colSpan = columns;
  };
  new ResizeObserver(fit).observe(place);
  show("tower", ({ rows: found, over, is_final }) => {
    place.hidden = !found.length;
    if (rows.length !== found.length) {
      rows = found.map(row);
      body.replaceChildren(...rows.flatMap((one) => [one.row, one.under]));
    }
    table.classList.toggle("few", found.length < 3);
    table.classList.toggle("unlimited", !found.some(({ above }) => above));
    document.body.classList.toggle("final", is_final);
    title.hidden = !is_final;
    say(title, over ? `Result ${over}` : "Result");
    fit();
    found.forEach((one, k) => fill(rows[k], one));
    say(note, over && !is_final ? `${over} · ${NOTE}` : NOTE);
  });
}
