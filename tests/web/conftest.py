"""A session over flights without physics, and pages on it."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from web_cases import COURSE, Gliders

from web.choices import Choices
from web.session import Session


@pytest.fixture
def gliders():
    return Gliders()


@pytest.fixture
def session(gliders, tmp_path):
    session = Session(str(tmp_path), gliders)
    yield session
    session.close()


@pytest.fixture
def page(session):
    """A running page and its server."""
    from web.page.dashboard import Dashboard
    from web.page.menu import Menu
    from web.page.server import serve

    server = serve("127.0.0.1", 0, None, "race")
    menu = Menu((COURSE, "paper_flat"), ("swift",), {"race": "swift"}, ("colored", "gaussian"))
    dashboard = Dashboard(server, session, menu, Choices(course=COURSE, laps=2))
    yield dashboard, server
    dashboard.close()
    server.stop()
