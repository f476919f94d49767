// The head: who leads, by how much, what differs, and the state of the race, see head.py.
import { grown, make, say } from "./dom.js";
import { show } from "./parts.js";

const editing = document.querySelector(".editing");
const part = (name) => document.querySelector(`.head .${name}`);

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

export function begin() {
  show("head", (head) => {
    document.body.dataset.phase = head.phase;
    words(part("sentence"), head.sentence);
    say(part("differs"), head.differs);
    words(part("numbers"), head.numbers);
    say(part("state"), head.state);
    words(
      part("warnings"),
      head.warnings.map((text) => ({ text })),
    );
    editing.replaceChildren(...(head.more ? [grown(head.more)] : []));
    editing.hidden = !head.more;
  });
  show("now", (now) => {
    document.querySelector('[data-act="stop"]').disabled = !now.flying;
    document.querySelector('[data-act="restart"]').disabled = !now.race;
  });
}
