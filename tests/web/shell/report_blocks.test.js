// Claims about the blocks of a report on the page.
import assert from "node:assert/strict";
import { before, test } from "node:test";
import { nodesOf } from "../../../web/page/shell/report_blocks.js";

class Node {
  children = [];
  append(...nodes) {
    this.children.push(...nodes);
  }
}

before(() => {
  globalThis.document = { createElement: (tag) => Object.assign(new Node(), { tag }) };
});

test("columns of text are left, columns of numbers right, and no cell is read as anything but text", () => {
  const block = { type: "table", head: ["a", "[m/s^2]", "why"], rows: [["<b>|*", "1", "-"]], texts: [0, 2] };
  const [{ children }] = nodesOf(block);
  const [[head], [row]] = children.map((part) => part.children);
  assert.deepEqual(
    head.children.map((cell) => cell.textContent),
    ["a", "[m/s²]", "why"],
  );
  assert.deepEqual(
    row.children.map((cell) => [cell.tag, cell.textContent, cell.className]),
    [
      ["td", "<b>|*", ""],
      ["td", "1", "number"],
      ["td", "-", ""],
    ],
  );
});

test("a block that the page does not know shows nothing", () => {
  assert.deepEqual(nodesOf({ type: "picture", described: "paths" }), []);
});
