// Keys of the page and of the scene in its frame. Layers lie one over the other: a window, the table of runs, a
// flight by hand. A key goes to the highest layer, which takes it, leaves it to the element that has the focus, or
// passes it on to the layer beneath. What no layer keeps is a key of the page, after the elements.

export const TAKEN = "taken"; // no other layer gets the key
export const LEFT = "left"; // the element that has the focus gets it, and no layer beneath

const layers = []; // the highest one last; each: { down(event) and, if it wants to know, up(event) }
const left = new WeakSet(); // events that a layer has left to the element that has the focus
let ofPage = () => {};

// Lay a layer over the others.
export function over(layer) {
  leave(layer);
  layers.push(layer);
}

export function leave(layer) {
  const k = layers.indexOf(layer);
  if (k >= 0) layers.splice(k, 1);
}

// Name the function that gets the keys that no layer keeps.
export function setPage(key) {
  ofPage = key;
}

function down(event) {
  for (const layer of layers.toReversed()) {
    const end = layer.down(event);
    if (end === TAKEN) event.stopImmediatePropagation();
    if (end === LEFT) left.add(event);
    if (end) return;
  }
}

// A key that is let go may have been pressed before there was a layer over the one that knows it.
function up(event) {
  for (const layer of layers.toReversed()) if (layer.up?.(event) === TAKEN) event.stopImmediatePropagation();
}

// Listen for the keys of a window. The layers come before its elements, the page after them.
export function listen(window) {
  window.addEventListener("keydown", down, true);
  window.addEventListener("keyup", up, true);
  window.addEventListener("keydown", (event) => left.has(event) || ofPage(event));
}
