// The blocks of a report, see quadsim/campaign/document.py. Its figure stands above them.
import { make } from "./dom.js";

export function nodesOf(block) {
  switch (block.type) {
    case "heading":
      return [make("h3", { textContent: block.text }), make("p", { textContent: block.detail })];
    case "line":
    case "note":
      return [make("p", { textContent: `• ${block.text}` })];
    case "table":
      return [tableOf(block)];
    default:
      return [];
  }
}

function tableOf({ head, rows, texts }) {
  const cell = (tag) => (text, column) =>
    make(tag, { textContent: text.replaceAll("^2", "²"), className: texts.includes(column) ? "" : "number" });
  const row = (tag) => (cells) => make("tr", {}, ...cells.map(cell(tag)));
  return make("table", {}, make("thead", {}, row("th")(head)), make("tbody", {}, ...rows.map(row("td"))));
}
