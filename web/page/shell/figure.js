// A figure of a report in the page: dark as the page, and as large as it was drawn.
import { make } from "./dom.js";

const GROUND = 0.09; // lightness of white paper
const POWER = 1.6; // the higher, the lighter colours become

// The figure of a report: a click, or Enter, shows it as a whole, and again in its own size, in which its letters are
// as large as the page's texts.
export function figureOf({ name, figure }) {
  const image = make("img", { alt: `The figure of ${name}`, title: "click: as a whole, or in its own size" });
  const box = make("div", { className: "figure", tabIndex: 0 }, image);
  image.onclick = () => box.classList.toggle("whole");
  box.onkeydown = (event) => event.key === "Enter" && image.onclick();
  const drawn = new Image();
  drawn.onload = () => (image.src = darkened(drawn));
  drawn.src = figure;
  return box;
}

// The figure with lightness turned round, hue and saturation kept: light colours become no darker than middle ones.
function darkened(image) {
  const canvas = make("canvas", { width: image.naturalWidth, height: image.naturalHeight });
  const g = canvas.getContext("2d");
  g.drawImage(image, 0, 0);
  const pixels = g.getImageData(0, 0, canvas.width, canvas.height);
  const { data } = pixels;
  for (let i = 0; i < data.length; i += 4) {
    const [most, least] = [
      Math.max(data[i], data[i + 1], data[i + 2]) / 255,
      Math.min(data[i], data[i + 1], data[i + 2]) / 255,
    ];
    const light = (most + least) / 2;
    const chroma = most - least;
    const dark = 1 - (1 - GROUND) * light ** POWER;
    const perChroma = chroma ? (1 - Math.abs(2 * dark - 1)) / (1 - Math.abs(2 * light - 1)) : 0;
    for (let k = i; k < i + 3; k++) data[k] = 255 * (dark + perChroma * (data[k] / 255 - light));
  }
  g.putImageData(pixels, 0, 0);
  return canvas.toDataURL();
}
