// Claims about the value that a field shows, in each of its states.
import assert from "node:assert/strict";
import { test } from "node:test";
import { FieldValue, text } from "../../../web/page/shell/field_value.js";

function fieldOf(value, of = 1) {
  const field = new FieldValue();
  field.turnTo(of);
  assert.equal(field.receive(value), true); // at first
  return field;
}

test("at rest a field shows each new value of the server, and is left alone while it is the same", () => {
  const field = fieldOf(1);
  assert.equal(field.receive(1), false);
  assert.equal(field.receive(2), true);
  assert.equal(field.value, 2);
});

test("what is typed stays in sight, whatever the server says", () => {
  const field = fieldOf(1);
  field.isTyped = true;
  assert.equal(field.receive(2), false);
  assert.equal(field.value, 2); // which Escape shows
});

test("what was sent stays in sight until the server's value changes", () => {
  const field = fieldOf(1);
  field.isTyped = true;
  field.send();
  assert.equal(field.isSent, true);
  assert.equal(field.receive(1), false);
  assert.equal(field.isSent, true);
  assert.equal(field.receive(3), true); // also if the server took another one
  assert.equal(field.isSent, false);
  assert.equal(field.receive(3), false);
});

test("what was sent is given up with forget, and the server's value counts again", () => {
  const field = fieldOf(1);
  field.send();
  field.forget();
  assert.deepEqual([field.isSent, field.isTyped, field.value], [false, false, 1]);
  assert.equal(field.receive(1), false);
});

test("of another row the value is shown though it is the same, and what was typed is dropped", () => {
  const field = fieldOf(1, 1);
  assert.equal(field.turnTo(1), false);
  field.isTyped = true;
  assert.equal(field.turnTo(2), true);
  assert.equal(field.receive(1), true);
});

test("a number is the same as its text, and has no digits that nobody meant", () => {
  assert.equal(text(0.1 + 0.2), "0.3");
  assert.equal(fieldOf(2).receive("2"), false);
});
