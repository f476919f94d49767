"""Stage: everything on the page that is built for one race and thrown away with it."""

from __future__ import annotations

from collections.abc import Mapping

import viser

from web.charts import Gaps, Signals, Spectrum
from web.drone import Drone, FanView
from web.map import Map
from web.race import Snapshot
from web.scene import CourseView, visible_scale
from web.standing import Standing
from web.timing import hit_gates

Plots = Mapping[str, viser.GuiTabHandle]
TABS = ("Signals", "Spectrum", "Gap")


class Stage:
    """plots: a tab for each of TABS, emptied first."""

    def __init__(
        self, server: viser.ViserServer, s: Snapshot, plots: Mapping[str, viser.GuiTabHandle], true_size: bool
    ):
        server.scene.reset()
        for tab in plots.values():
            for handle in [h for h in tab._children.values() if isinstance(h, viser.GuiUplotHandle)]:
                handle.remove()
        forget_removed(server)
        course, gui = s.lanes[0].course, server.gui
        self._course = CourseView(server.scene, course)
        scale = 1.0 if true_size else visible_scale(course)
        self._drones = [Drone(server.scene, str(k), lane, k > 0, scale) for k, lane in enumerate(s.lanes)]
        self._fan = FanView(server.scene)
        self.map = Map(course)
        with plots["Signals"]:
            self._signals = Signals(gui, s.lanes)
        with plots["Spectrum"]:
            self._spectrum = Spectrum(gui, s.lanes)
        with plots["Gap"]:
            self._gaps = Gaps(gui, s.lanes)

    def move(self, all_: list[Standing], by_speed: bool, fan: bool) -> None:
        for drone, standing in zip(self._drones, all_, strict=True):
            drone.show(standing.lane, standing.i, by_speed)
        self._course.colour(all_[0].gate, hit_gates(all_))
        self._show_fan(all_[0], fan)

    def draw_signals(self, all_: list[Standing]) -> None:
        self._signals.update(all_)

    def draw_sums(self, all_: list[Standing]) -> None:
        """What takes longer to work out and changes slowly."""
        self._spectrum.update(all_)
        self._gaps.update(all_)

    def _show_fan(self, s: Standing, on: bool) -> None:
        live = s.lane.fan
        if not on:
            self._fan.show(None)
        elif live is not None:
            self._fan.show(live.paths, live.nominal)
        else:
            show_kept(self._fan, s)


def forget_removed(server: viser.ViserServer) -> None:
    """Let the server forget what was removed once every open page knows. By itself it does so only when somebody new
    connects: until then the messages that remove a race's charts pile up, race by race.

    Private in viser 1.1.1, the version that is pinned. If another one has no such method: look at what it runs when a
    client connects, or drop this call where tests/web/test_memory.py holds without it. Not forced: that would forget
    removals that open pages have yet to be told, and those would show the last race's charts and ghost for ever.
    """
    server._run_garbage_collector()


def show_kept(fan: FanView, s: Standing) -> None:
    """The samples that were kept with the run, if there are some."""
    kept = s.lane.picture(s.i)
    fan.show(kept[1].best if kept else None)
