// The tower: fixed columns, a row for each competitor, see tower.py.
import { dashed, make, say } from "./dom.js";
import { show } from "./parts.js";

const HEADS = [
  ["", "place"],
  ["", "name"],
  ["lap", "lap"],
  ["int", "interval", "interval to the one ahead [s]"],
  ["gap", "gap", "gap to the leader [s]"],
  ["last", "last", "last lap [s]"],
  ["best", "best", "best lap [s]"],
  [
    "chatter",
    "chatter",
    "total variation of the commanded thrust [m/s²/s]: jumps that no motor can follow; less is better",
  ],
];
const NOTE = "purple: best of all, green: own best; chatter [m/s²/s]: less is better";
const WIDE = 480; // width from which there is room for the gap [px]
const NARROW = 420; // width below which there is no room for the lap and the last lap [px]

function row() {
  const cells = HEADS.map(([, name]) => make("td", { className: name }));
  const [, name, , , , , , chatter] = cells;
  const line = make("i", { className: "swatch" });
  name.append(line, make("b"), make("span", { className: "hits" }));
  const bar = make("i", { className: "bar" });
  chatter.append(make("span"), bar);
  const sectors = make("div", { className: "sectors" });
  const progress = make("i");
  const below = make("td", { colSpan: HEADS.length }, sectors, make("div", { className: "progress" }, progress));
  return {
    row: make("tr", {}, ...cells),
    under: make("tr", { className: "under" }, below),
    below,
    cells,
    line,
    bar,
    sectors,
    progress,
  };
}

// Hits and misses, if there are any.
function bad({ hits, misses }) {
  const counted = (count, word, words) => (count ? ` ${count} ${count > 1 ? words : word}` : "");
  return counted(hits, "hit", "hits") + counted(misses, "miss", "misses");
}

function fill(parts, found) {
  const { cells, bar, sectors, progress } = parts;
  const [place, name, lap, interval, gap, last, best, chatter] = cells;
  say(place, String(found.place));
  dashed(parts.line, found.colour, found.dash);
  say(name.querySelector("b"), found.name);
  name.title = found.name;
  name.querySelector("b").style.color = found.colour;
  say(lap, found.lap);
  say(interval, found.interval);
  interval.classList.toggle("out", found.is_out);
  say(gap, found.gap);
  for (const [cell, time] of [
    [last, found.last],
    [best, found.best],
  ]) {
    say(cell, time.text);
    cell.dataset.mark = time.mark;
  }
  say(name.querySelector(".hits"), bad(found));
  say(chatter.querySelector("span"), found.chatter);
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
  const body = make("tbody");
  const note = make("p", { className: "note" });
  const table = make("table", {}, make("thead", {}, make("tr", {}, ...heads)), body);
  place.append(table, note);
  let rows = [];
  show("tower", ({ rows: found, over }) => {
    place.hidden = !found.length;
    if (rows.length !== found.length) {
      rows = found.map(row);
      body.replaceChildren(...rows.flatMap((one) => [one.row, one.under]));
    }
    const hasGap = found.length > 2 && place.clientWidth > WIDE;
    const isNarrow = place.clientWidth < NARROW;
    table.classList.toggle("few", !hasGap);
    table.classList.toggle("narrow", isNarrow);
    for (const { below } of rows) below.colSpan = HEADS.length - !hasGap - 2 * isNarrow;
    found.forEach((one, k) => fill(rows[k], one));
    say(note, over ? `${over} · ${NOTE}` : NOTE);
  });
}
