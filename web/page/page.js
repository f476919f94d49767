// Stands in viser's page before its own script. It says when the connection is lost, names the controls that viser
// leaves without a name, says which camera is on, lets keys act where they should, and shows the head-up display on a
// phone.
(() => {
  document.title = "race";
  const lost =
    "Disconnected: the page shows the last that arrived. It connects again by itself.";
  const status = document.createElement("div");
  status.setAttribute("role", "status");
  status.style.cssText =
    "position:fixed;left:50%;bottom:16px;transform:translateX(-50%);z-index:10000;padding:8px 16px;border-radius:6px;" +
    "background:#b3261e;color:#fff;font:600 15px sans-serif;display:none";

  function connected(on) {
    status.style.display = on ? "none" : "block";
    status.textContent = on ? "" : lost;
    document.title = on ? "race" : "race (disconnected)";
  }

  // The connection lives in viser's worker, which reports its state. viser asks it every second to connect, and each time
  // gives up the attempt before. After many failures a browser holds attempts back for up to 5 s: none would ever succeed
  // again. Here an attempt is left alone until it has ended, and the next one follows after a pause.
  const PAUSE = 1000; // [ms]
  window.Worker = class extends Worker {
    constructor(...where) {
      super(...where);
      this.addEventListener("message", ({ data }) => {
        if (data?.type !== "connected" && data?.type !== "closed") return;
        connected(data.type === "connected");
        clearTimeout(this.attempt);
        if (data.type === "closed") this.attempt = setTimeout(() => super.postMessage({ type: "retry" }), PAUSE);
      });
    }

    postMessage(data, ...more) {
      if (data?.type !== "retry") super.postMessage(data, ...more);
    }
  };

  const icons = { "list-search": "Commands", adjustments: "Connection", "adjustments-off": "Controls", "arrow-back": "Back" };

  function nameControls() {
    for (const label of document.querySelectorAll("label[for]")) {
      const row = label.closest("[class*=Flex-root]");
      for (const control of row ? row.querySelectorAll("input:not([type=hidden]), [role=slider]") : []) {
        if (!control.labels?.length) control.setAttribute("aria-label", label.textContent);
      }
    }
    for (const [icon, name] of Object.entries(icons)) {
      document.querySelectorAll(`button > .tabler-icon-${icon}, button .tabler-icon-${icon}`).forEach((svg) => {
        svg.closest("button").setAttribute("aria-label", name);
      });
    }
    document.querySelectorAll("button[class*=CloseButton]").forEach((close) => close.setAttribute("aria-label", "Close"));
    for (const input of document.querySelectorAll("input[value^='ws']")) input.setAttribute("aria-label", "Server");
    for (const arrow of document.querySelectorAll(".tabler-icon-chevron-up, .tabler-icon-chevron-down")) {
      const title = arrow.parentElement; // of a folder
      if (title.tagName !== "DIV" || !title.textContent.trim()) continue;
      title.setAttribute("aria-expanded", arrow.classList.contains("tabler-icon-chevron-up"));
      if (title.tabIndex === 0) continue;
      title.tabIndex = 0;
      title.setAttribute("role", "button");
      title.addEventListener("keydown", (event) => {
        if (event.key === "Enter" || event.key === " ") {
          event.preventDefault();
          title.click();
        }
      });
    }
    document.querySelectorAll("canvas:not([aria-label])").forEach((canvas) => {
      canvas.setAttribute("aria-label", "The course and the drones");
    });
  }

  // On a phone viser's sheet, which holds the head-up display, can be folded away: this copy stays.
  const head = document.createElement("div");
  head.className = "hud-copy";

  function copyHead() {
    const hud = document.querySelector(".hud");
    const shown = hud && getComputedStyle(head).display !== "none";
    if (shown && head.innerHTML !== hud.innerHTML) head.replaceChildren(...hud.cloneNode(true).childNodes);
  }

  // The buttons of the camera are everybody's. The mode is each visitor's own: the server tells it in a hidden text.
  function markCamera() {
    const mode = document.querySelector(".camera-mode")?.textContent;
    for (const label of document.querySelectorAll("label[for]")) {
      if (label.textContent !== "Camera") continue;
      for (const button of label.closest("[class*=Flex-root]").querySelectorAll("button")) {
        button.setAttribute("aria-pressed", button.textContent === mode);
      }
    }
  }

  // A press on the time line, or a drag along it, moves the replay; a flight that is on has to be paused first.
  function seek(event) {
    const line = event.target.closest?.(".race-timeline");
    if (!line || !(event.buttons & 1)) return;
    const { left, width } = line.getBoundingClientRect();
    const edge = Number(line.dataset.edge);
    const share = ((event.clientX - left) / width) * (1 + 2 * edge) - edge;
    const end = Number(line.dataset.end);
    window.race.send({ type: "seek", t: Math.min(Math.max(share, 0), 1) * end });
  }

  // Keys in a window act there alone. Escape, and a click beside it, press its last button, which closes it without effect.
  function pressLastButton(dialog) {
    [...dialog.querySelectorAll("button")].at(-1)?.click();
  }

  function actInWindow(event) {
    const dialogs = document.querySelectorAll(".mantine-Modal-content");
    if (!dialogs.length) return;
    event.stopPropagation();
    if (event.key === "Escape") pressLastButton(dialogs[dialogs.length - 1]);
  }

  // While a box has the focus the keys of the race do not act: Enter, Escape and a choice by mouse leave it.
  function leaveBox(event) {
    if ((event.key === "Enter" || event.key === "Escape") && event.target.matches("input")) event.target.blur();
  }

  addEventListener("DOMContentLoaded", () => {
    document.body.append(status, head);
    // Before viser, whose window would move with the pointer
    for (const kind of ["pointerdown", "pointermove"]) {
      document.body.addEventListener(kind, (event) => {
        if (event.target.closest?.(".race-timeline")) event.stopPropagation();
        seek(event);
      }, true);
    }
    document.body.addEventListener("keydown", actInWindow);
    document.body.addEventListener("keydown", leaveBox);
    // The space bar presses the button that has the focus; elsewhere it is the key for pause.
    document.body.addEventListener("keydown", (event) => {
      const pressed = event.target.closest("button, [role=button], [role=tab], [role=option]");
      if (pressed && event.key === " ") event.stopPropagation();
    });
    // Clicked with the mouse, a button keeps no focus: the space bar would press it again instead of pausing.
    document.body.addEventListener("click", (event) => {
      if (event.detail > 0) document.activeElement.closest("button, [role=button], [type=checkbox]")?.blur();
      if (event.target.closest("[role=option]")) document.activeElement.blur();
      const beside = event.target.closest(".mantine-Modal-root");
      if (beside && !event.target.closest(".mantine-Modal-content")) pressLastButton(beside);
    });
    let due = 0;
    function changed() {
      due ||= setTimeout(() => {
        due = 0;
        nameControls();
        markCamera();
        copyHead();
      }, 200);
    }
    new MutationObserver(changed).observe(document.body, { childList: true, subtree: true });
    addEventListener("resize", changed);
  });
})();
