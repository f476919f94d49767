"""Dashboard: shows the snapshots of a session on a page, at the page's own rate."""

from __future__ import annotations

import threading
import traceback
from collections.abc import Container, Mapping
from dataclasses import replace
from math import inf
from time import perf_counter

from quadsim.course import Course
from quadsim.web.page.due import Beat, Due
from quadsim.web.page.forms.competitor_forms import ChooseRow, CompetitorForm, NumbersForm
from quadsim.web.page.forms.course_editor import CourseEditor
from quadsim.web.page.forms.export_form import ExportForm
from quadsim.web.page.forms.flight_controls import FlightControls
from quadsim.web.page.forms.flight_numbers import FlightNumbersForm
from quadsim.web.page.forms.forms import Forms
from quadsim.web.page.forms.joining import Joining
from quadsim.web.page.forms.playback import Playback
from quadsim.web.page.forms.race_form import RaceForm
from quadsim.web.page.forms.runs_panel import RunsPanel
from quadsim.web.page.forms.view_form import ViewForm
from quadsim.web.page.parts.board import EVERYBODY, Board
from quadsim.web.page.parts.charts import answer_signals
from quadsim.web.page.parts.elements import EMPTY
from quadsim.web.page.parts.head import Head, Word, coming_head
from quadsim.web.page.parts.line_up_table import table_of
from quadsim.web.page.parts.moment import Moments
from quadsim.web.page.parts.pictures import Pictures
from quadsim.web.page.parts.seeds_table import seeds_of
from quadsim.web.page.parts.time_line import time_line_of
from quadsim.web.page.scene.camera import Camera, set_initial_camera
from quadsim.web.page.screen import Beats, Rest, Screen, Seen
from quadsim.web.page.server.page_server import PageServer
from quadsim.web.page.stage import Stage
from quadsim.web.page.visitor_scene import VisitorScene
from quadsim.web.race.next_start import NextStart
from quadsim.web.race.page_race import PageRace
from quadsim.web.race.session import Session
from quadsim.web.race.snapshot import Snapshot
from quadsim.web.race.viewing import Viewing
from quadsim.web.state.choices import Choices
from quadsim.web.state.commands import Leave
from quadsim.web.state.desk import Desk
from quadsim.web.state.line_up import LineUp, line_up_of
from quadsim.web.state.menu import Menu
from quadsim.web.state.offered_presets import offered_presets
from quadsim.web.state.page_state import PageState

# periods [s]
SCENE = 1 / 25  # shortest time between two updates of the page
TABLES = 1 / 8
SLOW = 1.0  # period of spectra and gaps [s]
PAUSE = 0.1  # longest time between two updates of the page
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
        flights = [replace(one, runs_dir=str(session.root)) for one in first]
        self.desk = Desk(*flights, menu=menu)
        self._menu = menu
        self._line_up = line_up_of(self.desk.state)
        self._line_up_of = self._asked(self.desk.state)
        self._server = server
        self._session = session
        self._raced = Stage()  # the last race
        self._preview = Stage()  # the course that was chosen since
        self._edited = Stage(is_edited=True)
        self._begun: Course | None = None  # that new cameras frame
        self._scenes: dict[int, VisitorScene] = {}  # by the numbers of viser's visitors
        self._screens: dict[int, Screen] = {}  # by the numbers of the link's visitors
        self._moments = Moments()
        self._rest = Rest(Head("rest", []), Head("editing", []), EMPTY)
        self._race = 0  # number of the last race
        self._passed_over: Course | None = None  # course that was chosen during that race
        self._factor = self.desk.state.factor  # race seconds per second that flights have
        self._tables_beat = Beat(TABLES)
        self._slow_beat = Beat(SLOW)
        self._past_due = Due(0.0)
        self._coming_due = Due(0.0)
        self._edited_due = Due(0.0)
        self._presets_due = Due(0.0)
        self._second_beat = Beat(SLOW)
        server.gui.configure_theme(dark_mode=True, show_logo=False, show_share_button=False)
        link, seats = server.link, server.seats
        self.start = NextStart(self.desk, str(session.root))
        self._viewing = viewing = Viewing(self.desk, session)
        self.runs = RunsPanel(server, session, self.start, viewing)
        self._series = FlightControls(link, session, self.start, viewing).series
        self._camera = Camera(server)
        self.board = Board(link, seats, self._camera)
        Playback(link, session, viewing, seats, self._camera)
        self._joining = Joining(self.board, session.cockpit, viewing, seats, self._camera)
        answer_signals(link, viewing)
        self._pictures = Pictures(self.board)
        self._editor = CourseEditor(session, self.start)
        self._competitors = CompetitorForm(self.desk)
        self._export = ExportForm(
            session, self.start, viewing, seats, self._camera, server.downloads
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
        link.open()
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="page", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop showing anything."""
        self._closing.set()
        self._thread.join()
        self._editor.close()
        self.runs.close()
        self._pictures.close()
        self._export.close()

    def _run(self) -> None:
        """Show one snapshot after another while there are visitors."""
        pause = SCENE
        while not self._closing.wait(pause):
            began = perf_counter()
            self._series.turn(self._session.snapshot)
            self._set_pace()
            try:
                self._update(self._session.snapshot)
            except Exception:
                # an error in one update must not end the page
                traceback.print_exc()
                self._closing.wait(1.0)
            pause = pause_after(perf_counter() - began)

    def _set_pace(self) -> None:
        """Give flights the pace that was chosen."""
        factor = self.desk.state.factor
        if factor != self._factor:
            self._factor = factor
            self._session.tell(PageRace.set_speed, factor)

    def _update(self, s: Snapshot) -> None:
        """Show every visitor what has changed; who watches what stands still is sent nothing."""
        clients = self._server.get_clients()
        visitors = {visitor.number: visitor for visitor in self._server.link.visitors}
        self._forget_others(clients, visitors)
        if not clients and not visitors:
            self._session.show_trajectories(False)
            return
        state = self.desk.state
        self._update_stages(s)
        sitting = self._server.seats.visitors()
        seen = {number: self._seen_by(number) for number in {EVERYBODY, *visitors}}
        watching = [seen[sitting.get(number, EVERYBODY)] for number in clients]
        self._session.show_trajectories(
            any(one.view.shows_trajectories for one in (*watching, *seen.values()))
        )
        self._joining.update(s, self._moments.of(s).timings if s.by_hand else [])
        beats = Beats(self._tables_beat.strikes(), self._slow_beat.strikes())
        for (number, client), one in zip(clients.items(), watching, strict=True):
            if number not in self._scenes:
                self._scenes[number] = VisitorScene(client, self._camera, self._editor)
            self._scenes[number].update(one.stage, one.moment, one.view)
        if beats.tables:
            self._update_rest(state)
            self._update_shared(s, state)
        for number, visitor in visitors.items():
            if number not in self._screens:
                self._screens[number] = Screen(self.board, visitor, s)
            self._screens[number].update(seen[number], self._rest, beats)
        self._update_pictures({number: seen[number] for number in visitors})
        self._moments.forget_others()

    def _seen_by(self, visitor: int) -> Seen:
        """Return what a visitor watches; EVERYBODY stands for one whose page has not spoken yet."""
        moment = self._moments.of(self._viewing.seen_by(visitor))
        view = self.desk.state.visitor(visitor).view
        return Seen(moment, view, self._stage_for(visitor), self._session.flies(visitor))

    def _forget_others(self, clients: Container[int], visitors: Container[int]) -> None:
        """Forget the scenes and the parts of visitors who have left."""
        for number in [one for one in self._scenes if one not in clients]:
            del self._scenes[number]
        for number in [one for one in self._screens if one not in visitors]:
            self._screens.pop(number).forget()

    def _update_shared(self, s: Snapshot, state: PageState) -> None:
        """Show what is the same for all visitors."""
        if self._past_due((s.race, [entry.past(inf) for entry in s.competitors])):
            self.board.put("time_line", time_line_of(s.competitors))
        self.board.put("seeds", seeds_of(self._series))
        if self.board.is_wanted("competitors"):
            self._update_line_up(state)

    def _update_pictures(self, seen: Mapping[int, Seen]) -> None:
        """Show the pictures of the first drone's camera to those who want them."""
        self._pictures.update(
            {
                number: one.moment.timings[0]
                for number, one in seen.items()
                if one.view.shows_pictures
                and self.board.is_wanted("picture", number)
                and one.is_drawn
            }
        )

    def _update_line_up(self, state: PageState) -> None:
        """Show what START flies, and find out which presets can fly it."""
        self.board.put("line_up", table_of(state, self._line_up_now(state)))
        # A solution may be stored at any time, so that the answer holds for a second.
        course = self.start.course()
        chosen = frozenset(row.choices.preset for row in state.rows)
        vehicles = frozenset(row.choices.vehicle for row in state.rows)
        laps = state.race.laps or (course.laps if course else 0)
        asked = (chosen, vehicles, course, laps)
        if course is None:
            self._competitors.presets = {}
        elif self._presets_due(asked) or self._second_beat.strikes():
            self._competitors.presets = {
                vehicle: offered_presets(
                    self._menu.presets, chosen, course, vehicle, laps, state.race.runs_dir
                )
                for vehicle in vehicles
            }

    def _asked(self, state: PageState) -> object:
        """Return the part of the state that decides what START flies."""
        return state.start, state.world

    def _line_up_now(self, state: PageState) -> LineUp:
        """Return what START flies, in words."""
        asked = self._asked(state)
        if asked != self._line_up_of:
            self._line_up_of = asked
            self._line_up = line_up_of(state)
        return self._line_up

    def _update_stages(self, s: Snapshot) -> None:
        """Put the race and the chosen course on their stages.

        A race is on its stage once every competitor has a frame.
        """
        self._editor.update(s)
        chosen = self._chosen_course(s)
        if chosen and any(entry.course.text == chosen.text for entry in s.competitors):
            chosen = None  # the race is on it
        if chosen is not self._preview.course:
            self._preview = Stage(chosen)
        has_frames = s.competitors and all(len(entry.t) for entry in s.competitors)
        if self._raced.race != s.race and has_frames:
            self._raced = Stage(s.competitors[0].course, s.race, s.competitors)
        if self._raced.race and not s.competitors:
            self._raced = Stage()
        framed = self._raced.course or chosen
        if framed and framed is not self._begun:
            self._begun = framed
            set_initial_camera(self._server, framed)

    def _stage_for(self, visitor: int) -> Stage:
        """Return what a visitor sees: the course in work, the race, or the chosen course.

        A course that is chosen after a race is shown to the visitor who chose it; others go on
        watching the race.
        """
        if self._editor.is_open_for(visitor):
            return self._edited
        is_chooser = self.desk.state.chooser in (EVERYBODY, visitor)
        if self._preview.course and (is_chooser or not self._raced.race):
            return self._preview
        return self._raced

    def _chosen_course(self, s: Snapshot) -> Course | None:
        """Return the course that was chosen after the race, None if none was."""
        course = self.start.course()
        if s.flying or s.race != self._race:
            # Choices for the next race do not hide this one.
            self._race = s.race
            self._passed_over = course
        elif course is not self._passed_over:
            self._passed_over = None
        return course if self._passed_over is None else None

    def _update_rest(self, state: PageState) -> None:
        """Make anew what is shown where no race is, if that has changed."""
        line_up = self._line_up_now(state)
        if self._coming_due((line_up, state.world, state.race.course)):
            self._rest = replace(self._rest, head=coming_head(state, line_up))
        if self._edited_due(self._editor.shown):
            said = self._editor.said()
            self._rest = replace(
                self._rest,
                edited=Head("editing", [Word("Course editor")], more=said),
                edited_map=self._editor.map(),
            )
