"""CourseEditor: the controls and the scene with which visitors edit a course together.

The callbacks of controls and handles are coroutines, which viser runs one after another on its
event loop, and they change only the edit. The page's own thread displays the edit; no other thread
sets or builds controls.
"""

from __future__ import annotations

from functools import partial
from math import inf
from time import perf_counter

import viser

from quadsim.course import Course
from quadsim.files.strict_yaml import FileError
from quadsim.record.run import RunError
from quadsim.web.course_draft import Draft, Item, Pose
from quadsim.web.course_edit import Checked, CourseEdit, limit_path
from quadsim.web.course_numbers import NUMBERS, Number
from quadsim.web.page.course_map import Map
from quadsim.web.page.edit_scene import EditScene
from quadsim.web.page.html import RED, box, coloured, heading, small, text
from quadsim.web.page.race_panel import RacePanel
from quadsim.web.race import Snapshot
from quadsim.web.session import Session

NOTICE = 8.0  # duration of a problem's notice [s]
CHECKS = 0.15  # time between two checks, as one takes some 30 ms [s]
SHOWN = 6  # number of errors that are shown
DIGITS = 6  # largest number of typed decimals
UNNAMED = "my_course"
ABOUT = (
    "Make a course: gates and obstacles are moved by handles or numbers, checked at once, saved "
    "among the runs and flown by START."
)
ADD = {"gate": Draft.add_gate, "box": Draft.add_box, "pole": Draft.add_pole}
SHIFTS = {"earlier": -1, "later": 1}
SOLVE = "Solve the limit"


class CourseEditor:
    """The editor of a page. It cannot open during a flight; a flight or a replay closes it.

    Args:
        gui: place of the controls.
        race: panel that offers a saved course.
    """

    def __init__(self, gui: viser.GuiApi, session: Session, race: RacePanel):
        self._session = session
        self._race = race
        self._edit = CourseEdit(session.root)
        self._scene: EditScene | None = None
        # Number of the last race
        self._last_race = 0
        self._drags = 0
        # The name that a new draft gets, until it is shown
        self._new_name: str | None = None
        # The known values of the boxes; a different value belongs to a message under way
        self._known: dict[Number, float] = {}
        self._checked = Checked((), frozenset(), "")
        self._checked_of: object = None
        self._checked_at = -inf
        # The displayed state of the controls and of the scene
        self._controls_shown: object = None
        self._scene_shown: object = None
        self._offered: object = None
        for file in self._edit.folder.files():
            race.offer_course(file)
        self._add_ways_in(gui)
        self._add_items(gui)
        self._add_numbers(gui)
        self._add_course(gui)
        self._show_controls()

    def framed(self) -> Course:
        """Return the course for the camera; an empty course gets room for gates."""
        draft = self._edit.draft
        if not draft.entries.gates:
            draft = draft.add_gate().add_gate().add_gate()
        return draft.drawn()

    def begin(self, scene: viser.SceneApi) -> None:
        """Begin to show the course in this scene, until the editor is closed."""
        self._scene = EditScene(scene, self._dragged, self._clicked)
        self._scene_shown = None

    def update_controls(self, s: Snapshot) -> bool:
        """Show the controls of the draft; return whether the editor is open."""
        if s.flying or s.race != self._last_race:
            self._last_race = s.race
            self._edit.is_open = False
        self._offer_saved()
        if self._edit.is_open:
            self._check()
        edit = self._edit
        progress = edit.search.progress if edit.search else None
        shown = (edit.history, edit.is_open, self._checked, progress, edit.saved_as)
        if shown != self._controls_shown:
            self._controls_shown = shown
            self._show_controls()
        return edit.is_open

    def update_scene(self) -> bool:
        """Show the draft in the scene; return whether it has changed."""
        scene = self._scene
        draft = self._edit.draft
        if scene is None:
            return False
        shown = (draft, self._checked, self._edit.saved_as, scene.is_dragged)
        if shown == self._scene_shown:
            return False
        self._scene_shown = shown
        scene.show(draft, self._checked.wrong)
        scene.show_limit(limit_path(self._checked.limit))
        return True

    def map(self) -> str:
        """Return the map of the course, "" without gates."""
        course = self._edit.draft.drawn()
        return Map(course).draw([]) if course.gates else ""

    def said(self) -> str:
        """Return what the page says of the course that is edited, as HTML."""
        return box(heading("checks"), self._state())

    def close(self) -> None:
        """End the search of a limit."""
        self._edit.cancel_search()

    # The controls, which are built once; their visibility depends on the item.

    def _add_ways_in(self, gui: viser.GuiApi) -> None:
        self._about = gui.add_html(box(small(ABOUT)))
        hint = "of the course that is chosen for the next START"
        self._copy = gui.add_button("Edit a copy", hint=hint)
        self._new = gui.add_button("New course", color="gray")
        self._resume = gui.add_button("Go on editing", color="gray")
        self._status = gui.add_html("")
        self._copy.on_click(self._edit_copy)
        self._new.on_click(self._edit_new)
        self._resume.on_click(self._go_on)

    def _add_items(self, gui: viser.GuiApi) -> None:
        hint = "the part of the course that the handle and the numbers are of"
        items = tuple(map(str, self._edit.draft.items))
        self._item = gui.add_dropdown("Item", items, initial_value=items[0], hint=hint)
        hint = "behind the chosen gate; obstacles to its left"
        self._adding = gui.add_button_group("Add", tuple(ADD), hint=hint)
        hint = "order in which the gate is flown"
        self._order = gui.add_button_group("Order", tuple(SHIFTS), hint=hint)
        self._change = gui.add_button_group("Change", ("undo", "redo", "delete"))
        self._item.on_update(self._choose)
        self._adding.on_click(self._add)
        self._order.on_click(self._shift)
        self._change.on_click(self._go_back)

    def _add_numbers(self, gui: viser.GuiApi) -> None:
        self._boxes: dict[Number, viser.GuiNumberHandle[float]] = {}
        for number in NUMBERS:
            box = gui.add_number(
                number.label, 0.0, min=number.low, max=number.high, step=number.step
            )
            box.precision = DIGITS
            box.on_update(partial(self._typed, number))
            self._boxes[number] = box
            self._known[number] = 0.0

    def _add_course(self, gui: viser.GuiApi) -> None:
        self._loop = gui.add_checkbox("Loop", False, hint="the first gate comes after the last")
        self._laps = gui.add_number("Laps of a race", 1, min=1, max=1000, step=1)
        hint = "of the file among the runs, in the folder courses"
        self._name = gui.add_text("Name", UNNAMED, hint=hint)
        self._save = gui.add_button("Save and choose", icon=viser.Icon.DEVICE_FLOPPY)
        hint = "the least time in which the chosen vehicle can fly this course; takes minutes"
        self._solve = gui.add_button(SOLVE, color="gray", hint=hint)
        self._cancel = gui.add_button("Cancel the search", color="red")
        self._limit = gui.add_html("")
        self._done = gui.add_button("Done", color="gray")
        self._loop.on_update(self._loop_set)
        self._laps.on_update(self._laps_typed)
        self._save.on_click(self._save_draft)
        self._solve.on_click(self._begin_search)
        self._cancel.on_click(self._cancel_search)
        self._done.on_click(self._leave)

    # Actions of visitors.

    async def _edit_copy(self, event: viser.GuiEvent) -> None:
        chosen = self._race.chosen_course()
        if chosen is None:
            self._complain(event, "its file cannot be read: choose another course")
        elif self._may_open(event):
            self._begin(event, chosen)

    async def _edit_new(self, event: viser.GuiEvent) -> None:
        if self._may_open(event):
            self._begin(event, None)

    async def _go_on(self, event: viser.GuiEvent) -> None:
        self._edit.is_open = self._may_open(event)

    async def _leave(self, _: viser.GuiEvent) -> None:
        self._edit.is_open = False

    async def _choose(self, event: viser.GuiEvent) -> None:
        if event.client_id is not None:
            draft = self._edit.draft
            named = {str(item): item for item in draft.items}
            self._edit.change(draft.choose(named.get(self._item.value, draft.item)))

    async def _add(self, event: viser.GuiEvent) -> None:
        try:
            self._edit.change(ADD[self._adding.value](self._edit.draft))
        except ValueError as error:
            self._complain(event, str(error))

    async def _shift(self, _: viser.GuiEvent) -> None:
        self._edit.change(self._edit.draft.shift(SHIFTS[self._order.value]))

    async def _go_back(self, _: viser.GuiEvent) -> None:
        match self._change.value:
            case "undo":
                self._edit.undo()
            case "redo":
                self._edit.redo()
            case "delete":
                self._edit.change(self._edit.draft.delete())

    async def _typed(self, number: Number, event: viser.GuiEvent) -> None:
        if event.client_id is None:
            return
        value = float(self._boxes[number].value)
        self._known[number] = value
        draft = self._edit.draft
        # Another visitor may have chosen an item without this number meanwhile.
        if number in draft.numbers():
            self._edit.change(draft.with_numbers({number: value}), (draft.item, number))

    async def _loop_set(self, event: viser.GuiEvent) -> None:
        if event.client_id is not None:
            self._edit.change(self._edit.draft.with_course(loop=self._loop.value))

    async def _laps_typed(self, event: viser.GuiEvent) -> None:
        if event.client_id is not None:
            laps = int(self._laps.value)
            self._edit.change(self._edit.draft.with_course(laps=laps), "laps")

    async def _dragged(self, pose: Pose | None) -> None:
        """Move the chosen item to the pose of its handle; None: the handle was released."""
        if pose is None:
            self._drags += 1
            return
        # The movements of one drag are one change.
        self._edit.change(self._edit.draft.moved_to(pose), ("drag", self._drags))

    async def _clicked(self, item: Item) -> None:
        self._edit.change(self._edit.draft.choose(item))

    async def _save_draft(self, event: viser.GuiEvent) -> None:
        try:
            self._edit.save(self._name.value)
        except (ValueError, RunError) as error:
            self._complain(event, str(error))

    async def _begin_search(self, event: viser.GuiEvent) -> None:
        try:
            self._edit.begin_search(self._name.value, self._race.first_vehicle)
        except ValueError as error:
            self._complain(event, str(error))

    async def _cancel_search(self, _: viser.GuiEvent) -> None:
        self._edit.cancel_search()

    def _begin(self, event: viser.GuiEvent, course: Course | None) -> None:
        """Begin to edit a copy of a course, or an empty one."""
        try:
            self._edit.begin(course)
        except FileError as error:
            self._complain(event, str(error))
        self._new_name = f"my_{course.name}"[:64] if course else UNNAMED

    def _may_open(self, event: viser.GuiEvent) -> bool:
        """Return whether no flight is on; otherwise notify the visitor."""
        if self._session.snapshot.flying:
            self._complain(event, "a flight is on: edit when it has ended, or STOP it")
            return False
        return True

    def _complain(self, event: viser.GuiEvent, problem: str) -> None:
        """Notify one visitor of a problem."""
        if event.client:
            event.client.add_notification(
                "Cannot do that", problem, auto_close_seconds=NOTICE, color="red"
            )

    # Display.

    def _offer_saved(self) -> None:
        """Choose a course that was saved since the last call."""
        saved = self._edit.saved_as
        if saved and (saved, self._edit.draft.entries) != self._offered:
            self._offered = (saved, self._edit.draft.entries)
            self._race.offer_course(saved, chosen=True)

    def _check(self) -> None:
        """Check the draft again if the draft, its name or the vehicle has changed."""
        search = self._edit.search
        found = search.progress.best if search else None
        checked_of = (
            self._edit.draft.entries,
            self._name.value,
            self._race.first_vehicle,
            found,
        )
        now = perf_counter()
        if checked_of != self._checked_of and now - self._checked_at > CHECKS:
            self._checked_at = now
            self._checked_of = checked_of
            self._checked = self._edit.check(self._name.value, self._race.first_vehicle)

    def _show_controls(self) -> None:
        """Show the applicable controls with the values of the draft."""
        edit = self._edit
        is_open = edit.is_open
        for control in (self._about, self._copy, self._new):
            control.visible = not is_open
        self._resume.visible = not is_open and bool(edit.history.before)
        ours = (
            self._item,
            self._adding,
            self._change,
            self._loop,
            self._laps,
            self._name,
            self._save,
            self._status,
            self._limit,
            self._done,
        )
        for control in ours:
            control.visible = is_open
        draft = edit.draft
        self._order.visible = is_open and draft.item.kind == "gate"
        is_searching = bool(edit.search and edit.search.is_on)
        self._solve.visible = is_open and not is_searching
        self._cancel.visible = is_open and is_searching
        numbers = draft.numbers()
        for number, handle in self._boxes.items():
            handle.visible = is_open and number in numbers
            if handle.visible:
                self._show_number(number, numbers[number])
        if not is_open:
            return
        if self._new_name is not None:
            self._name.value = self._new_name
            self._new_name = None
        names = tuple(map(str, draft.items))
        if self._item.options != names:
            self._item.options = names
        self._item.value = str(draft.item)
        self._loop.value = draft.entries.loop
        self._laps.value = draft.entries.laps
        self._status.content = box_of(self._state(), *self._errors())
        self._limit.content = box_of(*self._limit_lines())

    def _show_number(self, number: Number, value: float) -> None:
        """Set a box, unless a visitor's message with a different value is under way."""
        handle = self._boxes[number]
        if handle.value == self._known[number] and handle.value != value:
            self._known[number] = value
            handle.value = value

    def _state(self) -> str:
        """Return a summary of the course, and its file."""
        checked = self._checked
        if checked.errors:
            count = len(checked.errors)
            lines = "error" if count == 1 else "errors"
            return coloured(f"{count} {lines}: not to be flown yet", RED)
        saved = self._edit.saved_as
        if not saved:
            return f"ok, {text(checked.summary)}" + small("not saved: START flies another course")
        return f"ok, {text(checked.summary)}" + small(f"START flies it, or: race fly {text(saved)}")

    def _errors(self) -> list[str]:
        """Return the first errors in the wording of `race check`."""
        errors = self._checked.errors
        lines = [small(text(error)) for error in errors[:SHOWN]]
        if len(errors) > SHOWN:
            lines.append(small(f"and {len(errors) - SHOWN} more"))
        return lines

    def _limit_lines(self) -> list[str]:
        """Return the known limit, and the progress of the search."""
        limit = self._checked.limit
        vehicle = text(self._race.first_vehicle)
        lines = []
        if limit:
            laps = ", ".join(f"{lap:.3f}" for lap in limit.lap_times)
            lines.append(f"best known limit of {vehicle}: <b>{limit.time:.3f} s</b>")
            lines.append(small(f"laps {laps} s; its path is orange"))
        if self._edit.search:
            lines.append(small(text(self._edit.search.progress.text)))
        return lines


def box_of(*lines: str) -> str:
    """Return lines of HTML in a box; "" for no lines."""
    return box(*lines) if lines else ""
