"""The controls of the shown race: playback, display and keys."""

from __future__ import annotations

from collections.abc import Callable
from math import inf
from time import perf_counter
from typing import NamedTuple

import viser

from web.page.camera import MODES, Camera
from web.page.flight_controls import FlightControls
from web.page.html import box, small, table
from web.race import PageRace, Snapshot
from web.session import Session

HOLD = 0.4  # time after a visitor's move before the time slider follows the race again [s]
RESOLUTION = 0.01  # step of the time slider [s]
SPEEDS = ("0.1", "0.25", "0.5", "1", "2", "4")  # race seconds per second
TIME, PLACE = "by time", "by place"
AUTO, SPEED, SAMPLER = "auto", "speed", "sampler"


class PlaybackPanel:
    """Pause, step, scrub, speed."""

    def __init__(self, gui: viser.GuiApi, session: Session, controls: FlightControls, order: float):
        self._session = session
        self._shown = 0.0  # time that the slider was set to [s]
        self._scrubbed_at = inf  # when the slider was last moved by hand [s]; inf: it was not
        with gui.add_folder("Playback", order=order):
            hint = "the time that is shown; moving it pauses the race"
            self.time = gui.add_slider("Time [s]", 0.0, 1.0, RESOLUTION, 0.0, hint=hint)
            self.buttons = gui.add_button_group("", ("<", "pause", ">"))
            skip = viser.Icon.PLAYER_SKIP_FORWARD
            self.event = gui.add_button("Next event", icon=skip, color="gray", disabled=True)
            self.restart = gui.add_button("Restart", icon=viser.Icon.REPEAT, color="gray")
            hint = "race seconds in a second: 1 is real time, less is slow motion"
            speed = "Speed [x real time]"
            self.speed = gui.add_dropdown(speed, SPEEDS, initial_value="1", hint=hint)
        self.buttons.on_click(self._pressed)
        self.event.on_click(lambda _: session.tell(PageRace.jump))
        self.restart.on_click(controls.restart)
        self.speed.on_update(self._speed_chosen)
        self.time.on_update(self._scrubbed)

    def update(self, s: Snapshot) -> None:
        """Show the time, and enable the applicable controls."""
        self.time.max = round(max(s.end, 1.0), 2)
        self.time.disabled = s.flying and s.playing
        self.buttons.options = ("<", "pause" if s.playing else "play", ">")
        # Manual flights run in real time.
        self.speed.disabled = s.by_hand and s.flying
        self.event.disabled = s.next_event is None
        self.restart.disabled = not s.race
        self._show_time(min(round(s.t, 2), self.time.max))

    def _show_time(self, t: float) -> None:
        """Set the slider, unless it is being moved by hand."""
        since = perf_counter() - self._scrubbed_at
        if 0.0 <= since < HOLD:
            return
        if since >= HOLD:
            # Send the time again to all pages: a time that was sent before the slider was moved may
            # have arrived last. viser sends only changes, so a different time is sent first.
            self._scrubbed_at = inf
            self._set_time(t + RESOLUTION if t < RESOLUTION else t - RESOLUTION)
        self._set_time(t)

    def _set_time(self, t: float) -> None:
        self._shown = t
        self.time.value = t

    def _pressed(self, event: viser.GuiEvent[viser.GuiButtonGroupHandle]) -> None:
        match event.target.value:
            case "<":
                self._session.tell(PageRace.step, -1)
            case ">":
                self._session.tell(PageRace.step, 1)
            case "pause":
                self._session.tell(PageRace.play, False)
            case "play":
                self._session.tell(PageRace.play, True)

    def _speed_chosen(self, _: viser.GuiEvent) -> None:
        self._session.tell(PageRace.set_speed, float(self.speed.value))

    def _scrubbed(self, event: viser.GuiEvent) -> None:
        if event.client_id is not None and self.time.value != self._shown:
            self._session.tell(PageRace.play, False)
            self._session.tell(PageRace.scrub, float(self.time.value))
            self._scrubbed_at = perf_counter()


class ViewPanel:
    """The controls of the display: camera, ghosts, size and colours."""

    def __init__(self, gui: viser.GuiApi, camera: Camera):
        with gui.add_folder("View"):
            hint = "each visitor's own; FPV: from the drone"
            self.camera = gui.add_button_group("Camera", MODES, hint=hint)
            hint = "where the others are shown"
            ghosts = (TIME, PLACE)
            self.ghosts = gui.add_dropdown("Ghosts", ghosts, initial_value=TIME, hint=hint)
            trails = (AUTO, SPEED, SAMPLER)
            self.trails = gui.add_dropdown("Trails", trails, initial_value=AUTO)
            hint = "the cheapest of the samples; white: the plan"
            self.trajectories = gui.add_checkbox("Sampled trajectories", True, hint=hint)
            hint = "the best known race of race limit, as a ghost"
            self.limit = gui.add_checkbox("Limit's race", False, hint=hint)
            hint = "of the drones, from the next start"
            self.true_size = gui.add_checkbox("True size", False, hint=hint)
        self.camera.on_click(lambda event: camera.choose(event.client, self.camera.value))

    @property
    def by_place(self) -> bool:
        """Whether the other competitors are shown at the place of the first."""
        return self.ghosts.value == PLACE

    def by_speed(self, competitors: int) -> bool:
        """Return whether trails are coloured by speed; by default with a single competitor."""
        return self.trails.value == SPEED or (self.trails.value == AUTO and competitors == 1)


class Key(NamedTuple):
    """A key and its action."""

    key: str
    what: str
    act: Callable[[viser.CommandEvent], None]


def add_keys(gui: viser.GuiApi, session: Session, camera: Camera, controls: FlightControls) -> None:
    """Add the keys that control the race."""

    def follow_next(event: viser.CommandEvent) -> None:
        camera.follow_next(event.client, [entry.name for entry in session.snapshot.competitors])

    keys = [
        Key("space", "pause, continue", lambda _: session.tell(PageRace.play)),
        Key("N", "one step", lambda _: session.tell(PageRace.step, 1)),
        Key("B", "one step back", lambda _: session.tell(PageRace.step, -1)),
        Key("S", "start", controls.start),
        Key("X", "stop", controls.stop),
        Key("R", "restart", controls.restart),
        Key("E", "next event", lambda _: session.tell(PageRace.jump)),
        Key("C", f"camera: {', '.join(MODES)}", lambda event: camera.choose(event.client)),
        Key("F", "follow the next competitor, or the leader", follow_next),
        Key("H", "help: these keys", lambda event: show_help(event.client, keys)),
    ]
    for key in keys:
        command = gui.add_command(key.what, hotkey=key.key)  # type: ignore[arg-type]
        command.on_trigger(key.act)


def show_help(client: viser.ClientHandle | None, keys: list[Key]) -> None:
    """Open a window with the keys on one visitor's page."""
    if client is None:
        return
    note = (
        "Sliders act at the next plan. A flight whose numbers were changed in flight is marked "
        "interactive and cannot be compared with others."
    )
    rows: list[list[str] | str] = [[key.key, key.what] for key in keys]
    rows.append(["T", "table of runs, and campaigns"])  # runs.js
    with client.gui.add_modal("Keys") as modal:
        client.gui.add_html(box(table(["key", "does"], rows, left=2), small(note)))
        client.gui.add_button("Close").on_click(lambda _: modal.close())
