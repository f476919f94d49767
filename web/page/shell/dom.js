// Elements by name, and the elements that elements.py describes. All text is set as text, never parsed as HTML.
const SVG = "http://www.w3.org/2000/svg";
// What elements.py writes, and nothing that acts
const TAGS = new Set("div span b i img table tr th td svg g line rect circle polygon polyline text title".split(" "));
const ATTRIBUTES = new Set(
  "class alt colspan viewBox preserveAspectRatio x y x1 x2 y1 y2 cx cy r width height points stroke-dasharray".split(
    " ",
  ),
);

export function make(tag, properties = {}, ...children) {
  const found = Object.assign(document.createElement(tag), properties);
  found.append(...children);
  return found;
}

// Set the text of an element only if it differs: a drawn text is not touched.
export function say(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

// Copy a text and say so on the button, also if the page has no clipboard because another machine serves it.
export async function copy(text, button) {
  try {
    await navigator.clipboard.writeText(text);
  } catch {
    const box = make("textarea", { value: text });
    document.body.append(box);
    box.select();
    document.execCommand("copy");
    box.remove();
  }
  const before = button.textContent;
  button.textContent = "copied";
  setTimeout(() => (button.textContent = before), 1500);
}

// A line in the dashes of a competitor, as the background of an element of this width.
const LONG = 18; // [px]
export function dashed(element, colour, dash) {
  const key = `${colour} ${dash}`;
  if (element.shown === key) return;
  element.shown = key;
  let x = 0;
  const stops = [];
  const lengths = dash.length ? dash : [LONG];
  for (let k = 0; x < LONG; k++) {
    const end = Math.min(x + lengths[k % lengths.length], LONG);
    stops.push(`${k % 2 ? "transparent" : colour} ${x}px ${end}px`);
    x = end;
  }
  element.style.background = `linear-gradient(90deg, ${stops.join(", ")}) 0 50% / ${LONG}px 3px no-repeat`;
}

// The nodes of an element of elements.py.
export function grown(node, inSvg = false) {
  if (typeof node === "string") return document.createTextNode(node);
  if (!TAGS.has(node.tag)) return document.createTextNode("");
  const drawing = inSvg || node.tag === "svg";
  const found = drawing ? document.createElementNS(SVG, node.tag) : document.createElement(node.tag);
  for (const [name, value] of Object.entries(node.attributes ?? {})) {
    if (name === "src" && value.startsWith("data:image/")) found.src = value;
    else if (ATTRIBUTES.has(name)) found.setAttribute(name, value);
  }
  for (const [name, value] of Object.entries(node.values ?? {})) found.style.setProperty(`--${name}`, value);
  found.append(...(node.children ?? []).map((child) => grown(child, drawing)));
  return found;
}
