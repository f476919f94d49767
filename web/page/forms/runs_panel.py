"""RunsPanel: the table of stored runs and the reports of campaigns, for runs.js over the link.

The page filters and sorts; it identifies runs by their folders' names, which must be in the list.
Requests are answered on a separate thread, as some take long.
"""

from __future__ import annotations

import queue
import threading
import traceback
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from time import perf_counter
from typing import Annotated, get_args
from urllib.parse import urlencode

from msgspec import Meta

from quadsim.campaign.document import Document
from quadsim.heat.archive import is_heat
from quadsim.record.archive import read_run
from quadsim.record.run import RunError, why_not_repeatable
from quadsim.results.stored_row import UNREADABLE, TableColumn, read_row
from quadsim.tables.wording import Wording, heat_wording, wording
from quadsim.web.page.server.link import LinkVisitor, Message
from quadsim.web.page.server.page_server import PageServer
from quadsim.web.race.competitor import Competitor
from quadsim.web.race.next_start import NextStart
from quadsim.web.race.page_race import PageRace
from quadsim.web.race.session import Session
from quadsim.web.race.stored_competitor import runs_at
from quadsim.web.race.viewing import Viewing
from quadsim.web.state.line_up_link import MOST_BYTES
from quadsim.web.state.view import View
from quadsim.web.stored.again import AgainChoices, HeatAgainChoices
from quadsim.web.stored.campaign_reports import CampaignReports, ReportRow
from quadsim.web.stored.run_table import PageRow, RunTable, page_columns

PERIOD = 1.0  # time between two updates from the folder of runs [s]
CHECKING = 0.05  # time in each period in which rows are compared with their telemetry, at most [s]
MOST = 1000  # number of the latest rows for a page
WAITING = 64  # largest number of waiting requests; more are dropped
TOGETHER = 8  # largest number of runs that are shown together
FLYING = "A flight is on: STOP ends it, then this can be shown"

Name = Annotated[str, Meta(max_length=300)]


class ListRuns(Message, tag="list_runs"):
    """A page requests the table."""


class ReplayRuns(Message, tag="replay_runs"):
    """A visitor requests stored runs together.

    Attributes:
        names: of their folders.
        t: time at which this visitor pauses [s]; None: from the start.
    """

    names: Annotated[list[Name], Meta(min_length=1, max_length=TOGETHER)]
    t: Annotated[float, Meta(ge=0, le=1e6)] | None = None


class FlyAgainstRuns(Message, tag="fly_against"):
    """A visitor requests stored runs beside the next flight."""

    names: Annotated[list[Name], Meta(min_length=1, max_length=TOGETHER)]


class TakeOverRun(Message, tag="take_over"):
    """A visitor requests a competitor that is set up like a stored run."""

    name: Name


class SetUpRace(Message, tag="set_up"):
    """A page that was opened with a line-up in its address."""

    line_up: Annotated[str, Meta(max_length=MOST_BYTES)]


class FlyAgain(Message, tag="fly_again"):
    """A visitor requests to fly a stored run again."""

    name: Name


class WordRun(Message, tag="word_run"):
    """A visitor requests a stored run as a command line and as Python."""

    name: Name


class ListReports(Message, tag="list_reports"):
    """A page requests the list of reports."""


class ShowReport(Message, tag="show_report"):
    """A visitor requests a report."""

    name: Name


class Runs(Message, tag="runs"):
    """The table.

    Attributes:
        rows: its rows, the latest first.
        columns: its columns by the keys of the rows' cells.
        together: largest number of runs that are shown together.
    """

    rows: Sequence[PageRow]
    columns: Mapping[str, TableColumn]
    together: int = TOGETHER


class RunWording(Message, tag="run_wording"):
    """A run as a command line and as Python."""

    name: str
    command: str
    python: str
    # the reason why the result may differ; empty: it is the same to the last bit
    remark: str


class Reports(Message, tag="reports"):
    """The list of reports."""

    rows: Sequence[ReportRow]


class ReportShown(Message, tag="report"):
    """A report: its blocks, and its figure as a data URI."""

    name: str
    document: Document
    figure: str


class Remark(Message, tag="remark"):
    """A line for one visitor with the reason of a failed request."""

    text: str


Request = (
    ListRuns
    | ReplayRuns
    | FlyAgainstRuns
    | TakeOverRun
    | SetUpRace
    | FlyAgain
    | WordRun
    | ListReports
    | ShowReport
)


class RunsPanel:
    """Answers the pages' requests about stored runs and campaigns, until `close`."""

    def __init__(self, server: PageServer, session: Session, start: NextStart, viewing: Viewing):
        self._viewing = viewing
        self._link = server.link
        self._session = session
        self._start = start
        self._table = RunTable(session.root)
        self._reports = CampaignReports(session.root)
        self._wordings: dict[str, RunWording] = {}
        # None wakes the thread
        self._requests: queue.Queue[tuple[LinkVisitor, Request] | None] = queue.Queue(WAITING)
        for form in get_args(Request):
            self._link.on(form, self._queue)
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="runs", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop answering requests."""
        self._closing.set()
        with suppress(queue.Full):
            self._requests.put_nowait(None)
        self._thread.join()

    def _queue(self, visitor: LinkVisitor, request: Request) -> None:
        with suppress(queue.Full):
            self._requests.put_nowait((visitor, request))

    def _run(self) -> None:
        """Answer requests, and update the table between them."""
        while not self._closing.is_set():
            try:
                before = self._table.rows
                self._table.refresh()
                self._check()
                if self._table.rows != before:
                    self._link.send_all(self._listed())
                asked = self._requests.get(timeout=PERIOD)
                if asked:
                    self._answer(*asked)
            except queue.Empty:
                continue
            except Exception:
                # an error in one request must not end the others
                traceback.print_exc()
                self._closing.wait(PERIOD)

    def _check(self) -> None:
        """Compare some rows with their telemetry, while somebody looks and no planner waits."""
        end = perf_counter() + CHECKING
        while (
            bool(self._link.visitors)
            and not self._session.snapshot.flying
            and perf_counter() < end
            and self._table.check_next()
        ):
            pass

    def _answer(self, visitor: LinkVisitor, request: Request) -> None:
        """Answer a request; a failure is reported in one line."""
        try:
            match request:
                case ListRuns():
                    visitor.send(self._listed())
                case ReplayRuns():
                    self._replay(visitor.number, request)
                case FlyAgainstRuns(names):
                    self._fly_against(visitor.number, names)
                case TakeOverRun(name):
                    self._take_over(visitor, name)
                case SetUpRace(line_up):
                    self._start.set_up(line_up, visitor.number)
                case FlyAgain(name):
                    self._fly_again(name)
                case WordRun(name):
                    visitor.send(self._worded(name))
                case ListReports():
                    self._reports.refresh()
                    visitor.send(Reports(self._reports.rows))
                case ShowReport(name):
                    visitor.send(ReportShown(name, *self._reports.read(name)))
        except (ValueError, RunError, *UNREADABLE) as error:
            visitor.send(Remark(str(error)))

    def _listed(self) -> Runs:
        """Return the latest rows."""
        return Runs(self._table.rows[:MOST], page_columns())

    def _path(self, name: str) -> Path:
        """Return the folder of a listed run. Raises ValueError."""
        path = self._table.path(name)
        if path is None and self._table.refresh():
            # It has just been stored
            path = self._table.path(name)
        if path is None:
            raise ValueError(f"no run {name[:80]!r} in the table: expected one that is listed")
        return path

    def _replay(self, visitor: int, asked: ReplayRuns) -> None:
        """Show runs together, and the visitor the asked time of them. Raises ValueError, RunError.

        Others who watch the same runs go on watching as they did.
        """
        folders = [self._path(name) for name in dict.fromkeys(asked.names)]
        self._expect_landed()
        runs = [run for folder in folders for run in runs_at(folder)]
        s = self._session.snapshot
        if not s.has_flights and [entry.folder for entry in s.competitors] == runs:
            self._viewing.show(visitor, s.race, asked.t)
            return

        def begun(race: int) -> None:
            self._viewing.show(visitor, race, asked.t)

        self._session.tell(PageRace.replay, runs, begun)

    def _fly_against(self, visitor: int, names: Sequence[str]) -> None:
        """Show runs beside the next flight. Raises ValueError, RunError."""
        folders = [self._path(name) for name in dict.fromkeys(names)]
        runs = [run for folder in folders for run in runs_at(folder)]
        courses = {read_row(run).course for run in runs}
        if len(courses) > 1:
            raise ValueError(f"against: expected runs of one course, got {', '.join(courses)}")
        self._start.fly_against([folder.name for folder in folders], *courses, visitor=visitor)

    def _take_over(self, visitor: LinkVisitor, name: str) -> None:
        """Add a competitor for each run of a row. Raises ValueError, RunError."""
        for run in runs_at(self._path(name)):
            found = self._start.take_over(read_run(run).spec)
            if found.differs:
                differs = ", ".join(found.differs)
                remark = f"taken over; the race keeps its own settings: the run had {differs}"
                visitor.send(Remark(remark))

    def _fly_again(self, name: str) -> None:
        """Fly a run or a race again. Raises ValueError."""
        folder = self._path(name)
        self._expect_landed()
        root = self._session.root
        choices = HeatAgainChoices if is_heat(folder) else AgainChoices
        self._session.tell(PageRace.start, [choices(folder, root)])

    def _expect_landed(self) -> None:
        """Raise ValueError while a flight is on, which may be another visitor's."""
        if self._session.snapshot.flying:
            raise ValueError(FLYING)

    def _worded(self, name: str) -> RunWording:
        """Return the commands that repeat a run. Raises ValueError, RunError."""
        folder = self._path(name)
        if name not in self._wordings:
            remark = ""
            if is_heat(folder):
                texts: Wording = heat_wording(folder)
            else:
                run = read_run(folder)
                texts = wording(run.spec, folder)
                remark = why_not_repeatable(run)
            self._wordings[name] = RunWording(name, texts.command, texts.python, remark)
        return self._wordings[name]


def link_to(entries: Sequence[Competitor], t: float, camera: str, view: View, root: str) -> str:
    """Return the part of an address that names runs, and how a visitor watches them.

    Example: "?run=20261120T161507Z_figure8_colored_s0_18af0139&t=3.2025&camera=top".

    Args:
        entries: the shown competitors.
        t: the shown time [s].
        camera: mode of the visitor's camera.
        view: its view; the ghosts and the limit's race are named unless they are the usual ones.
        root: the folder of runs.

    Raises:
        ValueError: a shown competitor is not stored in the folder of runs.
    """
    names: dict[str, None] = {}
    for entry in entries:
        folder = entry.folder
        if folder is None:
            raise ValueError("nothing is stored yet: a flight is kept when it ends")
        if is_heat(folder.parent):
            folder = folder.parent
        if folder.resolve().parent != Path(root).resolve():
            raise ValueError(f"{folder}: a link can name runs of {root!r} alone")
        names[folder.name] = None
    fields = [*(("run", name) for name in names), ("t", str(t)), ("camera", camera)]
    if view.ghosts != View.ghosts:
        fields.append(("ghosts", view.ghosts))
    if view.limit:
        fields.append(("limit", "1"))
    return "?" + urlencode(fields)
