"""Forms: the groups of the settings, as descriptions that the page renders, and their commands.

The server describes every field; forms.js makes a control of each, and sends what a visitor has
chosen. The link keeps the order of messages: a number that is typed counts before a START that is
pressed after it. What cannot be taken is answered with one line, which stands beside the field.
"""

from __future__ import annotations

import traceback
from collections.abc import Iterable, Sequence
from math import isfinite
from typing import Annotated, Literal

import msgspec
from msgspec import Meta

from quadsim.files.yaml_errors import cut
from quadsim.web.page.parts.board import Board, PartName
from quadsim.web.page.server.link import LinkVisitor, Message
from quadsim.web.page.server.messages import MAX_TEXT
from quadsim.web.state.fields import ShownField
from quadsim.web.state.menu import Menu

Kind = Literal["choice", "text", "number", "slider", "check", "button", "file", "note"]
Tone = Literal["", "bad", "main"]
Value = bool | int | float | str

Name = Annotated[str, Meta(max_length=100)]
LONGEST_FILE = 40_000  # length of a file that a visitor brings [characters]


class Field(msgspec.Struct, omit_defaults=True):
    """A field of a form.

    Attributes:
        value: its present value; of a note, the text.
        unit: of its number.
        help: what it does.
        low, high, step: the range of a number, and the step of its arrows.
        choices: the values of a choice.
        group: title of the fold in which it stands; empty: in none.
        is_enabled: whether it can be changed now.
        instead: what stands in the empty box of a text.
        tone: of a note or a button.
        rests: whether a slider counts only once it rests.
    """

    name: str
    kind: Kind
    label: str = ""
    value: Value = ""
    unit: str = ""
    help: str = ""
    low: float | None = None
    high: float | None = None
    step: float | None = None
    choices: Sequence[str] = ()
    group: str = ""
    is_enabled: bool = True
    instead: str = ""
    tone: Tone = ""
    rests: bool = False


class Fields(msgspec.Struct):
    """The fields of a form. of: number of the row that they are of, 0: of none."""

    fields: list[Field]
    of: int = 0


class Group(msgspec.Struct):
    """A group of the settings. is_open: whether it is open at first."""

    name: PartName
    title: str
    is_open: bool


class SetField(Message, tag="set_field"):
    """A visitor changes a field of the row that its page shows."""

    form: Name
    field: Name
    value: bool | int | float | Annotated[str, Meta(max_length=MAX_TEXT)]
    of: Annotated[int, Meta(ge=0, le=10**9)] = 0


class PressField(Message, tag="press"):
    """A visitor presses a button of a form."""

    form: Name
    field: Name
    of: Annotated[int, Meta(ge=0, le=10**9)] = 0


class BringFile(Message, tag="bring_file"):
    """A visitor brings a text file for a form. name: of the file."""

    form: Name
    field: Name
    name: Name
    text: Annotated[str, Meta(max_length=LONGEST_FILE)]
    of: Annotated[int, Meta(ge=0, le=10**9)] = 0


Request = SetField | PressField | BringFile


class Answered(Message, tag="answered"):
    """The answer to a request. problem: why it was not taken, of a file with its lines."""

    form: str
    field: str
    problem: str


class Form:
    """A group of the settings. All methods are called on the server's event loop.

    Attributes:
        name: of the part of the page.
        title: of the group.
        is_open: whether the group is open at first.
    """

    name: PartName
    title: str
    is_open = False

    def key(self, visitor: int) -> object:
        """Return what the fields are made from; they are made anew when it changes."""
        raise NotImplementedError

    def fields(self, visitor: int) -> Fields:
        """Return the fields for a visitor."""
        raise NotImplementedError

    def field(self, visitor: int, name: str) -> Field | None:
        """Return one field for a visitor; None: there is none of this name now."""
        fields = self.fields(visitor).fields
        return next((one for one in fields if one.name == name), None)

    def set(self, visitor: int, asked: SetField) -> None:
        """Change a field. Raises ValueError."""
        raise NotImplementedError

    def press(self, visitor: LinkVisitor, asked: PressField) -> None:
        """Press a button. Raises ValueError."""
        raise NotImplementedError

    def bring(self, visitor: LinkVisitor, asked: BringFile) -> None:
        """Take a file. Raises ValueError."""
        raise NotImplementedError


class Forms:
    """Shows forms to all visitors, and gives them what visitors have chosen."""

    def __init__(self, board: Board, forms: Iterable[Form]):
        self._board = board
        self._forms: dict[PartName, Form] = {form.name: form for form in forms}
        for name, form in self._forms.items():
            board.offer(name, form.key, form.fields)
        groups = [Group(form.name, form.title, form.is_open) for form in self._forms.values()]
        board.put("groups", groups)
        board.link.on(SetField, self._set)
        board.link.on(PressField, self._press)
        board.link.on(BringFile, self._bring)

    def _set(self, visitor: LinkVisitor, asked: SetField) -> None:
        self._answer(visitor, asked)

    def _press(self, visitor: LinkVisitor, asked: PressField) -> None:
        self._answer(visitor, asked)

    def _bring(self, visitor: LinkVisitor, asked: BringFile) -> None:
        self._answer(visitor, asked)

    def _answer(self, visitor: LinkVisitor, asked: Request) -> None:
        """Carry out a request; the answer says why it was refused."""
        problem = ""
        try:
            form = self._forms[asked.form]  # type: ignore[index]
            field = form.field(visitor.number, asked.field)
            if field is None:
                raise ValueError(f"{form.title}: expected a field that is there now")
            wanted = {"button": PressField, "file": BringFile}.get(field.kind, SetField)
            if not isinstance(asked, wanted):
                raise ValueError(f"{field.name}: expected a press of a button, a file, or a value")
            if not field.is_enabled:
                value = f"; it stays {shown(field.value)}" if isinstance(asked, SetField) else ""
                raise ValueError(f"{field.label} cannot be changed now{value}")
            if isinstance(asked, SetField):
                asked.value = read(field, asked.value)
                form.set(visitor.number, asked)
            elif isinstance(asked, BringFile):
                form.bring(visitor, asked)
            else:
                form.press(visitor, asked)
        except KeyError:
            problem = "expected a form of this page"
        except ValueError as error:
            problem = str(error)
        except Exception:
            traceback.print_exc()
            problem = "this broke off: see the terminal of race web"
        visitor.send(Answered(asked.form, asked.field, problem))


def read(field: Field, value: Value) -> Value:
    """Return the value of a control as its field has it.

    Raises:
        ValueError: the field is no control, or cannot have the value.
    """
    match field.kind:
        case "check":
            if isinstance(value, bool):
                return value
            raise ValueError(f"{field.label}: expected true or false, got {cut(repr(value))}")
        case "choice":
            if value in field.choices:
                return value
            wanted = f"expected one of {', '.join(field.choices)}"
            raise ValueError(f"{field.label}: {wanted}, got {cut(repr(value))}")
        case "slider" | "number":
            return _number(field, value)
        case "text":
            return value.strip() if isinstance(value, str) else str(value)
    raise ValueError(f"{field.name}: expected a field with a value")


def _number(field: Field, value: Value) -> float:
    """Return a number within the range of its field. Raises ValueError."""
    text = str(value).strip()
    try:
        number = float(text)
    except ValueError:
        number = float("nan")
    low, high = field.low, field.high
    is_beyond = (low is not None and number < low) or (high is not None and number > high)
    if isinstance(value, bool) or not isfinite(number) or is_beyond:
        span = "" if low is None or high is None else f" from {low:g} to {high:g}"
        unit = f" {field.unit}" if field.unit else ""
        got = cut(text) or "nothing"
        stays = f"it stays {shown(field.value)}"
        raise ValueError(f"{field.label}: expected a number{span}{unit}, got {got}; {stays}")
    return number


def shown(value: Value) -> str:
    """Return a value as a control shows it."""
    return f"{value:.10g}" if isinstance(value, int | float) else str(value)


def field_of(found: ShownField, value: Value, menu: Menu | None = None) -> Field:
    """Return the control of a field of a record: a choice, a tick or a box."""
    options = found.options(menu)
    kind: Kind = "choice" if options else "check" if found.is_flag else "text"
    return Field(
        name=found.name,
        kind=kind,
        label=found.label,
        value=value if kind == "check" else shown(value),
        unit=found.shown.unit,
        help=found.shown.help,
        choices=options,
    )


def button(name: str, label: str = "", help: str = "", tone: Tone = "") -> Field:
    """Return a button; without a label it has its name."""
    return Field(name, "button", label or name, help=help, tone=tone)


def note(name: str, text: str, tone: Tone = "") -> Field:
    """Return a line of text."""
    return Field(name, "note", value=text, tone=tone)
