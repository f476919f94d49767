// Stands in viser's page before its own script. What is typed into a box counts on Enter or when the box is left, and as a
// whole: viser would take every key, so that "1024" began as 1, and would refuse or bound what is out of range without a word.
(() => {
  const NUMBER = ".mantine-NumberInput-input";
  const BOXES = `${NUMBER}, .mantine-TextInput-input`;
  const SECONDS = 8;
  const setValue = Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, "value").set;
  const notice = document.createElement("div");
  notice.setAttribute("role", "alert");
  notice.style.cssText =
    "position:fixed;left:50%;bottom:64px;transform:translateX(-50%);z-index:10000;padding:8px 16px;border-radius:6px;" +
    "background:#8a3a00;color:#fff;font:600 15px sans-serif;display:none";
  let hidden = 0;
  let passes = false; // whether viser is to see what is typed

  function say(text) {
    notice.textContent = text;
    notice.style.display = "block";
    clearTimeout(hidden);
    hidden = setTimeout(() => (notice.style.display = "none"), 1000 * SECONDS);
  }

  // What was typed and does not count yet: drawing a box anew, viser writes the value that counts over it.
  const typed = new WeakMap();

  // React keeps the value that counts as the box's default value.
  const counts = (box) => box.defaultValue;

  // Why a number cannot be taken; empty: it can. viser does not disable the box of a slider that is disabled.
  function problem(box, text) {
    const label = box.labels?.[0]?.textContent || box.getAttribute("aria-label") || "";
    const [, name, unit] = label.match(/^(.*?)(?: \[(.+)\])?$/);
    const slider = box.closest("[class*=Flex-root]")?.querySelector("[role=slider]");
    if (slider?.getAttribute("aria-disabled") === "true") return `${name} cannot be changed now; it stays ${counts(box)}`;
    const number = Number(text);
    let range = "";
    if (slider) range = ` from ${slider.getAttribute("aria-valuemin")} to ${slider.getAttribute("aria-valuemax")}`;
    const beyond = slider && (number < slider.getAttribute("aria-valuemin") || number > slider.getAttribute("aria-valuemax"));
    if (text !== "" && Number.isFinite(number) && !beyond) return "";
    return `${name}: expected a number${range}${unit ? ` ${unit}` : ""}, got ${text || "nothing"}; it stays ${counts(box)}`;
  }

  function commit(box) {
    const raw = typed.get(box) ?? box.value;
    typed.delete(box);
    if (raw === counts(box)) return;
    let text = raw.trim();
    if (box.matches(NUMBER)) {
      const wrong = problem(box, text);
      if (wrong) {
        setValue.call(box, counts(box));
        say(wrong);
        return;
      }
      text = String(Number(text)); // .5 as 0.5, 1e3 as 1000
    }
    setValue.call(box, text);
    passes = true;
    box.dispatchEvent(new Event("input", { bubbles: true }));
    passes = false;
  }

  const boxOf = (event) => (event.target instanceof HTMLInputElement && event.target.matches(BOXES) ? event.target : null);

  for (const kind of ["input", "change"]) {
    addEventListener(
      kind,
      (event) => {
        const box = !passes && boxOf(event);
        if (!box) return;
        event.stopPropagation();
        if (kind === "input") typed.set(box, box.value);
      },
      true,
    );
  }
  addEventListener(
    "beforeinput",
    (event) => {
      const box = boxOf(event);
      if (box && typed.has(box) && box.value !== typed.get(box)) setValue.call(box, typed.get(box));
    },
    true,
  );
  // Before the focus goes: viser's box takes the focus back when its number changes, and forgets the number when it goes.
  addEventListener(
    "pointerdown",
    ({ target }) => {
      const box = document.activeElement;
      if (box !== target && box?.matches(BOXES)) commit(box);
    },
    true,
  );
  addEventListener(
    "focusout",
    (event) => {
      const box = boxOf(event);
      if (box && typed.has(box)) setTimeout(() => commit(box));
    },
    true,
  );
  addEventListener(
    "keydown",
    (event) => {
      const box = boxOf(event);
      if (!box) return;
      // viser's box takes the last key for the whole change, and would refuse the number.
      if (event.key.length === 1 || ["Backspace", "Delete"].includes(event.key)) event.stopPropagation();
      if (["Enter", "Tab", "ArrowUp", "ArrowDown"].includes(event.key)) commit(box);
      if (event.key === "Escape") {
        typed.delete(box);
        setValue.call(box, counts(box));
      }
    },
    true,
  );
  addEventListener("DOMContentLoaded", () => document.body.append(notice));
})();
// A click on a row of the table of competitors presses the button of its number, which stands beside "add" and "remove".
addEventListener("click", (event) => {
  const row = event.target instanceof Element && event.target.closest("[data-row]");
  if (!row) return;
  const buttons = [...document.querySelectorAll("button")];
  const group = buttons.find((button) => ["add", "remove"].includes(button.textContent))?.parentElement;
  buttons.find((button) => button.parentElement === group && button.textContent === row.dataset.row)?.click();
});
