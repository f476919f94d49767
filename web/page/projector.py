"""Projector: shows a snapshot of the race in the scenes and on the screens of all visitors."""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Mapping

import viser

from quadsim.course import Course
from quadsim.web.page.due import Beat
from quadsim.web.page.forms.joining import Joining
from quadsim.web.page.parts.board import EVERYBODY, Board
from quadsim.web.page.parts.moment import Moments
from quadsim.web.page.parts.pictures import Pictures
from quadsim.web.page.scene.camera import set_initial_camera
from quadsim.web.page.screen import Beats, Screen, Seen
from quadsim.web.page.server.page_server import PageServer
from quadsim.web.page.shared_parts import SharedParts
from quadsim.web.page.stages import Stages
from quadsim.web.page.visitor_scene import VisitorScene
from quadsim.web.race.session import Session
from quadsim.web.race.snapshot import Snapshot
from quadsim.web.race.viewing import Viewing

# periods [s]
TABLES = 1 / 8
SLOW = 1.0  # of spectra and gaps


class Projector:
    """Shows the race in the scene and on the screen of every visitor.

    One thread calls `show` again and again.

    Every visitor watches a time of its own in a view of its own.

    Args:
        server: of the visitors.
        session: of the race, which is asked for sampled trajectories while somebody sees them.
        viewing: what each visitor watches, and in which view.
        stages: what stands in the visitors' scenes.
        shared: the parts that are the same for all visitors.
        joining: the manual flight.
        board: takes the parts of each visitor.
        scene_of: makes the scene of a visitor.

    Attributes:
        seen: what each visitor watched at the last call of `show`, by the visitors' numbers.
    """

    def __init__(
        self,
        server: PageServer,
        session: Session,
        viewing: Viewing,
        stages: Stages,
        shared: SharedParts,
        joining: Joining,
        board: Board,
        scene_of: Callable[[viser.ClientHandle], VisitorScene],
    ):
        self._server = server
        self._session = session
        self._viewing = viewing
        self._stages = stages
        self._shared = shared
        self._joining = joining
        self._board = board
        self._scene_of = scene_of
        self._pictures = Pictures(board)
        self._moments = Moments()
        self._scenes: dict[int, VisitorScene] = {}  # by the numbers of viser's visitors
        self._screens: dict[int, Screen] = {}  # by the numbers of the link's visitors
        self.seen: Mapping[int, Seen] = {}
        self._framed: Course | None = None  # the course that new cameras frame
        self._shown_at: object = None  # step of the race, and visitors, of the last call
        self._tables_beat = Beat(TABLES)
        self._slow_beat = Beat(SLOW)

    def close(self) -> None:
        """End the process that draws pictures."""
        self._pictures.close()

    def show(self, s: Snapshot) -> None:
        """Show every visitor what has changed. s: the race at its latest time."""
        clients = self._server.get_clients()
        visitors = {visitor.number: visitor for visitor in self._server.link.visitors}
        self._forget_others(clients, visitors)
        if not clients and not visitors:
            self.seen = {}
            self._session.show_trajectories(False)
            return
        self._stages.update(s)
        self._frame_new_cameras()
        sitting = self._server.seats.visitors()
        self.seen = seen = {number: self._seen_by(number) for number in {EVERYBODY, *visitors}}
        watching = [seen[sitting.get(number, EVERYBODY)] for number in clients]
        self._session.show_trajectories(
            any(one.view.shows_trajectories for one in (*watching, *seen.values()))
        )
        self._joining.update(s, self._moments.of(s).timings if s.by_hand else [])
        beats = self._beats(s, visitors)
        for (number, client), one in zip(clients.items(), watching, strict=True):
            if number not in self._scenes:
                self._scenes[number] = self._scene_of(client)
            self._scenes[number].update(one.stage, one.moment, one.view)
        if beats.tables:
            self._shared.update(s)
        for number, visitor in visitors.items():
            if number not in self._screens:
                self._screens[number] = Screen(self._board, visitor, s)
            self._screens[number].update(seen[number], self._shared.for_all, beats)
        self._update_pictures({number: seen[number] for number in visitors})
        self._moments.forget_others()

    def _beats(self, s: Snapshot, visitors: Iterable[int]) -> Beats:
        """Return what is due; tables also for a new visitor, and at each step of a start."""
        now = (s.step, frozenset(visitors))
        is_new = now != self._shown_at
        self._shown_at = now
        return Beats(self._tables_beat.strikes() or is_new, self._slow_beat.strikes())

    def _forget_others(self, clients: Container[int], visitors: Container[int]) -> None:
        """Forget the scenes and the parts of visitors who have left."""
        for number in [one for one in self._scenes if one not in clients]:
            del self._scenes[number]
        for number in [one for one in self._screens if one not in visitors]:
            self._screens.pop(number).forget()

    def _frame_new_cameras(self) -> None:
        """Let the cameras of visitors who come later frame the present course."""
        course = self._stages.course
        if course and course is not self._framed:
            self._framed = course
            set_initial_camera(self._server, course)

    def _seen_by(self, visitor: int) -> Seen:
        """Return what a visitor watches; EVERYBODY stands for one whose page has not spoken yet."""
        return Seen(
            moment=self._moments.of(self._viewing.seen_by(visitor)),
            view=self._viewing.view_of(visitor),
            stage=self._stages.of(visitor),
            flies=self._session.flies(visitor),
        )

    def _update_pictures(self, seen: Mapping[int, Seen]) -> None:
        """Show the pictures of the first drone's camera to the visitors who want them."""
        self._pictures.update(
            {
                number: one.moment.timings[0]
                for number, one in seen.items()
                if one.view.shows_pictures
                and self._board.is_wanted("picture", number)
                and one.is_drawn
            }
        )
