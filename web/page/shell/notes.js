// Notices for some seconds, in the row above the time line, where they cover nothing; questions, the window of the
// keys, and the line that says that the connection is lost.
import { copy, make } from "./dom.js";
import * as keys from "./keys.js";
import { on, send } from "./link.js";

const SECONDS = { error: 10, crash: 6, lap: 6, info: 3 };
const MOST = 3; // notices at once
const place = document.querySelector(".notes");

export function note(kind, title, text = "") {
  const close = make("button", { type: "button", textContent: "×", ariaLabel: "Close" });
  const said = make("p", { title: text }, make("b", { textContent: title }), ` ${text}`);
  const found = make("div", { className: `note ${kind}` }, said, close);
  found.setAttribute("role", kind === "error" ? "alert" : "status");
  close.onclick = () => found.remove();
  // A text that is cut at two lines is read as a whole in a window.
  said.onclick = () =>
    said.scrollHeight > said.clientHeight + 1 &&
    openWindow(title, [make("p", { textContent: text })], [["Close", null]]);
  place.prepend(found);
  while (place.childElementCount > MOST) place.lastChild.remove();
  setTimeout(() => found.remove(), 1000 * SECONDS[kind]);
}

// A window over the page; Escape and a click beside it close it.
export function openWindow(title, content, answers) {
  const found = make("dialog", { className: "window" });
  const layer = { down: () => keys.LEFT };
  const buttons = answers.map(([text, act, className = ""]) =>
    make("button", {
      type: "button",
      textContent: text,
      className,
      onclick: () => {
        found.close();
        act?.();
      },
    }),
  );
  found.setAttribute("aria-label", title);
  found.append(make("h2", { textContent: title }), ...content, make("div", { className: "answers" }, ...buttons));
  found.addEventListener("close", () => {
    found.remove();
    keys.leave(layer);
  });
  found.addEventListener("click", (event) => event.target === found && found.close());
  document.body.append(found);
  found.showModal();
  keys.over(layer);
}

const LOST = "Disconnected: the page shows the last that arrived. It connects again by itself.";
const SILENT = "The server has not answered for some seconds: the page shows the last that arrived.";

// Say that the server is away; empty: it is not.
function sayAway(text) {
  const line = document.querySelector(".lost");
  line.hidden = !text;
  line.textContent = text;
  document.title = text ? "race (disconnected)" : "race";
}

export function begin() {
  on("shown", ({ kind, title, text }) => note(kind, title, text));
  on("question", ({ number, title, yes, no }) => {
    const confirm = () => send({ type: "confirm", number });
    openWindow(
      title,
      [],
      [
        [yes, confirm, "stop"],
        [no, null],
      ],
    );
  });
  for (const type of ["open", "heard"]) on(type, () => sayAway(""));
  on("close", () => sayAway(LOST));
  on("silent", () => sayAway(SILENT));
  on("address", ({ title, address, opens }) => {
    const whole = new URL(address, document.baseURI).href;
    const copied = make("button", {
      type: "button",
      textContent: "Copy the address",
      onclick: () => copy(whole, copied),
    });
    const what = make("p", { className: "note", textContent: opens });
    openWindow(title, [make("p", {}, make("code", { textContent: whole })), copied, what], [["Close", null]]);
  });
  on("download", ({ name, address }) => make("a", { href: `.${address}`, download: name }).click());
}
