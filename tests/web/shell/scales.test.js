// Claims about scales, windows and values of charts.
import assert from "node:assert/strict";
import { test } from "node:test";
import * as scales from "../../../web/page/shell/scales.js";

const { extent, scale, search, ticks, valueAt, zoomed, zoomedInTime } = scales;
const near = (found, wanted) => assert.ok(Math.abs(found - wanted) < 1e-9, `${found} is not ${wanted}`);
const line = { name: "one", x: [0, 1, 2, 3], y: [5, 1, null, 8] };

test("a scale leads from values to pixels and back, also one of logarithms", () => {
  for (const isLog of [false, true]) {
    const found = scale(0.1, 100, 50, 350, isLog);
    near(found.at(0.1), 50);
    near(found.at(100), 350);
    for (const value of [0.5, 3, 70]) near(found.of(found.at(value)), value);
  }
  near(scale(0.1, 100, 50, 350, true).at(1), 150);
});

test("ticks are round numbers within the scale, and no more than asked for", () => {
  assert.deepEqual(ticks({ low: 0, high: 10 }, 5), [0, 2, 4, 6, 8, 10]);
  assert.deepEqual(
    ticks({ low: -0.3, high: 0.31 }, 4).map((v) => Number(v.toFixed(6))),
    [-0.2, 0, 0.2],
  );
  assert.deepEqual(ticks({ low: 0.4, high: 50, isLog: true }, 9), [1, 10]);
  for (const high of [0.7, 3, 29, 1234]) assert.ok(ticks({ low: 0, high }, 6).length <= 7);
});

test("the search finds the first value that is not less", () => {
  assert.deepEqual(
    [-1, 0, 0.5, 3, 4].map((v) => search(line.x, v)),
    [0, 0, 1, 3, 4],
  );
});

test("the range is that of the values in the window, and hidden lines do not count", () => {
  const chart = { lines: [line, { ...line, name: "two", y: [100, 100, 100, 100] }], window: [0, 1] };
  const [low, high] = extent(chart, new Set(["two"]));
  near(low, 1 - 0.06 * 4);
  near(high, 5 + 0.06 * 4);
  assert.ok(extent(chart, new Set())[1] > 100);
  assert.deepEqual(extent({ lines: [], window: [0, 1] }, new Set()), [0, 1]);
});

test("a zoom keeps the place under the pointer where it is", () => {
  for (const isLog of [false, true]) {
    const before = scale(1, 100, 0, 300, isLog);
    const after = scale(...zoomed([1, 100], 20, 0.5, isLog), 0, 300, isLog);
    near(after.at(20), before.at(20));
  }
});

test("a zoom over time ends at the longest span and begins no earlier than the race", () => {
  assert.deepEqual(zoomedInTime([1, 7], 4, 10, 20), { from: 0, span: 20 });
  near(zoomedInTime([1, 7], 4, 0.5, 20).from, 2.5);
  near(zoomedInTime([1, 1.1], 1, 0.1, 20).span, 0.1);
});

test("a value is that of the nearest point, and beyond the line there is none", () => {
  assert.equal(valueAt(line, 0.9, true), "1.000");
  assert.equal(valueAt(line, 9, true), "");
  assert.equal(valueAt({ ...line, y: [5, 1, null, null] }, 3, false), "1.000"); // over place, the last one
});
