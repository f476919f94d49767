// Claims about times that a visitor points at or types.
import assert from "node:assert/strict";
import { test } from "node:test";
import { shown, timeAt, typedTime } from "../../../web/page/shell/times.js";

const END = 9.3225; // the last frame of a flight, between two milliseconds
const line = { left: 100.4, width: 800.3 };

test("the last pixel of the line, and all that lies beyond, is the end", () => {
  for (const x of [899.8, 900, 901, 5000]) assert.equal(timeAt(x, line, END), END);
  assert.ok(timeAt(899, line, END) < END);
});

test("a place of the line is its share of the race, and left of it is the start", () => {
  assert.equal(timeAt(300, { left: 100, width: 800 }, END), END / 4);
  assert.equal(timeAt(3, line, END), 0);
});

test("a time is what was typed, and the end if it reads as the end or is later", () => {
  assert.equal(typedTime("1.25", END), 1.25);
  for (const text of ["99", shown(END), String(END), ` ${shown(END)} `]) assert.equal(typedTime(text, END), END);
  assert.equal(typedTime("9.31", END), 9.31);
});

test("what is no time names none", () => {
  for (const text of ["", " ", "-1", "abc", "Infinity"]) assert.equal(typedTime(text, END), null);
});
