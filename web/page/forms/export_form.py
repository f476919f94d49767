"""ExportForm: makes files and addresses of what a visitor is shown."""

from __future__ import annotations

import traceback
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np
import viser

from quadsim.heat.archive import export_name, named_runs, with_whole_races
from quadsim.record.exchange import telemetry_csv
from quadsim.record.run import RunError
from quadsim.web.page.forms.export import offline_page, picture, picture_name, zipped
from quadsim.web.page.forms.forms import Fields, Form, PressField, button
from quadsim.web.page.forms.playback import ShowNotice
from quadsim.web.page.forms.runs_panel import link_to
from quadsim.web.page.scene.camera import FREE, Camera
from quadsim.web.page.server.downloads import Downloads
from quadsim.web.page.server.link import LinkVisitor, Message
from quadsim.web.page.server.seats import Seats
from quadsim.web.race.competitor import named
from quadsim.web.race.next_start import NextStart
from quadsim.web.race.session import Session
from quadsim.web.race.snapshot import Snapshot
from quadsim.web.race.stored_competitor import stored_competitor
from quadsim.web.race.summary import summary_at
from quadsim.web.race.viewing import Viewing

RENDER_TIMEOUT = 30.0  # time limit for a browser with software rendering [s]
OPENS_RUNS = (
    "It shows these runs to everybody who looks at the page then, and this time, camera and view to"
    " who opens it."
)
NEEDS_TOKEN = (
    " Who has not opened this page before needs its token, too: add &token=... of the address that"
    " `race web` printed."
)
OPENS_SET_UP = "It sets up the next START for everybody who looks at the page then."
BUTTONS = {
    "page": "animated, plays offline",
    "CSV": "every number of the runs that are shown",
    "zip": "the folders of the runs that are shown",
    "PNG": "the view",
    "link": "an address that shows this",
    "course": "the file of the course",
    "set-up": "an address that sets up the next START like this",
}


class Address(Message, tag="address"):
    """An address to copy, without the address of the page before it. opens: what it does."""

    title: str
    address: str
    opens: str


class File(NamedTuple):
    """A file for a visitor."""

    name: str
    data: bytes


class ExportForm(Form):
    """Buttons that make a file or an address of what is shown. A thread of its own makes files."""

    name = "export"
    title = "Export"

    def __init__(
        self,
        session: Session,
        start: NextStart,
        viewing: Viewing,
        seats: Seats,
        camera: Camera,
        downloads: Downloads,
        needs_token: bool,
    ):
        self._session = session
        self._start = start
        self._viewing = viewing
        self._seats = seats
        self._camera = camera
        self._downloads = downloads
        self._needs = NEEDS_TOKEN if needs_token else ""
        self._worker = ThreadPoolExecutor(1, "export")

    def close(self) -> None:
        """Make no further file."""
        self._worker.shutdown(wait=False, cancel_futures=True)

    def key(self, visitor: int) -> object:
        """Return None, as the buttons never change."""
        return None

    def fields(self, visitor: int) -> Fields:
        """Return the buttons."""
        return Fields([button(name, help=text) for name, text in BUTTONS.items()])

    def press(self, visitor: LinkVisitor, asked: PressField) -> None:
        """Answer a pressed button: send an address, or begin to make the file.

        Raises:
            ValueError: the course that is shown cannot be read.
        """
        s = self._viewing.seen_by(visitor.number)
        client = self._seats.client_beside(visitor)
        match asked.field:
            case "link":
                mode = self._camera.mode_of(client) if client else FREE
                view = self._viewing.view_of(visitor.number)
                address = link_to(s.competitors, s.t, mode, view, self._session.root)
                opens = OPENS_RUNS + self._needs
                visitor.send(Address("Link to what is shown", address, opens))
            case "set-up":
                opens = OPENS_SET_UP + self._needs
                visitor.send(Address("Link that sets up this race", self._start.link, opens))
            case "course":
                course = s.competitors[0].course if s.competitors else self._start.course()
                if course is None:
                    raise ValueError("course: expected one that can be read")
                visitor.send(self._downloads.kept(f"{course.name}.yaml", course.text.encode()))
            case what:
                self._worker.submit(self._make, visitor, client, what, s)

    def _make(
        self, visitor: LinkVisitor, client: viser.ClientHandle | None, what: str, s: Snapshot
    ) -> None:
        """Make a file and tell the visitor where it is, or in one line why there is none."""
        try:
            file = _file(client, what, s)
        except (RunError, ValueError, RuntimeError, TimeoutError, OSError) as error:
            visitor.send(ShowNotice("error", "Cannot export", str(error)))
        except Exception:
            traceback.print_exc()
        else:
            visitor.send(self._downloads.kept(file.name, file.data))


def _file(client: viser.ClientHandle | None, what: str, s: Snapshot) -> File:
    """Return the requested file. Raises ValueError."""
    if what == "PNG":
        if client is None:
            raise ValueError("PNG: expected a page that shows the scene")
        summary = summary_at(s.competitors, s.t)
        return File(f"{picture_name(s)}.png", picture(_rendered(client), summary))
    folders = [entry.folder for entry in s.competitors if entry.folder]
    if not folders:
        raise ValueError("nothing is stored yet: a flight is kept when it ends")
    first, *others = with_whole_races(folders)
    name = export_name(first) + (f"_and_{len(others)}_more" if others else "")
    if what == "page":
        entries = named([stored_competitor(folder) for folder in folders])
        return File(f"{name}.html", offline_page(entries).encode())
    if what == "CSV":
        return File(f"{name}.csv", telemetry_csv(named_runs(folders)))
    return File(f"{name}.zip", zipped(folders))


def _rendered(client: viser.ClientHandle) -> np.ndarray:
    """Return the scene in a visitor's view, without a background.  (height, width, 4) uint8"""
    camera = client.camera
    return client.get_render(
        camera.image_height, camera.image_width, transport_format="png", timeout=RENDER_TIMEOUT
    )
