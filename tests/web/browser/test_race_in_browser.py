"""Several drones in one world on the page, in a real browser."""

import re

import pytest
from browser_cases import add_rival, choose, dashboard, enter, opened, press, rows, waited

from web.race import take_off

SMALL = {"samples": 128, "horizon": 60, "first_iterations": 10}


@pytest.fixture
def session(tmp_path):
    with dashboard(tmp_path, take_off, laps=1, settings=SMALL) as session:
        yield session


def test_a_race_in_one_world_is_flown_and_shown(browser, session):
    with opened(browser, session.address) as page:
        add_rival(page, "gaussian")
        choose(page, "Fly", "in one world")
        assert waited(page, lambda: "samples 128" in rows(page).last.inner_text())
        announced = "START flies colored against gaussian"
        assert waited(page, lambda: announced in page.locator(".hud").inner_text())
        press(page, "START")
        assert waited(page, lambda: session.snapshot.t > 0.3)
        press(page, "pause")
        names = [entry.name for entry in session.snapshot.competitors]
        assert names == ["colored", "gaussian"]
        # each expects the other one somewhere
        assert [len(entry.expected) for entry in session.snapshot.competitors] == [1, 1]
        head = page.locator(".hud")
        assert waited(page, lambda: re.search("(colored|gaussian) leads", head.inner_text()))
        page.get_by_text("in one world the numbers of START stay").first.wait_for()
        enter(page, "Samples now", 512)
        refused = page.get_by_role("alert").filter(has_text="Samples now cannot be changed now")
        refused.wait_for()
        press(page, "STOP")
        assert waited(page, lambda: not session.snapshot.flying)
        assert not page.complaints
