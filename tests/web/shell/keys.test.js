// Claims about the layers of keys.
import assert from "node:assert/strict";
import { beforeEach, test } from "node:test";
import * as keys from "../../../web/page/shell/keys.js";

let got = [];
const target = new EventTarget();
keys.listen(target);
keys.setPage(({ key }) => got.push(`page ${key}`));

function press(key, type = "keydown") {
  got = [];
  target.dispatchEvent(Object.assign(new Event(type, { cancelable: true }), { key }));
  return got;
}

function layerOf(name, end) {
  const told = (way) => (event) => {
    got.push(`${name} ${way}${event.key}`);
    return end;
  };
  return { down: told(""), up: told("up ") };
}

const open = [];
function over(layer) {
  open.push(layer);
  keys.over(layer);
}

beforeEach(() => {
  while (open.length) keys.leave(open.pop());
});

test("without a layer a key is the page's", () => {
  assert.deepEqual(press("x"), ["page x"]);
});

test("the highest layer gets a key first, and passes it on to those beneath and to the page", () => {
  over(layerOf("low", null));
  over(layerOf("high", null));
  assert.deepEqual(press("x"), ["high x", "low x", "page x"]);
});

test("a key that a layer takes reaches nobody else", () => {
  let isHeard = false;
  over(layerOf("high", keys.TAKEN));
  const hear = () => {
    isHeard = true;
  };
  target.addEventListener("keydown", hear);
  assert.deepEqual(press("x"), ["high x"]);
  assert.equal(isHeard, false);
  target.removeEventListener("keydown", hear);
});

test("a key that is left to the element with the focus reaches it, but no layer beneath and not the page", () => {
  over(layerOf("low", null));
  over(layerOf("high", keys.LEFT));
  let isHeard = false;
  const hear = () => {
    isHeard = true;
  };
  target.addEventListener("keydown", hear);
  assert.deepEqual(press("x"), ["high x"]);
  assert.equal(isHeard, true);
  target.removeEventListener("keydown", hear);
});

test("a layer that is left gets no keys, and one that is laid again is the highest", () => {
  const [first, second] = [layerOf("first", null), layerOf("second", null)];
  over(first);
  over(second);
  over(first);
  assert.deepEqual(press("x"), ["first x", "second x", "page x"]);
  keys.leave(first);
  assert.deepEqual(press("x"), ["second x", "page x"]);
});

test("a key that is let go is told to each layer, as it may have been pressed before a higher one was there", () => {
  over(layerOf("low", keys.TAKEN));
  over(layerOf("high", keys.LEFT));
  assert.deepEqual(press("x", "keyup"), ["high up x", "low up x"]);
});
