"""FlightControls: START, STOP and restart, which several visitors share."""

from __future__ import annotations

from collections.abc import Callable

import viser

from web.page.race_panel import RacePanel
from web.race import PageRace
from web.session import Session

Event = viser.GuiEvent | viser.CommandEvent


class FlightControls:
    """Begins and ends flights; a visitor has to confirm the end of another visitor's flight."""

    def __init__(self, session: Session, race: RacePanel):
        self._session = session
        self._race = race
        self._pilot: int | None = None  # number of the visitor who began the flight
        race.start.on_click(self.start)
        race.stop.on_click(self.stop)

    def start(self, event: Event) -> None:
        """Fly or replay the present choices."""
        self._ask_first(event, self._start)

    def stop(self, event: Event) -> None:
        """End the present flights, if any."""
        if self._session.snapshot.flying:
            self._ask_first(event, lambda: self._session.tell(PageRace.end_flights))

    def restart(self, event: Event) -> None:
        """Restart the same race."""
        self._ask_first(event, lambda: self._session.tell(PageRace.restart))

    def _start(self) -> None:
        self._session.start(self._race.choices, self._race.runs)

    def _ask_first(self, event: Event, act: Callable[[], None]) -> None:
        """Act, after a confirmation if this would end another visitor's flight."""

        def act_as_pilot() -> None:
            self._pilot = event.client_id
            act()

        is_own = self._pilot in (None, event.client_id)
        if not self._session.snapshot.flying or is_own or event.client is None:
            act_as_pilot()
        else:
            ask(
                event.client, "Another visitor's flight is on", "End it", "Let it fly", act_as_pilot
            )


def ask(client: viser.ClientHandle, title: str, yes: str, no: str, act: Callable[[], None]) -> None:
    """Open a window on one visitor's page; act if the answer is yes."""
    with client.gui.add_modal(title) as modal:
        accept = client.gui.add_button(yes, color="red")
        refuse = client.gui.add_button(no, color="gray")

    @refuse.on_click
    def _(_: viser.GuiEvent) -> None:
        modal.close()

    @accept.on_click
    def _(_: viser.GuiEvent) -> None:
        modal.close()
        act()
