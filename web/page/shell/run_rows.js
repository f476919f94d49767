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
