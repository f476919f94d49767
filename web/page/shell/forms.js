// The drawer of settings: groups that fold, and in each the fields that the server describes, see forms.py. What is
// typed counts on Enter or when the box is left, and as a whole; what the server cannot take, it says in a line
// beside the field.
import { grown, make, say } from "./dom.js";
import { FieldValue, text } from "./field_value.js";
import * as lineUp from "./line_up.js";
import { on, send } from "./link.js";
import { alsoShows, ask } from "./parts.js";
import { show } from "./store.js";

const REST = 500; // [ms] for which a number in flight has to rest, so that keys held down are one change
// In which a value that was sent has to come back [ms]; else the server's own is shown again. One in flight acts at a
// plan.
const PATIENCE = 1500;
const PATIENCE_IN_FLIGHT = 6000;
const LONGEST_FILE = 40000; // of what the server takes, see BringFile in forms.py [characters]
const LONGEST_NAME = 100; // of a file [characters]
const drawer = document.querySelector(".drawer");
const groups = {}; // by name: its element, and its fields by name

// Parts that stand in a group beside its fields.
const BESIDE = { competitors: ["line_up"], view: ["picture"] };

const isOpen = () => document.body.classList.contains("settings");
const shownGroups = () => Object.entries(groups).filter(([, group]) => isOpen() && group.element.open);

// The groups

function drawGroups(found) {
  drawer.replaceChildren(...found.map(groupOf));
}

function groupOf({ name, title, is_open }) {
  const fields = make("div", { className: "fields" });
  const beside = make("div", { className: "beside" });
  const parts = name === "competitors" ? [beside, fields] : [fields, beside];
  const element = make(
    "details",
    { className: "group", open: is_open },
    make("summary", { textContent: title }),
    ...parts,
  );
  element.dataset.form = name;
  groups[name] = { name, element, place: fields, beside, fields: {}, of: 0, order: "" };
  return element;
}

function drawForm(name, { fields, of }) {
  const group = groups[name];
  if (!group) return;
  group.of = of;
  // A fold keeps its state, and a field its focus, as long as the fields are the same ones.
  const order = fields.map((field) => `${field.group ?? ""} ${field.kind} ${field.name}`).join("\n");
  if (order !== group.order) {
    group.order = order;
    build(group, fields);
  }
  for (const field of fields) update(group.fields[field.name], { value: "", ...field }, of);
}

// Set up the fields of a group anew; a field that is there already stays the same element.
function build(group, fields) {
  const before = group.fields;
  group.fields = {};
  const focus = document.activeElement;
  const folds = {};
  for (const fold of group.place.querySelectorAll("details")) folds[fold.dataset.title] = fold;
  const placed = new Map([[group.place, []]]);
  let row = null;
  for (const field of fields) {
    const old = before[field.name];
    const made = old?.kind === field.kind ? old : CONTROLS[field.kind](group, field);
    made.kind = field.kind;
    made.state ??= new FieldValue();
    group.fields[field.name] = made;
    const place = field.group ? (folds[field.group] ??= foldOf(field.group)) : group.place;
    if (!placed.has(place)) {
      placed.set(place, []);
      placed.get(group.place).push(place);
    }
    // Buttons in a row stand side by side.
    if (!["button", "file"].includes(field.kind)) row = null;
    else if (!row) placed.get(place).push((row = make("div", { className: "buttons" })));
    (row ?? { append: (element) => placed.get(place).push(element) }).append(made.element);
  }
  for (const [place, elements] of placed) {
    const head = place === group.place ? [] : [place.firstElementChild];
    place.replaceChildren(...head, ...elements);
  }
  if (group.place.contains(focus) && document.activeElement !== focus) focus.focus();
}

function foldOf(title) {
  const fold = make("details", { className: "fold" }, make("summary", { textContent: title }));
  fold.dataset.title = title;
  return fold;
}

// The fields. Each is an element, what shows a value, and what has been typed and does not count yet.

function update(made, field, of) {
  if (made.state.turnTo(of)) {
    stopWaiting(made);
    fail(made, "");
  }
  made.describe?.(field);
  const shows = made.state.receive(field.value);
  if (!made.state.isSent) clearTimeout(made.waiting);
  if (shows) made.show?.(field.value);
}

function stopWaiting(made) {
  clearTimeout(made.waiting);
  clearTimeout(made.resting);
}

// Send a value; until it comes back, or it is refused, what was chosen stays in sight.
function commit(group, made, field, value) {
  made.state.send();
  fail(made, "");
  send({ type: "set_field", form: group.name, field: field.name, value, of: made.state.of });
  clearTimeout(made.waiting);
  made.waiting = setTimeout(() => restore(made), made.rests ? PATIENCE_IN_FLIGHT : PATIENCE);
}

// Show the value that counts.
function restore(made) {
  stopWaiting(made);
  made.state.forget();
  made.show?.(made.state.value);
}

function fail(made, problem) {
  if (!made.error) return;
  say(made.error, problem);
  made.error.hidden = !problem;
  for (const control of made.controls) control.ariaInvalid = problem ? "true" : null;
}

let last = 0; // of ids

function fieldOf(field, ...controls) {
  const id = `field-${++last}`;
  const label = make("label", { htmlFor: id });
  const error = make("p", { id: `${id}-error`, className: "error", hidden: true });
  error.setAttribute("role", "alert");
  controls[0].id = id;
  for (const control of controls) control.setAttribute("aria-describedby", error.id);
  const element = make("div", { className: `field ${field.kind}` }, label, ...controls, error);
  element.dataset.field = field.name;
  const made = { element, label, error, controls };
  made.describe = ({ label: name, unit, help, is_enabled }) => {
    const named = unit ? `${name} [${unit}]` : name;
    say(label, named);
    element.title = help ?? "";
    for (const control of controls) control.disabled = is_enabled === false;
    for (const control of controls.slice(1)) control.ariaLabel = named;
  };
  return made;
}

// A box that is typed into: Enter and leaving it make it count, Escape takes it back.
function typedBox(made, box, act) {
  box.addEventListener("input", () => (made.state.isTyped = true));
  box.addEventListener("change", () => {
    if (text(made.state.value) === box.value) made.state.isTyped = false;
    else act(box.value);
  });
  box.addEventListener("keydown", (event) => {
    if (event.key === "Escape") restore(made);
    if (event.key === "Enter" || event.key === "Escape") box.blur();
  });
}

// Clicked with the mouse, a control keeps no focus: keys act on the page again.
function leave(control) {
  if (!control.matches(":focus-visible")) control.blur();
}

function boxField(group, field) {
  const box = make("input", { autocomplete: "off", spellcheck: false });
  if (field.kind === "number") box.inputMode = "decimal";
  const made = fieldOf(field, box);
  const { describe } = made;
  made.describe = (found) => {
    describe(found);
    box.placeholder = found.instead ?? "";
    made.step = found.step ?? 0;
  };
  made.show = (value) => (box.value = text(value));
  typedBox(made, box, (value) => commit(group, made, field, value));
  box.addEventListener("keydown", (event) => {
    const by = { ArrowUp: 1, ArrowDown: -1 }[event.key];
    if (!by || !made.step) return;
    event.preventDefault();
    box.value = text((Number(box.value) || 0) + by * made.step);
    commit(group, made, field, box.value);
  });
  return made;
}

function sliderField(group, field) {
  const range = make("input", { type: "range" });
  const box = make("input", { className: "typed", inputMode: "decimal", autocomplete: "off" });
  const made = fieldOf(field, box, range);
  const { describe } = made;
  made.describe = (found) => {
    describe(found);
    for (const name of ["min", "max", "step"]) {
      const value = String({ min: found.low, max: found.high, step: found.step }[name]);
      if (range[name] !== value) range[name] = value;
    }
    made.rests = found.rests;
  };
  made.show = (value) => {
    box.value = text(value);
    range.value = value;
  };
  typedBox(made, box, (value) => commit(group, made, field, value));
  range.addEventListener("input", () => {
    made.state.isTyped = true;
    box.value = text(Number(range.value));
  });
  range.addEventListener("change", () => {
    clearTimeout(made.resting);
    made.resting = setTimeout(() => commit(group, made, field, Number(range.value)), made.rests ? REST : 0);
    leave(range);
  });
  return made;
}

function choiceField(group, field) {
  const select = make("select");
  const made = fieldOf(field, select);
  const { describe } = made;
  let offered = "";
  made.describe = (found) => {
    describe(found);
    const wanted = JSON.stringify(found.choices);
    if (wanted === offered) return;
    offered = wanted;
    select.replaceChildren(...(found.choices ?? []).map((value) => new Option(short(value), value)));
    made.state.isShown = false;
  };
  made.show = (value) => {
    // A value that is not offered any more stays in sight.
    if (![...select.options].some((option) => option.value === value)) select.append(new Option(short(value), value));
    select.value = value;
    select.title = value;
  };
  select.addEventListener("change", () => {
    commit(group, made, field, select.value);
    leave(select);
  });
  return made;
}

// A path is named by its file, which the whole of it stands behind.
const short = (value) => (value.includes("/") ? value.split("/").at(-1) : value);

function checkField(group, field) {
  const box = make("input", { type: "checkbox" });
  const made = fieldOf(field, box);
  made.show = (value) => (box.checked = value);
  box.addEventListener("change", () => {
    commit(group, made, field, box.checked);
    leave(box);
  });
  return made;
}

function buttonField(group, field) {
  const button = make("button", { type: "button" });
  const made = { element: button, controls: [button] };
  made.describe = ({ label, help, is_enabled, tone }) => {
    say(button, label);
    button.title = help ?? "";
    button.disabled = is_enabled === false;
    button.classList.toggle("main", tone === "main");
  };
  button.dataset.field = field.name;
  button.onclick = () => {
    group.problem?.remove();
    send({ type: "press", form: group.name, field: field.name, of: made.state.of });
  };
  return made;
}

// A button that opens a file of the visitor's machine and sends its text.
function fileField(group, field) {
  const made = buttonField(group, field);
  const box = make("input", { type: "file", accept: ".yaml,.yml" });
  made.element.onclick = () => box.click();
  box.onchange = async () => {
    const [file] = box.files;
    if (!file) return;
    group.problem?.remove();
    if (file.size > LONGEST_FILE) return complain(group, made, `expected a file of ${LONGEST_FILE} bytes at most`);
    send({
      type: "bring_file",
      form: group.name,
      field: field.name,
      name: file.name.slice(-LONGEST_NAME),
      text: await file.text(),
      of: made.state.of,
    });
    box.value = ""; // the same file may come again, corrected
  };
  return made;
}

function noteField() {
  const element = make("p");
  const made = { element, controls: [] };
  made.describe = ({ tone }) => (element.className = `note ${tone ?? ""}`);
  made.show = (value) => say(element, value);
  return made;
}

const CONTROLS = {
  choice: choiceField,
  text: boxField,
  number: boxField,
  slider: sliderField,
  check: checkField,
  button: buttonField,
  file: fileField,
  note: noteField,
};

// The answer to what was chosen
function answered({ form, field, problem }) {
  const group = groups[form];
  const made = group?.fields[field];
  if (!made) return;
  if (made.error) {
    fail(made, problem);
    if (problem) restore(made);
  } else if (problem) complain(group, made, problem);
}

// Say under the buttons why one of them does nothing.
function complain(group, made, problem) {
  group.problem?.remove();
  group.problem = make("p", { className: "error", textContent: problem });
  group.problem.setAttribute("role", "alert");
  made.element.closest(".buttons").after(group.problem);
}

export function begin() {
  alsoShows(() => shownGroups().flatMap(([name]) => [name, ...(BESIDE[name] ?? [])]));
  show("groups", (found) => {
    drawGroups(found);
    for (const { name } of found) show(name, (form) => drawForm(name, form), true);
    lineUp.begin(groups.competitors.beside);
    ask();
  });
  show("picture", (tree) => groups.view?.beside.replaceChildren(grown(tree)));
  on("answered", (answer) => {
    answered(answer);
    ask();
  });
}
