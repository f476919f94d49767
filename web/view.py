"""How it is shown, what is exported, and the keys for it."""

from __future__ import annotations

import viser

from web.camera import CHASE, FREE, TOP, Camera
from web.race import Race
from web.session import Session

TIME, PLACE = "by time", "by place"
AUTO, SPEED, SAMPLER = "auto", "speed", "sampler"
KEYS = (  # key, what it does, the command
    ("space", "Pause or go on", (Race.play,)),
    ("N", "One step", (Race.step, 1)),
    ("R", "Restart", (Race.restart,)),
    ("E", "Next event", (Race.jump,)),
)


class ViewPanel:
    def __init__(self, server: viser.ViserServer, session: Session, camera: Camera):
        gui = server.gui
        with gui.add_folder("View"):
            self.look = gui.add_dropdown("Camera", (FREE, CHASE, TOP), initial_value=FREE)
            self.sync = gui.add_dropdown("Ghosts", (TIME, PLACE), initial_value=TIME)
            self.trail = gui.add_dropdown("Trails", (AUTO, SPEED, SAMPLER), initial_value=AUTO)
            self.fan = gui.add_checkbox("Samples", True)
            self.scale = gui.add_slider("Drone size", 1.0, 5.0, 0.5, 2.5)
        self.look.on_update(lambda _: camera.set(self.look.value))
        self._camera = camera
        self._keys(gui, session)

    @property
    def by_place(self) -> bool:
        return self.sync.value == PLACE

    def by_speed(self, lanes: int) -> bool:
        """Alone, a trail tells the speed; among others, whose it is."""
        return self.trail.value == SPEED or (self.trail.value == AUTO and lanes == 1)

    def _keys(self, gui: viser.GuiApi, session: Session) -> None:
        for key, what, command in KEYS:
            gui.add_command(what, hotkey=key).on_trigger(lambda _, c=command: session.tell(*c))
        gui.add_command("Camera: free, chase, top", hotkey="C").on_trigger(lambda _: self._turn())

    def _turn(self) -> None:
        self.look.value = self._camera.next()
