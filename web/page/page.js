// Stands in viser's page before its own script. It says when the connection is lost, names the controls that viser
// leaves without a name, and shows the head-up display on a phone.
(() => {
  document.title = "race";
  const lost =
    "Disconnected: the page shows the last that arrived. It connects again by itself while it has the focus.";
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

  // The connection lives in viser's worker, which reports its state.
  window.Worker = class extends Worker {
    constructor(...where) {
      super(...where);
      this.addEventListener("message", ({ data }) => {
        if (data?.type === "connected" || data?.type === "closed") connected(data.type === "connected");
      });
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

  addEventListener("DOMContentLoaded", () => {
    document.body.append(status, head);
    // The space bar presses the button that has the focus; elsewhere it is the key for pause.
    document.body.addEventListener("keydown", (event) => {
      const pressed = event.target.closest("button, [role=button], [role=tab], [role=option]");
      if (pressed && event.key === " ") event.stopPropagation();
    });
    // Clicked with the mouse, a button keeps no focus: the space bar would press it again instead of pausing.
    document.body.addEventListener("click", (event) => {
      if (event.detail > 0) document.activeElement.closest("button, [role=button]")?.blur();
    });
    let due = 0;
    function changed() {
      due ||= setTimeout(() => {
        due = 0;
        nameControls();
        copyHead();
      }, 200);
    }
    new MutationObserver(changed).observe(document.body, { childList: true, subtree: true });
    addEventListener("resize", changed);
  });
})();
