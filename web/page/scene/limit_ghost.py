"""LimitGhost: the best known race of `race limit` as a pale drone with its path."""

from __future__ import annotations

import viser

from quadsim.web.page.scene.drones import Drone
from quadsim.web.race.competitor import Competitor

NODES = ("/competitor/limit", "/trail/limit", "/path/limit")


class LimitGhost:
    """The ghost of one race, which is in the scene only while it is shown.

    Args:
        entry: see quadsim.web.race.limit_race; None: no limit is known, and nothing is shown.
        scale, width: factors on the size of drones and lines.
    """

    def __init__(self, scene: viser.SceneApi, entry: Competitor | None, scale: float, width: float):
        self._scene = scene
        self._entry = entry
        self._scale = scale
        self._width = width
        self._drone: Drone | None = None

    def show(self, t: float, place: float | None) -> None:
        """Show the ghost at t [s], or at this distance along the race [m]."""
        entry = self._entry
        if entry is None:
            return
        if self._drone is None:
            self._drone = Drone(
                self._scene,
                entry.name,
                entry,
                ghost=True,
                is_named=True,
                scale=self._scale,
                width=self._width,
            )
        self._drone.show(entry, entry.at(t) if place is None else entry.at_place(place), False)

    def hide(self) -> None:
        """Remove the ghost from the scene."""
        if self._drone is not None:
            for name in NODES:
                self._scene.remove_by_name(name)
            self._drone = None
