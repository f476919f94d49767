"""Several drones in one world on the page, in a real browser."""

import pytest
from browser_cases import choose, dashboard, fill, opened, press, seen, waited

from web.race import take_off

SMALL = "samples=128+horizon=60+first-iterations=10"


@pytest.fixture
def session(tmp_path):
    with dashboard(tmp_path, take_off, laps=1) as session:
        yield session


def test_a_race_of_two_is_flown_and_shown(browser, session):
    with opened(browser, session.address) as page:
        choose(page, "Mode", "live: several in one world")
        fill(page, "Entrants", f"calm=colored+{SMALL} wild=gaussian+{SMALL}")
        press(page, "START")
        assert waited(page, lambda: session.snapshot.t > 0.3)
        press(page, "pause")
        names = [entry.name for entry in session.snapshot.competitors]
        assert names == ["calm", "wild"]
        # each expects the other one somewhere
        assert [len(entry.expected) for entry in session.snapshot.competitors] == [1, 1]
        seen(page, "calm")
        seen(page, "wild")
        press(page, "STOP")
        assert waited(page, lambda: not session.snapshot.flying)
        assert not page.complaints
