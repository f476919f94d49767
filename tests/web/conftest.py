"""A page over flights without physics, which the tests of a file share."""

import shutil
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from web_cases import COURSE, MENU, Gliders, served, until

from quadsim.web.race.page_race import PageRace
from quadsim.web.state.choices import Choices
from quadsim.web.state.commands import ChooseRace, FlyAgainst, RemoveRow, ResetRow


@pytest.fixture
def gliders():
    return Gliders()


@pytest.fixture(scope="module")
def root(tmp_path_factory):
    """The folder of runs of the shared page."""
    return tmp_path_factory.mktemp("runs")


@pytest.fixture(scope="module")
def shared_gliders():
    return Gliders()


@pytest.fixture(scope="module")
def shared_page(root, shared_gliders):
    with served(root, shared_gliders, MENU, Choices(course=COURSE, laps=2)) as page:
        yield page


@pytest.fixture
def page(shared_page, root):
    """The shared page; what a test flies, shows and stores ends with it."""
    yield shared_page
    dashboard, server, session = shared_page
    assert until(lambda: not server.get_clients())
    dashboard.desk.do(ChooseRace("course", COURSE))
    dashboard.desk.do(FlyAgainst(()))
    first, *others = dashboard.desk.state.rows
    for row in others:
        dashboard.desk.do(RemoveRow(row.number))
    dashboard.desk.do(ResetRow(first.number))
    session.tell(PageRace.set_speed, 1.0)
    race = session.snapshot.race
    session.tell(PageRace.start, [])
    assert until(lambda: session.snapshot.race > race and not session.snapshot.competitors)
    for run in root.iterdir():
        shutil.rmtree(run)
