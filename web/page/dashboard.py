"""Dashboard: builds the page of a session, connects its parts, and keeps it up to date."""

from __future__ import annotations

import threading
import traceback
from dataclasses import replace
from functools import partial
from time import perf_counter

from quadsim.web.page.due import Beat, Calm
from quadsim.web.page.forms.choice_forms import RaceForm, ViewForm
from quadsim.web.page.forms.competitor_forms import ChooseRow, CompetitorForm, NumbersForm
from quadsim.web.page.forms.course_editor import CourseEditor
from quadsim.web.page.forms.export_form import ExportForm
from quadsim.web.page.forms.flight_controls import FlightControls
from quadsim.web.page.forms.flight_numbers import FlightNumbersForm
from quadsim.web.page.forms.forms import Forms
from quadsim.web.page.forms.joining import Joining
from quadsim.web.page.forms.playback import Playback
from quadsim.web.page.forms.runs_panel import RunsPanel
from quadsim.web.page.parts.board import Board
from quadsim.web.page.parts.charts import signals_of
from quadsim.web.page.projector import Projector
from quadsim.web.page.scene.camera import Camera
from quadsim.web.page.server.page_server import PageServer
from quadsim.web.page.shared_parts import SharedParts
from quadsim.web.page.stages import Stages
from quadsim.web.page.visitor_scene import VisitorScene
from quadsim.web.race.next_start import NextStart
from quadsim.web.race.session import Session
from quadsim.web.race.viewing import Viewing
from quadsim.web.state.choices import Choices
from quadsim.web.state.commands import Leave
from quadsim.web.state.desk import Desk
from quadsim.web.state.menu import Menu

# times between two updates of the page [s]
SCENE = 1 / 25  # the shortest one
PAUSE = 0.1  # the longest one, also while nothing changes
ANSWERS = 0.1  # between two answers to a page
CALM = 1.0  # without a change, after which the pause is the longest one
# Largest share of the time for updates of the page, as the planners need all cores
SHARE = 1 / 8


def pause_after(spent: float) -> float:
    """Return the time to wait after an update [s].

    Updates take at most SHARE of the time, but the pause is at most PAUSE, even after a long update
    such as the build of a scene.

    Args:
        spent: time that the update took [s].
    """
    return min(max(SCENE, spent / SHARE - spent), PAUSE)


class Dashboard:
    """The page of a session, until `close`.

    Every visitor watches a time of its own in a view of its own; the race, what START flies and the
    course in work are everybody's.

    Args:
        menu: the available choices.
        first: the initially chosen competitors.

    Attributes:
        desk: the owner of the state of the page.
        start: what the next START flies.
        board: the parts of the page.
    """

    def __init__(self, server: PageServer, session: Session, menu: Menu, *first: Choices):
        link, seats = server.link, server.seats
        self._woken = threading.Event()  # there is something to show at once
        server.gui.configure_theme(dark_mode=True, show_logo=False, show_share_button=False)
        # What is everybody's, and what each visitor watches
        flights = [replace(one, runs_dir=str(session.root)) for one in first]
        self.desk = Desk(*flights, menu=menu)
        self.start = NextStart(self.desk, str(session.root))
        self._session = session
        viewing = Viewing(self.desk, session)
        self.camera = Camera(server)
        self.board = Board(link, seats, self.camera, self._woken.set)
        # What visitors ask for
        self._runs = RunsPanel(server, session, self.start, viewing)
        self.controls = FlightControls(link, session, self.start, viewing, seats)
        Playback(link, session, viewing, seats, self.camera, self.controls.come_back)
        self._signals = signals_of(link, viewing)
        joining = Joining(self.board, session.cockpit, viewing, seats, self.camera)
        self._editor = CourseEditor(session, self.start, server.downloads)
        self._competitors = CompetitorForm(self.start)
        self._export = ExportForm(
            session,
            self.start,
            viewing,
            seats,
            self.camera,
            server.downloads,
            server.needs_token,
        )
        forms = (
            RaceForm(self.start),
            self._competitors,
            NumbersForm(self.desk),
            FlightNumbersForm(self.desk, session, viewing),
            ViewForm(self.desk),
            self._editor,
            self._export,
        )
        Forms(self.board, forms)
        link.on(ChooseRow, self._competitors.edit)
        link.on_arrive(lambda visitor: viewing.arrive(visitor.number))
        link.on_leave(lambda one: self.desk.do(Leave(one.number, seats.forget(one))))
        # What visitors are shown
        self.stages = Stages(self.start, self._editor)
        self._projector = Projector(
            server=server,
            session=session,
            viewing=viewing,
            stages=self.stages,
            shared=SharedParts(self.board, self.desk, self.controls.series, self._editor),
            joining=joining,
            board=self.board,
            scene_of=partial(VisitorScene, camera=self.camera, editor=self._editor),
        )
        link.open()
        self._answers = Beat(ANSWERS)
        self._is_calm = Calm(CALM)
        self._is_closing = False
        session.steps = self._woken.set
        self._thread = threading.Thread(target=self._run, name="page", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop showing anything."""
        self._is_closing = True
        self._woken.set()
        self._thread.join()
        self._editor.close()
        self._runs.close()
        self._projector.close()
        self._export.close()

    def _run(self) -> None:
        """Show one snapshot after another."""
        pause = SCENE
        while True:
            is_woken = self._woken.wait(pause)
            self._woken.clear()
            if self._is_closing:
                return
            began = perf_counter()
            try:
                self._update()
            except Exception:
                # an error in one update must not end the page
                traceback.print_exc()
                self._woken.wait(1.0)
            if is_woken or self._answers.strikes():
                self._answer()
            shown = (self._projector.seen, self.desk.state, self._editor.shown)
            pause = PAUSE if self._is_calm(shown) else pause_after(perf_counter() - began)

    def _update(self) -> None:
        """Go on with what several updates take, and show the race as it is now."""
        self.controls.turn(self._session.snapshot)
        s = self._session.snapshot
        self._editor.update(s)
        if self.board.is_wanted("competitors"):
            self._competitors.update()
        self._projector.show(s)

    def _answer(self) -> None:
        """Answer the pages for which there is something new."""
        self.board.answer()
        self._signals.answer()
