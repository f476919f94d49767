"""RaceScene: everything on the page that is built for one race and thrown away with it."""

from __future__ import annotations

from collections.abc import Mapping

import viser

from web.charts import Gaps, Signals, Spectrum
from web.drone import Drone, SampledTrajectoriesView
from web.lap_timing import LapTiming
from web.map import Map
from web.race import Snapshot
from web.scene import CourseView, visible_scale
from web.timing import hit_gates

Plots = Mapping[str, viser.GuiTabHandle]
TABS = ("Signals", "Spectrum", "Gap")


class RaceScene:
    """plots: a tab for each of TABS, emptied first."""

    def __init__(
        self, server: viser.ViserServer, s: Snapshot, plots: Mapping[str, viser.GuiTabHandle], true_size: bool
    ):
        server.scene.reset()
        for tab in plots.values():
            for handle in [h for h in tab._children.values() if isinstance(h, viser.GuiUplotHandle)]:
                handle.remove()
        forget_removed(server)
        course, gui = s.competitors[0].course, server.gui
        self._course = CourseView(server.scene, course)
        scale = 1.0 if true_size else visible_scale(course)
        self._drones = [
            Drone(server.scene, str(k), competitor, k > 0, scale) for k, competitor in enumerate(s.competitors)
        ]
        self._fan = SampledTrajectoriesView(server.scene)
        self.map = Map(course)
        with plots["Signals"]:
            self._signals = Signals(gui, s.competitors)
        with plots["Spectrum"]:
            self._spectrum = Spectrum(gui, s.competitors)
        with plots["Gap"]:
            self._gaps = Gaps(gui, s.competitors)

    def move(self, all_: list[LapTiming], by_speed: bool, sampled_trajectories: bool) -> None:
        for drone, standing in zip(self._drones, all_, strict=True):
            drone.show(standing.competitor, standing.i, by_speed)
        self._course.colour(all_[0].gate, hit_gates(all_))
        self._show_fan(all_[0], sampled_trajectories)

    def draw_signals(self, all_: list[LapTiming]) -> None:
        self._signals.update(all_)

    def draw_sums(self, all_: list[LapTiming]) -> None:
        """What takes longer to work out and changes slowly."""
        self._spectrum.update(all_)
        self._gaps.update(all_)

    def _show_fan(self, s: LapTiming, on: bool) -> None:
        live = s.competitor.sampled_trajectories
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


def show_kept(sampled_trajectories: SampledTrajectoriesView, s: LapTiming) -> None:
    """The samples that were kept with the run, if there are some."""
    kept = s.competitor.picture(s.i)
    sampled_trajectories.show(kept[1].best if kept else None)
