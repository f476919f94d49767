// The table of the competitors of the next START, over the fields of the row that is edited, see line_up_table.py.
import { dashed, make } from "./dom.js";
import { send } from "./link.js";
import { show } from "./store.js";

function rowOf({ number, name, colour, dash, what, changes }) {
  const line = make("i", { className: "swatch" });
  dashed(line, colour, dash);
  const named = make("b", { textContent: name });
  named.style.color = colour;
  const said = make(
    "span",
    { className: "what", textContent: what },
    ...(changes ? [make("b", { textContent: ` · ${changes}` })] : []),
  );
  const found = make(
    "button",
    { type: "button", className: "row", onclick: () => send({ type: "edit_row", row: number }) },
    line,
    named,
    said,
  );
  found.dataset.row = number;
  return found;
}

export function begin(place) {
  const rows = make("div", { className: "rows" });
  const remark = make("p");
  place.replaceChildren(rows, remark);
  let now = 0;
  const mark = () => {
    for (const row of rows.children)
      row.ariaPressed = String(rows.childElementCount > 1 && Number(row.dataset.row) === now);
  };
  show(
    "line_up",
    ({ rows: found, compared, problem }) => {
      rows.replaceChildren(...found.map(rowOf));
      remark.className = problem ? "error" : "note";
      remark.textContent = problem || compared;
      mark();
    },
    true,
  );
  show("competitors", ({ of }) => {
    now = of;
    mark();
  });
}
