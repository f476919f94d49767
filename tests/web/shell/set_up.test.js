// Claims about the set-up that a window keeps over a restart of the server.
import assert from "node:assert/strict";
import { test } from "node:test";
import { offered } from "../../../web/page/shell/set_up.js";

const after = (...seen) => {
  let [kept, offers] = [null, ""];
  for (const [server, set_up] of seen) ({ keep: kept, offers } = offered(kept, { server, set_up }));
  return offers;
};

test("a changed set-up is offered once after another start of the server", () => {
  assert.equal(after(["one", "usual"], ["one", "mine"], ["two", "usual"]), "mine");
  assert.equal(after(["one", "usual"], ["one", "mine"], ["two", "usual"], ["two", "usual"]), "");
});

test("a set-up that was not changed, that is there already, or that is too long for an address is not offered", () => {
  assert.equal(after(["one", "usual"], ["two", "other"]), "");
  assert.equal(after(["one", "usual"], ["one", "mine"], ["two", "mine"]), "");
  assert.equal(after(["one", "usual"], ["one", ""], ["two", "usual"]), "");
  assert.equal(after(["one", "usual"]), "");
});
