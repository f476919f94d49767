"""Dashboard: binds the snapshots of a session to the handles of a page, at its own pace."""

from __future__ import annotations

import threading
import traceback
from time import perf_counter
from typing import Any

import viser

from web import laps, planner, timing
from web.camera import Camera
from web.choices import Choices, FlightFactory
from web.export_panel import ExportPanel
from web.lap_timing import LapTiming, lap_timings
from web.panels import PlaybackPanel, SamplerPanel
from web.race import Snapshot
from web.race_panel import Menu, RacePanel
from web.race_scene import TABS, RaceScene
from web.session import Session
from web.view import ViewPanel

SCENE, TABLES, SUMS = 1 / 25, 1 / 8, 1.0  # periods of the scene, of tables and signals, of spectra and gaps [s]
COLOURS: dict[str, Any] = {"error": "red", "crash": "orange", "lap": "green", "wait": "blue"}  # of notices


class Dashboard:
    def __init__(
        self, server: viser.ViserServer, session: Session, flight_factory: FlightFactory, menu: Menu, first: Choices
    ):
        self._server, self._session = server, session
        self._stage: RaceScene | None = None
        self._race, self._notice = 0, 0  # the last that were shown
        self._wrote = self._summed = -1.0  # when [s]
        self._closing = threading.Event()
        self._controls(flight_factory, menu, first)
        self._panels()
        self._thread = threading.Thread(target=self._run, name="page", daemon=True)
        self._thread.start()

    def close(self) -> None:
        self._closing.set()
        self._thread.join()

    def _controls(self, flight_factory: FlightFactory, menu: Menu, first: Choices) -> None:
        gui, session = self._server.gui, self._session
        gui.configure_theme(dark_mode=True, show_logo=False, show_share_button=False, brand_color=(230, 159, 0))
        self.race = RacePanel(gui, session, menu, first)
        self.sampler = SamplerPanel(gui, session, flight_factory, self.race)
        self._playback = PlaybackPanel(gui, session)
        self._camera = Camera(self._server)
        self._view = ViewPanel(self._server, session, self._camera)
        ExportPanel(gui, session)
        gui.main_panel.dock_left()
        gui.main_panel.set_width(270)

    def _panels(self) -> None:
        gui = self._server.gui
        top, below, head = gui.add_panel(), gui.add_panel(), gui.add_panel()
        self._tables: dict[str, viser.GuiHtmlHandle] = {}
        for name in ("Timing", "Laps", "Events", "Planner"):
            with top.add_tab(name):
                self._tables[name] = gui.add_html("")
        self._plots = {name: below.add_tab(name) for name in TABS}
        with self._plots["Spectrum"]:
            self._tables["Chatter"] = gui.add_html("", order=1e6)  # below the curves, which come and go
        with head.add_tab("HUD"):
            self._tables["HUD"] = gui.add_html("")
        top.dock_right()
        top.set_width(400)
        below.dock_below(top)
        head.float(x=200, y=12, width=520)

    def _run(self) -> None:
        while not self._closing.wait(SCENE):
            watched = bool(self._server.get_clients())
            self._session.watch(watched and self._view.sampled_trajectories.value)
            if watched:
                try:
                    self._draw(self._session.snapshot)
                except Exception:  # one bad picture must not be the last
                    traceback.print_exc()
                    self._closing.wait(1.0)

    def _draw(self, s: Snapshot) -> None:
        now, all_ = perf_counter(), lap_timings(s, self._view.by_place)
        write, sums = now - self._wrote > TABLES, now - self._summed > SUMS
        with self._server.atomic():
            if s.race != self._race and all_ and len(all_) == len(s.competitors):
                self._stage = RaceScene(self._server, s, self._plots, self._view.true_size.value)
                self._race, sums = s.race, True
                self._camera.frame(s.competitors[0].course)
            if self._stage and s.race == self._race:
                self._stage.move(all_, self._view.by_speed(len(all_)), self._view.sampled_trajectories.value)
                self._camera.follow(all_[0])
            if write:
                self._write(s, all_)
                self._wrote = now
        if sums and self._stage and s.race == self._race:
            self._stage.draw_sums(all_)
            self._set("Chatter", planner.chatter(s.competitors))
            self.race.refresh()
            self._summed = now
        self._notify(s)

    def _write(self, s: Snapshot, all_: list[LapTiming]) -> None:
        self._set("HUD", timing.hud(s, all_))
        self._set("Events", timing.events(s.competitors, s.t))
        if self._stage and s.race == self._race:
            self._set("Timing", timing.tower(all_) + self._stage.map.draw(all_))
            self._set("Laps", laps.laps(s.competitors))
            self._set("Planner", planner.planner(all_[0]))
            self._stage.draw_signals(all_)
        self._playback.update(s)
        self.sampler.enable(s)

    def _set(self, name: str, content: str) -> None:
        if self._tables[name].content != content:
            self._tables[name].content = content

    def _notify(self, s: Snapshot) -> None:
        for notice in s.notices:
            if notice.number > self._notice:
                self._notice = notice.number
                for client in self._server.get_clients().values():
                    client.add_notification(
                        notice.title, notice.text, auto_close_seconds=6.0, color=COLOURS[notice.kind]
                    )
