"""How the race is shown, and the keys that control it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import viser

from web.camera import CHASE, FREE, TOP, Camera
from web.html import box, small, table
from web.race import Race
from web.session import Session

TIME, PLACE = "by time", "by place"
AUTO, SPEED, SAMPLER = "auto", "speed", "sampler"


class ViewPanel:
    def __init__(self, server: viser.ViserServer, session: Session, camera: Camera):
        gui = server.gui
        with gui.add_folder("View", expand_by_default=False):
            self.look = gui.add_dropdown("Camera", (FREE, CHASE, TOP), initial_value=FREE)
            self.sync = gui.add_dropdown("Ghosts", (TIME, PLACE), initial_value=TIME, hint="where others are shown")
            self.trail = gui.add_dropdown("Trails", (AUTO, SPEED, SAMPLER), initial_value=AUTO)
            self.sampled_trajectories = gui.add_checkbox(
                "Samples", True, hint="the cheapest of the sampled paths; white: the plan"
            )
            self.true_size = gui.add_checkbox("True size", False, hint="of the drones, from the next start")
        self.look.on_update(lambda _: camera.set(self.look.value))
        self._camera, self._session, self._gui = camera, session, gui
        self._keys()

    @property
    def by_place(self) -> bool:
        return self.sync.value == PLACE

    def by_speed(self, competitors: int) -> bool:
        """Alone, a trail tells the speed; among others, whose it is."""
        return self.trail.value == SPEED or (self.trail.value == AUTO and competitors == 1)

    def _keys(self) -> None:
        tell = self._session.tell
        self._rows: list[list[str] | str] = []
        self._key("space", "pause, go on", lambda: tell(Race.play))
        self._key("N", "one step", lambda: tell(Race.step, 1))
        self._key("R", "restart", lambda: tell(Race.restart))
        self._key("E", "next event", lambda: tell(Race.jump))
        self._key("C", "camera: free, chase, top", self._turn)
        self._key("H", "help: these keys", None)

    def _key(self, key: Any, what: str, do: Callable[[], None] | None) -> None:
        """None: the list of keys, for whoever asks."""
        command = self._gui.add_command(what, hotkey=key)
        command.on_trigger(lambda event: do() if do else self._help(event.client))
        self._rows.append([key, what])

    def _turn(self) -> None:
        mode: Any = self._camera.next()
        self.look.value = mode

    def _help(self, client: viser.ClientHandle | None) -> None:
        if client is None:
            return
        with client.gui.add_modal("Keys") as modal:
            note = "Sliders act at the next plan; a flight changed so is marked interactive and is not comparable."
            client.gui.add_html(box(table(["key", "does"], self._rows, left=2), small(note)))
            client.gui.add_button("Close").on_click(lambda _: modal.close())
