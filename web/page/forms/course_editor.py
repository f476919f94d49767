"""CourseEditor: the form and the scene with which visitors edit a course together.

What visitors ask for, and the handles in the scene, act on the server's event loop, and change only
the edit. The page's own thread displays the edit in the scene.
"""

from __future__ import annotations

from functools import partial
from math import inf
from pathlib import Path
from time import perf_counter

import viser

from quadsim.course import Course, parse_course
from quadsim.course.course import course_errors
from quadsim.files.strict_yaml import FileError
from quadsim.record.run import RunError
from quadsim.web.course.draft import Draft, Item, Pose
from quadsim.web.course.edit import Checked, CourseEdit, limit_path
from quadsim.web.course.numbers import Number
from quadsim.web.page.forms.forms import (
    BringFile,
    Field,
    Fields,
    Form,
    PressField,
    SetField,
    button,
    note,
)
from quadsim.web.page.parts.course_map import Map
from quadsim.web.page.parts.elements import EMPTY, Content, Element, bad, box, heading, small
from quadsim.web.page.scene.edit_scene import EditScene
from quadsim.web.page.server.downloads import Downloads
from quadsim.web.page.server.link import LinkVisitor
from quadsim.web.race.next_start import NextStart
from quadsim.web.race.session import Session
from quadsim.web.race.snapshot import Snapshot

CHECKS = 0.15  # time between two checks, as one takes some 30 ms [s]
SHOWN = 6  # number of errors that are shown
MOST_LAPS = 1000
ROOM = 3  # number of gates for which the camera has room at least
UNNAMED = "my_course"
ABOUT = (
    "Make a course: gates and obstacles are moved by handles or numbers, checked at once, saved "
    "among the runs and flown by START."
)
ADD = {"gate": Draft.add_gate, "box": Draft.add_box, "pole": Draft.add_pole}
SHIFTS = {"earlier": -1, "later": 1}
NUMBER = "number "  # begins the name of the field of a number


class CourseEditor(Form):
    """The editor of a page, open for each visitor who has opened it; the draft is everybody's.

    It cannot open during a flight; a flight or a replay closes it.

    Args:
        start: what START flies, which is offered a saved course.
        downloads: the files that wait for visitors.
    """

    name = "editor"
    title = "Course editor"

    def __init__(self, session: Session, start: NextStart, downloads: Downloads):
        self._session = session
        self._downloads = downloads
        self._start = start
        self._edit = CourseEdit(session.root)
        # Number of the last race
        self._last_race = 0
        self._editing: frozenset[int] = frozenset()  # the visitors who have the editor open
        self._drags = 0
        self._course_name = UNNAMED  # of the file
        self._checked = Checked((), frozenset(), "")
        self._checked_of: object = None
        self._checked_at = -inf
        self._offered: object = None
        for file in self._edit.folder.files():
            start.offer_course(file)

    def framed(self) -> Course:
        """Return the course for the camera; a short course gets room for gates."""
        draft = self._edit.draft
        while len(draft.entries.gates) < ROOM:
            draft = draft.add_gate()
        return draft.drawn()

    def scene_in(self, scene: viser.SceneApi) -> EditScene:
        """Return the course in the scene of a visitor, which is empty."""
        return EditScene(scene, self._dragged, self._clicked)

    def update(self, s: Snapshot) -> None:
        """Check the draft while anybody edits it."""
        if s.flying or s.race != self._last_race:
            self._last_race = s.race
            self._editing = frozenset()
        self._offer_saved()
        if self._editing:
            self._check()

    def is_open_for(self, visitor: int) -> bool:
        """Return whether a visitor edits the course."""
        return visitor in self._editing

    @property
    def shown(self) -> object:
        """A value that changes with what the scenes show, and with what the page says."""
        return self._edit.draft, self._checked, self._edit.saved_as

    def show_in(self, scene: EditScene) -> None:
        """Show the draft in the scene of a visitor."""
        scene.show(self._edit.draft, self._checked.wrong)
        scene.show_limit(limit_path(self._checked.limit))

    def map(self) -> Element:
        """Return the map of the course, empty without gates."""
        course = self._edit.draft.drawn()
        return Map(course).draw([]) if course.gates else EMPTY

    def said(self) -> Element:
        """Return what the page says of the course that is edited."""
        return box(heading("checks"), *self._state(), *self._errors())

    def close(self) -> None:
        """End the search of a limit."""
        self._edit.cancel_search()

    # The form.

    def key(self, visitor: int) -> object:
        """Return the draft, what was found of it, and whether the visitor edits it."""
        edit = self._edit
        progress = edit.search.progress if edit.search else None
        is_searching = bool(edit.search and edit.search.is_on)
        file = (edit.saved_as, edit.replaced, self._course_name)
        shown = (edit.history, self.is_open_for(visitor), self._checked, file)
        return shown, progress, is_searching, self._start.first_vehicle

    def fields(self, visitor: int) -> Fields:
        """Return the ways in, or the item that is edited, its numbers, and the course."""
        if not self.is_open_for(visitor):
            return Fields(self._ways_in())
        return Fields([*self._item_fields(), *self._course_fields()])

    def _ways_in(self) -> list[Field]:
        """Return the buttons that open the editor."""
        fields = [
            note("about", ABOUT),
            button("copy", "Edit a copy", "of the course that is chosen for the next START"),
            button("new", "New course"),
            Field("bring", "file", "From a file", help="a course in YAML on your machine"),
        ]
        if self._edit.history.before:
            fields.append(button("resume", "Go on editing"))
        return fields

    def _item_fields(self) -> list[Field]:
        """Return the chosen item, its numbers, and the buttons that add, move and delete items."""
        draft = self._edit.draft
        item = Field(
            name="item",
            kind="choice",
            label="Item",
            value=str(draft.item),
            help="the part of the course that the handle and the numbers are of",
            choices=[str(one) for one in draft.items],
        )
        added = "behind the chosen gate; obstacles to its left"
        buttons = [button(name, f"add {name}", added) for name in ADD]
        if draft.item.kind == "gate":
            buttons += [button(name, help="in the order of flight") for name in SHIFTS]
        buttons += [button(name) for name in ("undo", "redo", "delete")]
        numbers = [_number_field(number, value) for number, value in draft.numbers().items()]
        return [item, *buttons, *numbers]

    def _course_fields(self) -> list[Field]:
        """Return the fields of the whole course, its checks, and the search of its limit."""
        entries = self._edit.draft.entries
        is_searching = bool(self._edit.search and self._edit.search.is_on)
        search = button("cancel", "Cancel the search")
        if not is_searching:
            least = "the least time in which the chosen vehicle can fly this course; takes minutes"
            search = button("solve", "Solve the limit", least)
        file = "of the file among the runs, in the folder courses"
        lines = [note(f"limit {k}", line) for k, line in enumerate(self._limit_lines())]
        loop = "the first gate comes after the last"
        return [
            Field("loop", "check", "Loop", entries.loop, help=loop),
            Field("laps", "number", "Laps of a race", entries.laps, low=1, high=MOST_LAPS, step=1),
            Field("file", "text", "Name", self._course_name, help=file),
            button("save", "Save and choose", tone="main"),
            button("take", "To a file", "the course in YAML, to your machine"),
            *self._replaced_fields(),
            search,
            *lines,
            button("done", "Done"),
        ]

    def _replaced_fields(self) -> list[Field]:
        """Return what the last save has written over, and the button that puts it back."""
        replaced = self._edit.replaced
        if not replaced:
            return []
        back = "write the file as it was before the last save"
        return [
            note("replaced", f"The save replaced {replaced}"),
            button("put_back", "Put it back", back),
        ]

    def set(self, visitor: int, asked: SetField) -> None:
        """Choose an item, or change a number of it or of the course. Raises ValueError."""
        draft = self._edit.draft
        value = asked.value
        match asked.field:
            case "item":
                named = {str(item): item for item in draft.items}
                self._edit.change(draft.choose(named.get(str(value), draft.item)))
            case "loop":
                self._edit.change(draft.with_course(loop=bool(value)))
            case "laps":
                if not float(value).is_integer():
                    raise ValueError(f"Laps of a race: expected a whole number, got {value:g}")
                self._edit.change(draft.with_course(laps=int(value)), "laps")
            case "file":
                self._course_name = str(value)
            case _:
                self._set_number(asked.field.removeprefix(NUMBER), float(value))

    def _set_number(self, label: str, value: float) -> None:
        """Set a number of the chosen item, unless another visitor has chosen one without it."""
        draft = self._edit.draft
        found = [number for number in draft.numbers() if number.label == label]
        for number in found:
            self._edit.change(draft.with_numbers({number: value}), (draft.item, number))

    def press(self, visitor: LinkVisitor, asked: PressField) -> None:
        """Open or close the editor, add, move and delete, save, search. Raises ValueError."""
        edit = self._edit
        pressed = asked.field
        if pressed in ADD:
            edit.change(ADD[pressed](edit.draft))
        elif pressed in SHIFTS:
            edit.change(edit.draft.shift(SHIFTS[pressed]))
        elif pressed == "take":
            name = f"{self._course_name}.yaml"
            visitor.send(self._downloads.kept(name, edit.draft.text().encode()))
        else:
            self._act(visitor.number, pressed)

    def bring(self, visitor: LinkVisitor, asked: BringFile) -> None:
        """Edit the course of a file. Raises ValueError: what `race check` finds, with its lines."""
        errors = course_errors(asked.text, asked.name)
        if errors:
            told = [f"{error}\n{error.excerpt}".rstrip() for error in errors[:SHOWN]]
            raise ValueError("\n".join(told))
        name = Path(asked.name).stem
        self._begin(visitor.number, parse_course(asked.text, asked.name))
        self._course_name = name

    def _act(self, visitor: int, pressed: str) -> None:
        """Do what a button says. Raises ValueError."""
        edit = self._edit
        acts = {
            "copy": partial(self._begin_copy, visitor),
            "new": partial(self._begin, visitor, None),
            "resume": partial(self._open, visitor),
            "undo": edit.undo,
            "redo": edit.redo,
            "delete": self._delete,
            "save": self._save,
            "put_back": self._put_back,
            "solve": self._solve,
            "cancel": edit.cancel_search,
            "done": partial(self._leave, visitor),
        }
        acts[pressed]()

    def _begin_copy(self, visitor: int) -> None:
        chosen = self._start.course()
        if chosen is None:
            raise ValueError("its file cannot be read: choose another course")
        self._begin(visitor, chosen)

    def _open(self, visitor: int) -> None:
        self._expect_landed()
        self._editing |= {visitor}

    def _delete(self) -> None:
        self._edit.change(self._edit.draft.delete())

    def _save(self) -> None:
        try:
            self._edit.save(self._course_name)
        except RunError as error:
            raise ValueError(str(error)) from None

    def _put_back(self) -> None:
        try:
            path = self._edit.put_back()
        except RunError as error:
            raise ValueError(str(error)) from None
        self._start.offer_course(path, chosen=True)

    def _solve(self) -> None:
        self._edit.begin_search(self._course_name, self._start.first_vehicle)

    def _leave(self, visitor: int) -> None:
        self._editing -= {visitor}

    # Actions in the scene.

    async def _dragged(self, pose: Pose | None) -> None:
        """Move the chosen item to the pose of its handle; None: the handle was released."""
        if pose is None:
            self._drags += 1
            return
        # The movements of one drag are one change.
        self._edit.change(self._edit.draft.moved_to(pose), ("drag", self._drags))

    async def _clicked(self, item: Item) -> None:
        self._edit.change(self._edit.draft.choose(item))

    def _begin(self, visitor: int, course: Course | None) -> None:
        """Begin to edit a copy of a course, or an empty one. Raises ValueError."""
        self._open(visitor)
        try:
            self._edit.begin(course)
        except FileError as error:
            raise ValueError(str(error)) from None
        self._course_name = f"my_{course.name}"[:64] if course else UNNAMED

    def _expect_landed(self) -> None:
        """Raise ValueError while a flight is on."""
        if self._session.snapshot.flying:
            raise ValueError("a flight is on: edit when it has ended, or STOP it")

    # Display.

    def _offer_saved(self) -> None:
        """Choose a course that was saved since the last call."""
        saved = self._edit.saved_as
        if saved and (saved, self._edit.draft.entries) != self._offered:
            self._offered = (saved, self._edit.draft.entries)
            self._start.offer_course(saved, chosen=True)

    def _check(self) -> None:
        """Check the draft again if the draft, its name or the vehicle has changed."""
        search = self._edit.search
        found = search.progress.best if search else None
        checked_of = (
            self._edit.draft.entries,
            self._course_name,
            self._start.first_vehicle,
            found,
        )
        now = perf_counter()
        if checked_of != self._checked_of and now - self._checked_at > CHECKS:
            self._checked_at = now
            self._checked_of = checked_of
            self._checked = self._edit.check(self._course_name, self._start.first_vehicle)

    def _state(self) -> list[Content]:
        """Return a summary of the course, and its file."""
        checked = self._checked
        if not self._edit.draft.entries.gates:
            return ["no gate yet", small("add gates in the order of flight")]
        if checked.errors:
            count = len(checked.errors)
            lines = "error" if count == 1 else "errors"
            return [bad(f"{count} {lines}: not to be flown yet")]
        saved = self._edit.saved_as
        flown = "not saved: START flies another course"
        if saved:
            flown = f"START flies it, or: race fly {_named_here(saved)}"
        return [f"ok, {checked.summary}", small(flown)]

    def _errors(self) -> list[Element]:
        """Return the first errors in the wording of `race check`."""
        errors = self._checked.errors if self._edit.draft.entries.gates else ()
        lines = [small(error) for error in errors[:SHOWN]]
        if len(errors) > SHOWN:
            lines.append(small(f"and {len(errors) - SHOWN} more"))
        return lines

    def _limit_lines(self) -> list[str]:
        """Return lines with the best known race and lap times, and the progress of the search."""
        limit = self._checked.limit
        lines = []
        if limit:
            laps = ", ".join(f"{lap:.3f}" for lap in limit.lap_times)
            vehicle = self._start.first_vehicle
            lines.append(f"best known limit of {vehicle}: {limit.time:.3f} s, its path is orange")
            lines.append(f"laps {laps} s")
        if self._edit.search:
            lines.append(self._edit.search.progress.text)
        return lines


def _named_here(file: str) -> str:
    """Return a file's path, from the folder in which the server was started if it lies there."""
    path = Path(file).resolve()
    here = Path.cwd()
    return str(path.relative_to(here)) if path.is_relative_to(here) else file


def _number_field(number: Number, value: float) -> Field:
    """Return the box of a number of an item."""
    return Field(
        name=NUMBER + number.label,
        kind="number",
        label=number.label,
        value=value,
        unit=number.unit,
        help=number.help,
        low=number.low,
        high=number.high,
        step=number.step,
    )
