// Elements by name, and the trees of tree.py. Whatever is shown is set as text, never parsed as HTML.
const SVG = "http://www.w3.org/2000/svg";
const TAGS = new Set(
  "div span b i p br code img table tbody thead tr th td svg g line rect circle polygon polyline path text title button".split(
    " ",
  ),
);
// The parser of tree.py writes names in lower case.
const NAMES = { viewbox: "viewBox", preserveaspectratio: "preserveAspectRatio" };
const ATTRIBUTES = new Set(
  (
    "class title alt colspan viewbox preserveaspectratio x y x1 x2 y1 y2 cx cy r width height d points fill stroke " +
    "stroke-width stroke-dasharray stroke-linecap opacity text-anchor font-size font-weight"
  ).split(" "),
);
// Sizes and families of letters are those of the page.
const STYLES = new Set(
  (
    "color background opacity text-align width height flex display gap align-items justify-content flex-wrap position left top margin " +
    "margin-top margin-bottom border-radius overflow white-space word-break font-weight text-transform letter-spacing font-variant-numeric"
  ).split(" "),
);

export function make(tag, properties = {}, ...children) {
  const found = Object.assign(document.createElement(tag), properties);
  found.append(...children);
  return found;
}

// Text into an element, only where it differs: a drawn text is not touched.
export function say(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

// Copy a text, also where the page has no clipboard as it is not served from this machine, and say so on the button.
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

// The elements of a tree.
export function grown(node, inSvg = false) {
  if (typeof node === "string") return document.createTextNode(node);
  if (!TAGS.has(node.tag)) return document.createTextNode("");
  const drawing = inSvg || node.tag === "svg";
  const found = drawing ? document.createElementNS(SVG, node.tag) : document.createElement(node.tag);
  for (const [name, value] of Object.entries(node.attributes)) {
    if (name === "style") styled(found, value);
    else if (name === "src" && value.startsWith("data:image/")) found.src = value;
    else if (ATTRIBUTES.has(name)) found.setAttribute(NAMES[name] ?? name, value);
  }
  found.append(...node.children.map((child) => grown(child, drawing)));
  return found;
}

function styled(element, text) {
  for (const rule of text.split(";")) {
    const colon = rule.indexOf(":");
    const name = rule.slice(0, colon).trim();
    if (STYLES.has(name)) element.style.setProperty(name, rule.slice(colon + 1).trim());
  }
}
