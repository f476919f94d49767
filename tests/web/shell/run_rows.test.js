// Claims about the rows of the table of runs.
import assert from "node:assert/strict";
import { test } from "node:test";
import { fits, lastRace, order } from "../../../web/page/shell/run_rows.js";

const COLUMNS = [{ key: "when" }, { key: "sampler" }, { key: "time" }];
const rows = [
  { name: "a", cells: { when: "10:00", sampler: "colored", time: 7.1 }, other_settings: "gusts 2", problem: "" },
  { name: "b", cells: { when: "11:00", sampler: "gaussian", time: null }, other_settings: "", problem: "" },
  { name: "c", cells: { when: "09:00", sampler: "colored 10", time: 6.9 }, other_settings: "", problem: "" },
  { name: "d", cells: { when: "12:00", sampler: null, time: null }, other_settings: "", problem: "no such file" },
];
const sorted = (key, down) =>
  [...rows]
    .sort(order({ key, down }))
    .map(({ name }) => name)
    .join("");

test("a row fits if it has each of the words, in a column or in its further settings", () => {
  const found = (...words) =>
    rows
      .filter((row) => fits(row, words, COLUMNS))
      .map(({ name }) => name)
      .join("");
  assert.equal(found("colored"), "ac");
  assert.equal(found("colored", "gusts"), "a");
  assert.equal(found("such"), "d");
  assert.equal(found(""), "abcd");
});

test("rows without a value and rows with a problem come last, whatever the direction", () => {
  assert.equal(sorted("time", false), "cabd");
  assert.equal(sorted("time", true), "acbd");
});

test("by time the rows with a problem stand among the others", () => {
  assert.equal(sorted("when", true), "dbac");
});

test("the last race has the last row and those of other competitors just before it, the last seed of each", () => {
  const row = (name, when, cells, vehicles = 1) => ({
    name,
    vehicles,
    problem: "",
    cells: { when: `2026-11-28 14:${when}`, course: "figure8", flown_by: "colored", numbers: "", ...cells },
  });
  const many = [
    row("a", "00:00", { flown_by: "gaussian" }), // minutes before
    row("b", "10:00", {}),
    row("c", "10:10", { flown_by: "gaussian" }),
    row("d", "10:20", {}),
    row("e", "10:30", { flown_by: "gaussian" }),
    row("f", "10:15", { course: "split_s" }),
  ];
  const found = (rows, most = 8) => lastRace(rows, most).map(({ name }) => name);
  assert.deepEqual(found(many), ["d", "e"]);
  assert.deepEqual(found(many, 1), ["e"]);
  assert.deepEqual(found([...many, row("g", "10:40", {}, 4)]), ["g"]);
  assert.deepEqual(found([{ ...many[0], problem: "damaged" }]), []);
});

test("numbers in texts count as numbers", () => {
  const many = [
    { name: "x", cells: { sampler: "s 10" } },
    { name: "y", cells: { sampler: "s 9" } },
  ];
  assert.deepEqual(
    many.sort(order({ key: "sampler", down: false })).map(({ name }) => name),
    ["y", "x"],
  );
});
