// Claims about the store of what the server says.
import assert from "node:assert/strict";
import { test } from "node:test";
import { latest, put, show } from "../../../web/page/shell/store.js";

test("who shows a part is told what it is, at once and whenever it changes", () => {
  const told = [];
  show("head", (head) => told.push(head));
  assert.deepEqual([told, latest("head")], [[], undefined]);
  put("head", 1);
  show("head", (head) => told.push(10 * head));
  put("head", 2);
  assert.deepEqual([told, latest("head")], [[1, 10, 2, 20], 2]);
});

test("a function can take the place of those before it", () => {
  const told = [];
  show("race", () => told.push("old"));
  show("race", () => told.push("new"), true);
  put("race", {});
  assert.deepEqual(told, ["new"]);
});
