// Which rows the table of runs shows, and in which order.

// Return whether a row has each of the words, in what is shown or in its further settings.
export function fits(row, words, columns) {
  const cells = columns.map(({ key }) => row.cells[key]);
  const text = [...cells, row.name, row.problem, row.other_settings].join(" ").toLowerCase();
  return words.every((word) => text.includes(word));
}

// Return a comparison of two rows by a column. Rows without a value come last, whatever the direction, and so do those
// with a problem, but for their time.
export const order =
  ({ key, down }) =>
  (a, b) => {
    if (key !== "when" && !a.problem !== !b.problem) return a.problem ? 1 : -1;
    const [x, y] = [a.cells[key], b.cells[key]];
    const [no, none] = [x === null || x === "", y === null || y === ""];
    if (no || none) return no - none;
    const ahead = typeof x === "number" ? x - y : x.localeCompare(y, "en", { numeric: true });
    return down ? -ahead : ahead;
  };

const SPAN = 60000; // [ms] within which flights of one course were stored that belong together
const storedAt = ({ cells }) => Date.parse(cells.when.replace(" ", "T"));

// Return the rows of the last race: the last row, and those of other competitors that were stored shortly before it.
// Of several seeds it is the last one.
export function lastRace(rows, most) {
  const [last, ...before] = rows.filter((row) => !row.problem).sort(order({ key: "when", down: true }));
  if (!last) return [];
  const found = [last];
  const isSame = (a, b) => a.cells.flown_by === b.cells.flown_by && a.cells.numbers === b.cells.numbers;
  for (const row of before) {
    const isNear = storedAt(last) - storedAt(row) <= SPAN && row.cells.course === last.cells.course;
    const isOther = !found.some((one) => isSame(one, row)) && row.vehicles === 1;
    if (isNear && isOther && last.vehicles === 1 && found.length < most) found.push(row);
  }
  return found.reverse();
}
