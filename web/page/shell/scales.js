// Scales, windows and values of charts, without a drawing: see charts.js, and scales.test.js.

// A scale from values to pixels and back.
export function scale(low, high, from, to, isLog) {
  const value = isLog ? Math.log10 : (v) => v;
  const back = isLog ? (v) => 10 ** v : (v) => v;
  const [a, b] = [value(low), value(high)];
  const perUnit = (to - from) / (b - a || 1);
  return { at: (v) => from + (value(v) - a) * perUnit, of: (px) => back(a + (px - from) / perUnit), low, high, isLog };
}

export function ticks({ low, high, isLog }, most) {
  if (isLog) {
    const all = [];
    for (let p = Math.ceil(Math.log10(low)); p <= Math.log10(high); p++) all.push(10 ** p);
    return all;
  }
  const rough = (high - low) / most;
  const power = 10 ** Math.floor(Math.log10(rough || 1));
  const step = [1, 2, 5, 10].map((k) => k * power).find((s) => s >= rough) ?? power;
  const found = [];
  for (let v = Math.ceil(low / step) * step; v <= high + 1e-9; v += step) found.push(Math.round(v / step) * step);
  return found;
}

// Index of the first value that is not less.
export function search(values, wanted) {
  let [low, high] = [0, values.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (values[middle] < wanted) low = middle + 1;
    else high = middle;
  }
  return low;
}

export function rowsIn(line, [from, to]) {
  return [
    Math.max(search(line.x, from) - 1, 0),
    Math.min(search(line.x, to) + 1, Math.min(line.x.length, line.y.length)),
  ];
}

// The range of the values that are in the window of a chart, with some room; `hidden`: names of lines that do not
// count.
export function extent(chart, hidden) {
  let [low, high] = [Infinity, -Infinity];
  for (const line of chart.lines) {
    if (hidden.has(line.name)) continue;
    const [first, last] = rowsIn(line, chart.window);
    for (let i = first; i < last; i++) {
      const y = line.y[i];
      if (y === null) continue;
      if (y < low) low = y;
      if (y > high) high = y;
    }
  }
  if (low > high) return chart.isLog ? [0.01, 1] : [0, 1];
  if (chart.isLog) return [low / 1.5, high * 1.5];
  const pad = 0.06 * (high - low) || 0.5;
  return [low - pad, high + pad];
}

export function text(value) {
  return String(Number(value.toPrecision(6)));
}

// The value of a line at a place, from the nearest of its points; empty: the line has no value there.
export function valueAt(line, at, isExact) {
  // Over place, a line that ends before the place of the race has its last value.
  const last = line.y.findLastIndex((value) => value !== null);
  const x = isExact || last < 0 ? at : Math.min(at, line.x[last]);
  const i = search(line.x, x);
  const near = i > 0 && (i >= line.x.length || x - line.x[i - 1] < line.x[i] - x) ? i - 1 : i;
  const beyond = x < line.x[0] - 0.02 || x > line.x.at(-1) + 0.02;
  // The last point of a line stands for the places up to the next one.
  const value = line.y[near] ?? line.y[near - 1];
  return beyond || value === null || value === undefined ? "" : value.toFixed(Math.abs(value) < 10 ? 3 : 1);
}

// A window that is wider by a factor, about a place that stays where it is.
export function zoomed([low, high], at, factor, isLog) {
  const [way, back] = isLog ? [Math.log, Math.exp] : [(v) => v, (v) => v];
  const [a, b, c] = [way(low), way(high), way(at)];
  return [back(c - (c - a) * factor), back(c + (b - c) * factor)];
}

// The same over time: no shorter than a tenth of a second, no longer than a longest span, and not before the start.
export function zoomedInTime([low, high], at, factor, longest) {
  const span = Math.min(Math.max((high - low) * factor, 0.1), longest);
  return { from: Math.max(at - ((at - low) * span) / (high - low), 0), span };
}
