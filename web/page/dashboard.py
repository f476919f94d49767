"""Dashboard: shows the snapshots of a session on a page, at the page's own rate."""

from __future__ import annotations

import threading
import traceback
from dataclasses import replace
from math import inf
from time import perf_counter
from typing import Literal

import viser

from quadsim.course import Course
from quadsim.web.choices import Choices
from quadsim.web.commands import Leave
from quadsim.web.desk import Desk
from quadsim.web.lap_timing import LapTiming, at_place_of_first, lap_timings
from quadsim.web.limit_race import limit_race
from quadsim.web.line_up import LineUp, line_up_of
from quadsim.web.menu import Menu
from quadsim.web.next_start import NextStart
from quadsim.web.offered_presets import offered_presets
from quadsim.web.page.board import Board
from quadsim.web.page.camera import Camera
from quadsim.web.page.charts import Charts
from quadsim.web.page.competitor_forms import ChooseRow, CompetitorForm, NumbersForm
from quadsim.web.page.course_editor import CourseEditor
from quadsim.web.page.course_map import Map
from quadsim.web.page.drones import SPAN
from quadsim.web.page.export_form import ExportForm
from quadsim.web.page.flight_controls import FlightControls
from quadsim.web.page.flight_numbers import FlightNumbersForm
from quadsim.web.page.forms import Forms
from quadsim.web.page.head import Head, Word, coming_head, head_of
from quadsim.web.page.joining import Joining
from quadsim.web.page.laps import chatter, laps
from quadsim.web.page.line_up_table import table_of
from quadsim.web.page.link import LinkVisitor
from quadsim.web.page.pictures import Pictures
from quadsim.web.page.playback import Playback, Shown
from quadsim.web.page.race_form import RaceForm
from quadsim.web.page.race_scene import RaceScene, preview
from quadsim.web.page.runs_panel import RunsPanel
from quadsim.web.page.sectors import sectors
from quadsim.web.page.seeds_table import seeds_of
from quadsim.web.page.server import PageServer
from quadsim.web.page.time_line import now_of, time_line_of
from quadsim.web.page.timing import events, planner
from quadsim.web.page.tower import Tower, tower_of
from quadsim.web.page.tree import tree
from quadsim.web.page.view_form import ViewForm
from quadsim.web.page.viser_private import forget_removed
from quadsim.web.race import Snapshot
from quadsim.web.session import Session
from quadsim.web.state import PageState

# periods [s]
SCENE = 1 / 25  # shortest time between two updates of the page
TABLES = 1 / 8
SLOW = 1.0  # period of spectra and gaps [s]
PAUSE = 0.1  # longest time between two updates of the page
LIGHT = 1 / 5  # time between two updates of the scene that sends less
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


PastTable = Literal["laps", "events"]
PAST_TABLES: tuple[PastTable, ...] = ("laps", "events")


class Due:
    """Decides when to show something again: after a change, but at most once per period.

    Args:
        period: [s]
    """

    def __init__(self, period: float):
        self._period = period
        self._at = -inf
        self._shown: object = None

    def __call__(self, what: object) -> bool:
        """Return whether to show `what`, which then counts as shown."""
        now = perf_counter()
        if what == self._shown or now - self._at < self._period:
            return False
        self._shown = what
        self._at = now
        return True


class RaceView:
    """The scene and map of one race."""

    def __init__(self, server: viser.ViserServer, s: Snapshot, true_size: bool):
        self.race = s.race
        self.scene = RaceScene(server.scene, s.competitors, true_size)
        self.map = Map(s.competitors[0].course)


class Dashboard:
    """The page of a session, until `close`.

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
        self._view: RaceView | None = None
        self._previewed: Course | None = None
        self._race = 0  # number of the last race
        self._passed_over: Course | None = None  # course that was chosen during that race
        self._is_editing = False  # whether the edited course is shown
        self._framed_gates = 0  # number of gates of the edited course that cameras frame
        self._notice = 0  # number of the last shown notice
        self._scene_due = Due(0.0)
        self._light_due = Due(LIGHT)
        self._tables_due = Due(TABLES)
        self._past_due = Due(TABLES)
        self._controls_due = Due(TABLES)
        self._table_due: dict[PastTable, Due] = {name: Due(TABLES) for name in PAST_TABLES}
        self._slow_due = Due(SLOW)
        self._chatter_due = Due(SLOW)
        self._presets_due = Due(0.0)
        self._second_due = Due(SLOW)
        server.gui.configure_theme(dark_mode=True, show_logo=False, show_share_button=False)
        self.start = NextStart(self.desk, str(session.root))
        self.runs = RunsPanel(server, session, self.start)
        self._series = FlightControls(server.link, session, self.start).series
        self._camera = Camera(server)
        self.board = Board(server.link, server.seats, self._camera)
        Playback(server, session, server.seats, self._camera)
        self._joining = Joining(server, session.cockpit, server.seats, self._camera)
        self._charts = Charts(server, session)
        self._pictures = Pictures(self.board)
        self._editor = CourseEditor(session, self.start)
        self._competitors = CompetitorForm(self.desk)
        self._export = ExportForm(session, self.start, server.seats, self._camera, server.downloads)
        forms = (
            RaceForm(self.start),
            self._competitors,
            NumbersForm(self.desk),
            FlightNumbersForm(self.desk, session),
            ViewForm(self.desk),
            self._editor,
            self._export,
        )
        Forms(self.board, forms)
        server.link.on(ChooseRow, self._competitors.edit)
        server.link.on_leave(self._forget)
        server.link.open()
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

    def _forget(self, visitor: LinkVisitor) -> None:
        """Forget a visitor who has left."""
        self.desk.do(Leave(visitor.number))

    def _run(self) -> None:
        """Show one snapshot after another while there are visitors."""
        pause = SCENE
        while not self._closing.wait(pause):
            began = perf_counter()
            watched = bool(self._server.get_clients() or self._server.link.has_visitors)
            self._series.turn(self._session.snapshot)
            view = self.desk.state.view
            self._session.show_trajectories(watched and view.shows_trajectories)
            if not watched:
                continue
            try:
                self._update(self._session.snapshot)
            except Exception:
                # an error in one update must not end the page
                traceback.print_exc()
                self._closing.wait(1.0)
            pause = pause_after(perf_counter() - began)

    def _update(self, s: Snapshot) -> None:
        """Show changes; a race that has ended or is paused sends nothing."""
        timings = lap_timings(s)
        state = self.desk.state
        look = state.view
        drawn = at_place_of_first(timings) if timings and look.by_place else timings
        competitors = tuple(entry.state for entry in s.competitors)
        self._joining.update(s, timings)
        self.board.put("now", now_of(s))
        with self._server.atomic():
            self._update_editor(s)
            editing = self._is_editing
            doing = (s.playing, s.flying, s.waiting, editing)
            shown = (s.race, s.t, s.end, doing, look, competitors)
            view = None if editing else self._view_of(s, timings)
            if view:
                scene_due = self._light_due if look.light else self._scene_due
                if scene_due((view, shown)):
                    by_speed = look.by_speed(len(timings))
                    view.scene.update(drawn, by_speed, look.shows_trajectories)
                    view.scene.update_limit(timings[0], look.limit, look.by_place)
                self._camera.follow(timings)
            wanted = self.board.is_wanted("planner")
            if self._tables_due((view, shown, state, wanted)):
                self._update_tables(s, timings, drawn, view)
            if self._controls_due(perf_counter()):
                self.board.put("seeds", seeds_of(self._series))
                if self.board.is_wanted("competitors"):
                    self._update_line_up(state)
        past = [entry.past(s.t) for entry in s.competitors]
        if self._past_due((view, past)):
            self.board.put("time_line", time_line_of(s.competitors))
        for name in PAST_TABLES:
            if self.board.is_wanted(name) and self._table_due[name]((view, past)):
                self._update_past(name, s, view)
        shows_pictures = look.shows_pictures and self.board.is_wanted("picture")
        self._pictures.update(drawn if view else [], shows_pictures)
        if view and self._slow_due((view, shown)):
            self._charts.update(s, timings)
        if view and self.board.is_wanted("chatter") and self._chatter_due((view, shown)):
            self.board.put("chatter", tree(chatter([e.until(s.t) for e in s.competitors])))
        self._notify(s)

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
        elif self._presets_due(asked) or self._second_due(perf_counter()):
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

    def _update_editor(self, s: Snapshot) -> None:
        """Show the edited course instead of a race, while the editor is open."""
        is_open = self._editor.update(s)
        if is_open != self._is_editing:
            self._is_editing = is_open
            self._clear()
            self._previewed = None
            if is_open:
                self._framed_gates = 0
                self._editor.begin(self._server.scene)
        if is_open and self._editor.update_scene():
            self._frame_edited()
            self.board.put(
                "head", Head("editing", [Word("Course editor")], more=tree(self._editor.said()))
            )
            self.board.put("map", tree(self._editor.map()))

    def _frame_edited(self) -> None:
        """Frame the edited course again if it has got another number of gates."""
        framed = self._editor.framed()
        if len(framed.gates) == self._framed_gates:
            self._camera.frame_next(framed)
            return
        self._framed_gates = len(framed.gates)
        self._camera.show(framed, SPAN)

    def _view_of(self, s: Snapshot, timings: list[LapTiming]) -> RaceView | None:
        """Return the view of the race.

        There is none until every competitor has a frame, or if a different course was chosen after
        the race.
        """
        chosen = self._chosen_course(s)
        if chosen and not any(entry.course.text == chosen.text for entry in s.competitors):
            if chosen is not self._previewed:
                self._preview(chosen)
            return None
        self._previewed = None
        if self._view is not None and self._view.race == s.race:
            return self._view
        if not timings or len(timings) != len(s.competitors):
            return None
        self._clear()
        self._view = RaceView(self._server, s, self.desk.state.view.true_size)
        self._camera.show(s.competitors[0].course, self._view.scene.drone_size)
        return self._view

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

    def _preview(self, course: Course) -> None:
        """Show the course of the next START."""
        self._clear()
        self._previewed = course
        self._camera.show(course, preview(self._server.scene, course))
        self.board.put("map", tree(Map(course).draw([])))
        self.board.put("tower", Tower([]))

    def _clear(self) -> None:
        """Remove the scene of the last race."""
        self._server.scene.reset()
        self._view = None
        forget_removed(self._server)

    def _update_tables(
        self,
        s: Snapshot,
        timings: list[LapTiming],
        drawn: list[LapTiming],
        view: RaceView | None,
    ) -> None:
        """Show the tables of the present moment.

        drawn: the timings with the frames that the scene shows.
        """
        if not self._is_editing:
            state = self.desk.state
            coming = coming_head(state, self._line_up_now(state))
            self.board.put("head", head_of(s, timings, coming))
        if not timings:
            self.board.put("tower", Tower([]))
        if view:
            self.board.put("tower", tower_of(timings))
            self.board.put("map", tree(view.map.draw(drawn)))
            if self.board.is_wanted("planner"):
                self.board.put("planner", tree(planner(timings[0])))

    def _update_past(self, name: PastTable, s: Snapshot, view: RaceView | None) -> None:
        """Show the table of past events or laps."""
        if name == "events":
            self.board.put("events", tree(events(s.competitors, s.t)))
            return
        past = [entry.until(s.t) for entry in s.competitors]
        limit = limit_race(s.competitors[0]) if view else None
        table = laps(past, sectors(past, limit)) if view else ""
        self.board.put("laps", tree(table))

    def _notify(self, s: Snapshot) -> None:
        """Show new notices."""
        for notice in s.notices:
            if notice.number <= self._notice:
                continue
            self._notice = notice.number
            self._server.link.send_all(Shown(notice.kind, notice.title, notice.text))
