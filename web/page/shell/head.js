// The head: who leads, by how much, what differs, and the state of the race, see head.py.
import { grown, make, say } from "./dom.js";
import { on } from "./link.js";
import { latest, show } from "./store.js";

const PATIENCE = 5000; // [ms] after which a START that shows nothing is given up
const BEGUN = ["building", "compiling", "planning"];
const ENDED = ["ended", "stopped"];
const editing = document.querySelector(".editing");
const button = document.querySelector('[data-act="start"]');
const part = (name) => document.querySelector(`.head .${name}`);
let waiting = 0; // timer while START is sent and the server says nothing of it
let before = 0; // number of the race when START was sent

function words(element, found) {
  const wanted = JSON.stringify(found);
  if (element.shown === wanted) return;
  element.shown = wanted;
  element.replaceChildren(
    ...found.map(({ text, colour }) => {
      const word = make(colour ? "b" : "span", { textContent: text });
      if (colour) word.style.color = colour;
      return word;
    }),
  );
}

function draw(head) {
  document.body.dataset.phase = head.phase;
  // A screen reader says how a race has ended, but not every change of the lead.
  part("sentence").ariaLive = ENDED.includes(head.phase) ? "polite" : "off";
  words(part("sentence"), head.sentence);
  say(part("differs"), head.differs);
  part("differs").title = head.differs; // may be cut in a small window
  words(part("numbers"), head.numbers);
  say(part("state"), head.state);
  part("state").title = head.state;
  words(
    part("warnings"),
    head.warnings.map((text) => ({ text })),
  );
  part("warnings").title = head.warnings.join(" · ");
  editing.replaceChildren(...(head.more ? [grown(head.more)] : []));
  editing.hidden = !head.more;
}

// START is sent: say so at once, until the server says what comes of it.
export function starting() {
  clearTimeout(waiting);
  waiting = setTimeout(answered, PATIENCE);
  before = latest("now")?.race;
  say(button, "starting");
  button.ariaBusy = "true";
  draw({
    phase: "building",
    sentence: [{ text: "START: sent to the server" }],
    numbers: [],
    warnings: [],
    differs: "",
    state: "",
  });
}

function answered() {
  clearTimeout(waiting);
  waiting = 0;
  say(button, "START");
  button.ariaBusy = "false";
  if (latest("head")) draw(latest("head"));
}

export function begin() {
  show("head", (head) => {
    if (waiting && BEGUN.includes(head.phase)) answered();
    else if (!waiting) draw(head);
  });
  show("now", (now) => {
    if (waiting && now.race !== before) answered();
    document.querySelector('[data-act="stop"]').disabled = !now.flying;
    document.querySelector('[data-act="restart"]').disabled = !now.race;
  });
  show("next", ({ problem, sentence }) => {
    part("next").classList.toggle("error", problem !== "");
    words(part("next"), problem ? [{ text: `START cannot fly this: ${problem}` }] : sentence);
    part("next").title = part("next").textContent;
  });
  // A START that is refused or asks back shows a notice or a question.
  on("shown", ({ kind }) => waiting && kind === "error" && answered());
  on("question", () => waiting && answered());
  for (const type of ["close", "silent"])
    on(type, () => {
      if (waiting) answered();
      say(part("state"), "the server is away");
    });
  on("heard", () => latest("head") && draw(latest("head")));
}
