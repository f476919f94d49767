"""`race web`: the dashboard in a browser, live or in replay."""

from __future__ import annotations

import os
from contextlib import suppress
from dataclasses import dataclass
from typing import Annotated

from msgspec import Meta
from tyro.conf import FlagCreatePairsOff, Positional, arg

from controllers.presets import PRESETS
from controllers.samplers import SAMPLERS
from quadsim.app.console import complain, emit, emit_json
from quadsim.app.flags import UsageError, check
from quadsim.app.fly import EXIT, uninterrupted
from quadsim.app.stored import find_run
from quadsim.app.workers import until_interrupted
from quadsim.course import course_names, load_course
from quadsim.vehicle import vehicle_names


@dataclass(frozen=True)
class Web:
    """Watch, tune, race ghosts, replay: a page on this machine, until Ctrl-C.

    race web

    race web last 20261120T133511Z --port 8081

    race web --course mine.yaml --host 192.168.1.7
    """

    runs: Annotated[tuple[str, ...], Positional, arg(metavar="RUN")] = ()  # to replay: folders, parts of names, or last
    course: str = "split_s_swift"  # chosen at first; a FILE.yaml joins the list
    host: str = "127.0.0.1"  # address to listen on; any but this machine's own asks for a token
    port: Annotated[int, Meta(ge=0, le=65535)] = 8080  # 0: a free one
    runs_dir: str = "runs"  # where runs are kept and found
    json: FlagCreatePairsOff[bool] = False  # the address as one JSON object

    def run(self) -> int:
        check(self)
        load_course(self.course)  # whatever is wrong with it, say so now
        paths = [find_run(run, self.runs_dir) for run in self.runs]

        from quadsim.app.flight_factory import FlightFactory  # here, so that --help loads neither numba nor viser
        from web.choices import Choices
        from web.page.dashboard import Dashboard
        from web.page.guard import new_token, serve
        from web.page.race_panel import Menu
        from web.race import Race
        from web.session import Session

        token = new_token(self.host)
        try:
            server = serve(self.host, self.port, token, "race")
        except ValueError as error:  # "port: ..."
            raise UsageError(f"--{error}") from None
        courses = tuple(dict.fromkeys((*course_names(), self.course)))
        presets = {name: planners["colored"].vehicle for name, planners in PRESETS.items()}
        menu = Menu(courses, vehicle_names(), presets, tuple(SAMPLERS))
        session = Session(FlightFactory(), self.runs_dir)
        page = Dashboard(server, session, FlightFactory(), menu, Choices(course=self.course))
        if paths:
            page.race.show_replay(paths)
            session.tell(Race.start, [], paths)
        self._say(f"http://{self.host}:{server.get_port()}/" + (f"?token={token}" if token else ""))
        with suppress(KeyboardInterrupt):  # the way a server ends
            until_interrupted()
        with suppress(KeyboardInterrupt), uninterrupted():
            page.close()
            session.close()
            server.stop()
        return EXIT["interrupted"]

    def _say(self, address: str) -> None:
        if self.json:
            emit_json({"url": address, "pid": os.getpid()})
        else:
            emit(address)
            complain("race web: open the address in a browser; Ctrl-C ends it")
