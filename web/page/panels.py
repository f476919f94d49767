"""The controls of a race that is on: the playback, how it is shown, the keys."""

from __future__ import annotations

from collections.abc import Callable
from math import inf
from time import perf_counter
from typing import Any

import viser

from web.page.camera import MODES, Camera
from web.page.html import box, small, table
from web.page.messages import Visitors
from web.page.race_panel import RacePanel
from web.race import Race, Snapshot
from web.session import Session

HOLD = 0.4  # [s] after the time slider was moved by hand, before it follows the race again
SPEEDS = ("0.1", "0.25", "0.5", "1", "2", "4")  # race seconds a second
TIME, PLACE = "by time", "by place"
AUTO, SPEED, SAMPLER = "auto", "speed", "sampler"


class PlaybackPanel:
    """Pause, step, scrub, speed."""

    def __init__(self, gui: viser.GuiApi, session: Session, race: RacePanel):
        self._session, self._shown = session, 0.0
        self._scrubbed_at = inf  # when the time slider was last moved by hand [s]
        with gui.add_folder("Playback"):
            self.time = gui.add_slider("Time [s]", 0.0, 1.0, 0.01, 0.0)
            self.buttons = gui.add_button_group("", ("<", "pause", ">"))
            self.event = gui.add_button(
                "Next event", icon=viser.Icon.PLAYER_SKIP_FORWARD, color="gray", disabled=True
            )
            self.restart = gui.add_button("Restart", icon=viser.Icon.REPEAT, color="gray")
            self.speed = gui.add_dropdown("Speed [x real time]", SPEEDS, initial_value="1")
        commands: dict[str, tuple] = {"<": (Race.step, -1), ">": (Race.step, 1)}
        commands |= {"pause": (Race.play, False), "play": (Race.play, True)}
        self.buttons.on_click(lambda e: session.tell(*commands[e.target.value]))
        self.event.on_click(lambda _: session.tell(Race.jump))
        self.restart.on_click(race.restart_flight)
        self.speed.on_update(lambda _: session.tell(Race.set_speed, float(self.speed.value)))
        self.time.on_update(self._scrubbed)

    def update(self, s: Snapshot) -> None:
        """The time is not set while the slider is moved by hand. Then all clients are told it
        again: one sent before that may have arrived last.
        """
        self.time.max = round(max(s.end, 1.0), 2)
        self.time.disabled = s.flying and s.playing
        self.buttons.options = ("<", "pause" if s.playing else "play", ">")
        self.event.disabled, self.restart.disabled = s.next_event is None, not s.race
        # -inf: not moved
        t, since = min(round(s.t, 2), self.time.max), perf_counter() - self._scrubbed_at
        if since >= HOLD:
            self._scrubbed_at = inf
            # viser sends changes only
            self.time.value = self._shown = t + 0.01 if t < 0.01 else t - 0.01
        if not 0.0 <= since < HOLD:
            self.time.value = self._shown = t

    def _scrubbed(self, event: viser.GuiEvent) -> None:
        if event.client_id is not None and self.time.value != self._shown:
            self._session.tell(Race.play, False)
            self._session.tell(Race.scrub, float(self.time.value))
            self._scrubbed_at = perf_counter()


class ViewPanel:
    """How the race is shown, and the keys that control it."""

    def __init__(self, gui: viser.GuiApi, session: Session, camera: Camera, race: RacePanel):
        """`free` will hold the uuids of what is each visitor's own."""
        with gui.add_folder("View"):
            self.camera = gui.add_button_group(
                "Camera", MODES, hint="each visitor's own; FPV: from the drone"
            )
            self.ghosts = gui.add_dropdown(
                "Ghosts", (TIME, PLACE), initial_value=TIME, hint="where others are shown"
            )
            self.trails = gui.add_dropdown("Trails", (AUTO, SPEED, SAMPLER), initial_value=AUTO)
            hint = "the cheapest of the samples; white: the plan"
            self.trajectories = gui.add_checkbox("Sampled trajectories", True, hint=hint)
            self.true_size = gui.add_checkbox(
                "True size", False, hint="of the drones, from the next start"
            )
        self.camera.on_click(lambda event: camera.choose(event.client, self.camera.value))
        commands: dict[Any, tuple[str, Callable[[viser.CommandEvent], None]]] = {
            "space": ("pause, go on", lambda _: session.tell(Race.play)),
            "N": ("one step", lambda _: session.tell(Race.step, 1)),
            "B": ("one step back", lambda _: session.tell(Race.step, -1)),
            "S": ("start", race.start_flight),
            "X": ("stop", race.stop_flight),
            "R": ("restart", race.restart_flight),
            "E": ("next event", lambda _: session.tell(Race.jump)),
            "C": (f"camera: {', '.join(MODES)}", lambda event: camera.choose(event.client)),
            "H": ("help: these keys", lambda event: _help(event.client, keys)),
        }
        keys: list[list[str] | str] = [[key, what] for key, (what, _) in commands.items()]
        self.free = {self.camera._impl.uuid}
        for key, (what, command) in commands.items():
            handle = gui.add_command(what, hotkey=key)
            handle.on_trigger(command)
            if key in ("C", "H"):
                self.free.add(handle._impl.uuid)

    @property
    def by_place(self) -> bool:
        return self.ghosts.value == PLACE

    def by_speed(self, competitors: int) -> bool:
        """Whether trails are coloured by speed: by default if there is no other competitor to tell
        apart."""
        return self.trails.value == SPEED or (self.trails.value == AUTO and competitors == 1)


def add_visitors(gui: viser.GuiApi, visitors: Visitors) -> None:
    """The switch by which the first visitor alone has the controls."""
    with gui.add_folder("Visitors", expand_by_default=False):
        hint = "the first visitor keeps the controls, the others have their cameras and the exports"
        alone = gui.add_checkbox("Others only watch", False, hint=hint)
    visitors.switch = alone._impl.uuid

    @alone.on_update
    async def _(_: viser.GuiEvent) -> None:
        visitors.only_first = alone.value


def _help(client: viser.ClientHandle | None, keys: list[list[str] | str]) -> None:
    if client is None:
        return
    with client.gui.add_modal("Keys") as modal:
        note = "Sliders act at the next plan; a flight changed so is marked interactive and is not comparable."
        client.gui.add_html(box(table(["key", "does"], keys, left=2), small(note)))
        client.gui.add_button("Close").on_click(lambda _: modal.close())
