// Stands in viser's page before its own script. It says when the connection is lost, names the controls that viser
// leaves without a name, and lets keys act where they should.
(() => {
  // Tell the page around the frame; without one, the title says it.
  function connected(on) {
    document.title = on ? "race" : "race (disconnected)";
    if (parent !== window) parent.dispatchEvent(new parent.CustomEvent("scene-connection", { detail: on }));
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

  let again = 0; // waits to leave a box once more, unless a visitor chooses one meanwhile
  addEventListener("pointerdown", () => clearTimeout(again), true);

  // While a box has the focus the keys of the race do not act: Enter, Escape and a choice by mouse leave it.
  function leaveBox(event) {
    if ((event.key !== "Enter" && event.key !== "Escape") || !event.target.matches("input")) return;
    event.target.blur();
    // Drawn anew with another value, viser's box takes the focus back.
    again = setTimeout(() => event.target.blur(), 100);
  }

  addEventListener("DOMContentLoaded", () => {
    document.body.addEventListener("keydown", actInWindow);
    document.body.addEventListener("keydown", leaveBox);
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
      }, 200);
    }
    new MutationObserver(changed).observe(document.body, { childList: true, subtree: true });
    addEventListener("resize", changed);
  });
})();
