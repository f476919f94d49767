"""Dashboard: shows the snapshots of a session on a page, at the page's own rate."""

from __future__ import annotations

import threading
import traceback
from math import inf
from time import perf_counter
from typing import Any

import viser

from quadsim.course import Course
from web.flight_factory import Choices, FlightFactory
from web.lap_timing import LapTiming, lap_timings
from web.page.camera import Camera
from web.page.charts import TABS, Charts, Tabs, put_away_charts
from web.page.course_map import Map
from web.page.export import add_export
from web.page.html import STYLE
from web.page.laps import chatter, laps
from web.page.messages import VISITORS
from web.page.panels import PlaybackPanel, ViewPanel, add_visitors
from web.page.race_panel import Menu, RacePanel
from web.page.race_scene import RaceScene, preview
from web.page.sampler_panel import SamplerPanel
from web.page.timing import events, hud, planner, tower
from web.race import Snapshot
from web.session import Session

# periods of the scene, tables, signals, spectra and gaps [s]
SCENE, TABLES, SIGNALS, SLOW = 1 / 25, 1 / 8, 1 / 5, 1.0
# of notices
COLOURS: dict[str, Any] = {"error": "red", "crash": "orange", "lap": "green", "wait": "blue"}


class Due:
    """Whether to show something again: when it has changed, but not more often than once a period
    [s]."""

    def __init__(self, period: float):
        self._period, self._at, self._shown = period, -inf, None

    def __call__(self, what: object) -> bool:
        now = perf_counter()
        if what == self._shown or now - self._at < self._period:
            return False
        self._shown, self._at = what, now
        return True


class RaceView:
    """What is built for one race: its scene, map and charts."""

    def __init__(self, server: viser.ViserServer, s: Snapshot, tabs: Tabs, true_size: bool):
        clear(server, tabs)
        self.race = s.race
        self.scene = RaceScene(server.scene, s.competitors, true_size)
        self.map = Map(s.competitors[0].course)
        self.charts = Charts(server.gui, tabs, s.competitors)


class Dashboard:
    def __init__(
        self,
        server: viser.ViserServer,
        session: Session,
        flight_factory: FlightFactory,
        menu: Menu,
        first: Choices,
    ):
        self._server, self._session = server, session
        self._view: RaceView | None = None
        self._previewed: Course | None = None
        # the race, and the course that was chosen when it was last flying
        self._race, self._passed_over = 0, None
        self._notice = 0  # number of the last that was shown
        self._scene_due, self._tables_due, self._slow_due = Due(0.0), Due(TABLES), Due(SLOW)
        self._controls_due, self._signals_due, self._runs_due = Due(TABLES), Due(SIGNALS), Due(SLOW)
        self._past_due = Due(TABLES)
        gui = server.gui
        gui.configure_theme(
            dark_mode=True, show_logo=False, show_share_button=False, brand_color=(230, 159, 0)
        )
        gui.add_html(STYLE)
        visitors = VISITORS[server]
        self.race = RacePanel(gui, session, menu, first, visitors)
        self.sampler = SamplerPanel(gui, session, flight_factory, self.race)
        self._playback = PlaybackPanel(gui, session, self.race)
        self._camera = Camera(server)
        self._options = ViewPanel(gui, session, self._camera, self.race)
        visitors.free |= {add_export(gui, session)._impl.uuid, *self._options.free}
        add_visitors(gui, visitors)
        self._add_panels(gui)
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="page", daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._closing.set()
        self._thread.join()

    def _add_panels(self, gui: viser.GuiApi) -> None:
        gui.main_panel.dock_left()
        gui.main_panel.set_width(270)
        top, below, head = gui.add_panel(), gui.add_panel(), gui.add_panel()
        self._tabs = {name: below.add_tab(name) for name in TABS}
        tabs = {name: top.add_tab(name) for name in ("Timing", "Laps", "Events", "Planner")}
        tabs |= {"HUD": head.add_tab("HUD"), "Chatter": self._tabs["Spectrum"]}
        self._tables: dict[str, viser.GuiHtmlHandle] = {}
        for name, tab in tabs.items():
            with tab:
                # below the charts of a tab, which come and go
                self._tables[name] = gui.add_html("", order=1e6)
        top.dock_right()
        top.set_width(430)
        below.dock_below(top)
        head.float(x=10, y=12, width=480)
        head.expand()  # on a phone it is a part of the sheet, folded by itself

    def _run(self) -> None:
        while not self._closing.wait(SCENE):
            watched = bool(self._server.get_clients())
            self._session.show_trajectories(watched and self._options.trajectories.value)
            if watched:
                try:
                    self._update(self._session.snapshot)
                except Exception:  # an error in one update must not end the page
                    traceback.print_exc()
                    self._closing.wait(1.0)

    def _update(self, s: Snapshot) -> None:
        """Only what has changed: a race that has ended, or stands still, sends nothing."""
        now, options, timings = (
            perf_counter(),
            self._options,
            lap_timings(s, self._options.by_place),
        )
        look = (options.by_place, options.by_speed(len(timings)), options.trajectories.value)
        state = (
            s.race,
            s.t,
            s.end,
            s.playing,
            s.flying,
            look,
            tuple(e.state for e in s.competitors),
        )
        with self._server.atomic():
            view = self._view_of(s, timings)
            if view:
                if self._scene_due((view, state)):
                    view.scene.update(timings, *look[1:])
                self._camera.follow(timings[0])
            if self._tables_due((view, state)):
                self._update_tables(s, timings, view)
            if self._controls_due(now):
                self._playback.update(s)
                self.sampler.update(s)
                self.race.update(s)
        if view and self._signals_due((view, state)):
            view.charts.update_signals(timings)
        if self._past_due((view, [e.past(s.t) for e in s.competitors])):
            self._tables["Events"].content = events(s.competitors, s.t)
            self._tables["Laps"].content = (
                laps([e.until(s.t) for e in s.competitors]) if view else ""
            )
        if view and self._slow_due((view, state)):
            view.charts.update_spectrum(timings)
            view.charts.update_gaps(timings)
            self._tables["Chatter"].content = chatter([e.until(s.t) for e in s.competitors])
        if self._runs_due(now):
            self.race.refresh()
        self._notify(s)

    def _view_of(self, s: Snapshot, timings: list[LapTiming]) -> RaceView | None:
        """None until every competitor of the race has a frame, and where another course was chosen
        since it was on."""
        course = self.race.preview()
        # what is chosen for the next race does not hide this one
        if s.flying or s.race != self._race:
            self._race, self._passed_over = s.race, course
        elif course is not self._passed_over:
            self._passed_over = None
        chosen = course if self._passed_over is None else None
        if chosen and not any(e.course.text == chosen.text for e in s.competitors):
            if chosen is not self._previewed:
                self._preview(chosen)
            return None
        self._previewed = None
        if self._view is not None and self._view.race == s.race:
            return self._view
        if not timings or len(timings) != len(s.competitors):
            return None
        self._view = RaceView(self._server, s, self._tabs, self._options.true_size.value)
        self._camera.show(s.competitors[0].course, self._view.scene.drone_size)
        return self._view

    def _preview(self, course: Course) -> None:
        """The course that START will fly."""
        clear(self._server, self._tabs)
        self._view, self._previewed = None, course
        self._camera.show(course, preview(self._server.scene, course))
        self._tables["Timing"].content = Map(course).draw([])

    def _update_tables(self, s: Snapshot, timings: list[LapTiming], view: RaceView | None) -> None:
        self._tables["HUD"].content = hud(s, timings)
        if view:
            self._tables["Timing"].content = tower(timings) + view.map.draw(timings)
            self._tables["Planner"].content = planner(timings[0])

    def _notify(self, s: Snapshot) -> None:
        for notice in (n for n in s.notices if n.number > self._notice):
            self._notice = notice.number
            for client in self._server.get_clients().values():
                client.add_notification(
                    notice.title, notice.text, auto_close_seconds=6.0, color=COLOURS[notice.kind]
                )


def clear(server: viser.ViserServer, tabs: Tabs) -> None:
    """Remove the scene, put the charts away."""
    server.scene.reset()
    put_away_charts(tabs)
    forget_removed(server)


def forget_removed(server: viser.ViserServer) -> None:
    """Let the server forget what was removed once every open page knows. By itself it does so only
    when another client
    connects: until then the messages that remove a race's charts pile up, race by race.

    Private in viser 1.1.1, the version that is pinned. If another one has no such method: look at
    what it runs when a client connects, or drop this call where tests/web/test_memory.py holds
    without it. Not forced: that would forget removals that open pages have yet to be told, and
    those would show the last race's charts and drones for ever.
    """
    server._run_garbage_collector()
