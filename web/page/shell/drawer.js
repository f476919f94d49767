// Whether the drawer of the settings is open.
const toggle = () => document.querySelector('[data-act="settings"]');

export const isOpen = () => document.body.classList.contains("settings");

export function open(on) {
  document.body.classList.toggle("settings", on);
  toggle().setAttribute("aria-expanded", String(on));
  dispatchEvent(new Event("resize")); // charts draw themselves
  // In a small window it stands below the time line.
  if (on) document.querySelector(".drawer").scrollIntoView({ block: "nearest" });
}
