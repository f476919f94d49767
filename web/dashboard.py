"""Dashboard: binds the snapshots of a session to the handles of a page, at its own pace."""

from __future__ import annotations

import threading
from time import perf_counter

import viser

from web import laps, planner, timing
from web.camera import Camera
from web.charts import Gaps, Signals, Spectrum
from web.choices import Choices, Hangar
from web.drone import Drone, FanView
from web.map import Map
from web.panels import Menu, PlaybackPanel, RacePanel, SamplerPanel
from web.race import Snapshot
from web.recording import stored_fan
from web.scene import CourseView
from web.session import Session
from web.standing import Standing, standings
from web.take import ExportPanel
from web.view import ViewPanel

SCENE, TABLES, SLOW = 1 / 25, 1 / 8, 1.0  # periods of the scene, of tables and signals, of spectra and gaps [s]


class Dashboard:
    def __init__(self, server: viser.ViserServer, session: Session, hangar: Hangar, menu: Menu, first: Choices):
        self._server, self._session = server, session
        self._race, self._notice, self._drawn, self._slow = -1, 0, 0.0, 0.0
        self._drones: list[Drone] = []
        self._course: CourseView | None = None
        self._map: Map | None = None
        self._charts: tuple[Signals, Spectrum, Gaps] | None = None
        self._closing = threading.Event()
        self._layout(hangar, menu, first)
        self._thread = threading.Thread(target=self._run, name="page", daemon=True)

    def open(self) -> None:
        self._thread.start()

    def close(self) -> None:
        self._closing.set()
        self._thread.join()

    def _layout(self, hangar: Hangar, menu: Menu, first: Choices) -> None:
        gui, session = self._server.gui, self._session
        gui.configure_theme(dark_mode=True, show_logo=False, show_share_button=False, brand_color=(230, 159, 0))
        self.race = RacePanel(gui, session, hangar, menu, first)
        self.sampler = SamplerPanel(gui, session, hangar, self.race)
        self.playback = PlaybackPanel(gui, session)
        self.camera = Camera(self._server)
        self.view = ViewPanel(self._server, session, self.camera)
        ExportPanel(gui, session)
        gui.main_panel.dock_left()
        gui.main_panel.set_width(270)
        self._tables, self._plots = {}, {}
        top, below, head = gui.add_panel(), gui.add_panel(), gui.add_panel()
        for name in ("Timing", "Laps", "Events", "Planner"):
            with top.add_tab(name):
                self._tables[name] = gui.add_html("")
        for name in ("Signals", "Spectrum", "Gap"):
            self._plots[name] = below.add_tab(name)
        with self._plots["Spectrum"]:
            self._tables["Chatter"] = gui.add_html("", order=1e6)
        with head.add_tab("HUD"):
            self._tables["HUD"] = gui.add_html("")
        top.dock_right()
        top.set_width(400)
        below.dock_below(top)
        head.float(x=200, y=12, width=520)

    def _run(self) -> None:
        while not self._closing.wait(SCENE):
            clients = self._server.get_clients()
            self._session.watch(bool(clients) and self.view.fan.value)
            if clients or self._race < 0:
                self._draw(self._session.snapshot)

    def _draw(self, s: Snapshot) -> None:
        all_ = standings(s, self.view.by_place)
        now = perf_counter()
        with self._server.atomic():
            if s.race != self._race and len(all_) == len(s.lanes):
                self._build(s)
            if all_ and self._charts:
                self._move(s, all_)
            if now - self._drawn > TABLES:
                self._drawn = now
                self._write(s, all_)
        if all_ and self._charts and now - self._slow > SLOW:
            self._slow = now
            self._write_slow(s, all_)
        self._notify(s)

    def _build(self, s: Snapshot) -> None:
        """Another race: another scene, other curves."""
        self._race = s.race
        scene = self._server.scene
        scene.reset()
        for tab in self._plots.values():
            for handle in [h for h in tab._children.values() if isinstance(h, viser.GuiUplotHandle)]:
                handle.remove()
        if not s.lanes:
            return
        course = s.lanes[0].course
        self._course, self._map = CourseView(scene, course), Map(course)
        scale = self.view.scale.value
        self._drones = [Drone(scene, str(k), lane, k > 0, scale) for k, lane in enumerate(s.lanes)]
        self._fan = FanView(scene)
        kinds = []
        for kind, name in ((Signals, "Signals"), (Spectrum, "Spectrum"), (Gaps, "Gap")):
            with self._plots[name]:
                kinds.append(kind(self._server.gui, s.lanes))
        self._charts = tuple(kinds)
        self.camera.frame(course)
        self._slow = 0.0

    def _move(self, s: Snapshot, all_: list[Standing]) -> None:
        by_speed = self.view.by_speed(len(all_))
        for drone, standing in zip(self._drones, all_, strict=True):
            drone.show(standing.lane, standing.i, by_speed)
        self._course.colour(all_[0].gate, timing.hit_gates(all_))
        self._show_fan(all_[0])
        self.camera.follow(all_[0])

    def _show_fan(self, s: Standing) -> None:
        lane = s.lane
        if not self.view.fan.value:
            self._fan.show(None)
        elif lane.live and lane.fan is not None and lane.outcome is None:
            self._fan.show(lane.fan.paths, lane.fan.nominal)
        else:
            self._fan.show(stored_fan(s))

    def _write(self, s: Snapshot, all_: list[Standing]) -> None:
        texts = {"HUD": timing.hud(s, all_), "Events": timing.events(s.lanes, s.t)}
        if all_ and self._map:
            texts["Timing"] = timing.tower(all_) + self._map.draw(all_)
            texts["Laps"] = laps.laps(s.lanes)
            texts["Planner"] = planner.planner(all_[0])
        for name, content in texts.items():
            self._set(name, content)
        if all_ and self._charts:
            self._charts[0].update(all_)
        self.playback.update(s)
        self.sampler.enable(s)

    def _write_slow(self, s: Snapshot, all_: list[Standing]) -> None:
        for chart in self._charts[1:]:
            chart.update(all_)
        self._set("Chatter", planner.chatter(s.lanes))
        self.race.refresh()

    def _set(self, name: str, content: str) -> None:
        handle = self._tables[name]
        if handle.content != content:
            handle.content = content

    def _notify(self, s: Snapshot) -> None:
        colours = {"error": "red", "crash": "orange", "lap": "green"}
        for notice in s.notices:
            if notice.number > self._notice:
                self._notice = notice.number
                for client in self._server.get_clients().values():
                    client.add_notification(
                        notice.title, notice.text, auto_close_seconds=6.0, color=colours[notice.kind]
                    )
