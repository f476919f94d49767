// Times of a race as they are shown, pointed at and typed, without a drawing: see timeline.js, and times.test.js.

export function shown(t) {
  return t.toFixed(2);
}

// The time at a place of a line that begins at `left` and ends with the race. The pointer stands for a whole pixel, so
// the last pixel is the end.
export function timeAt(x, { left, width }, end) {
  const share = (x - left) / width;
  return x + 1 >= left + width ? end : Math.max(share, 0) * end;
}

// The time that a text names; null: none. A time that reads as the end of the race is the end, which has more decimals.
export function typedTime(text, end) {
  const t = Number(text);
  if (!text.trim() || !Number.isFinite(t) || t < 0) return null;
  return t >= end || t === Number(shown(end)) ? end : t;
}
