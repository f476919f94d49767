"""Claims about what the timing tower says, over flights without physics."""

import re

import pytest
from browser_cases import waited
from web_cases import choices, stored

from quadsim.record.archive import read_run
from quadsim.record.metrics import chatter
from web.race import PageRace

pytestmark = [pytest.mark.browser, pytest.mark.page]


def cells(page, row):
    """Of the tower; each run has a row and below it a bar."""
    tower = page.locator("table:visible").first
    return tower.locator("tr").nth(1 + 2 * row).locator("td").all_inner_texts()


def test_who_is_farther_on_the_course_leads_also_with_more_laps_to_go(page, session, root):
    """Of its one lap the live flight has flown a larger share than the faster stored one of its
    three."""
    run = stored(root, "colored", laps=3)
    session.tell(PageRace.set_speed, 0.2)
    session.tell(PageRace.start, [choices("gaussian", laps=1)], [run])
    assert waited(page, lambda: session.snapshot.flying and session.snapshot.t > 0.4)
    session.tell(PageRace.play, False)
    assert waited(page, lambda: not session.snapshot.playing)
    assert waited(page, lambda: "leader" in cells(page, 0))
    assert "colored" in cells(page, 0)[1]
    assert "gaussian" in cells(page, 1)[1]
    assert float(cells(page, 1)[3]) > 0.0  # behind
    # the live flight, shown first, is it
    assert re.search(r"\+\d+\.\d\d s", page.locator(".hud").inner_text())


def test_chatter_is_the_command_lines_total_variation(page, session, root):
    folder = stored(root, "colored", laps=2)
    tv = f"{chatter(read_run(folder))['commanded']['thrust_tv']:.1f}"
    session.tell(PageRace.start, [], [folder])
    session.tell(PageRace.play, False)
    session.tell(PageRace.scrub, 99.0)
    assert waited(page, lambda: tv in cells(page, 0))
    page.get_by_role("tab", name="Spectrum").click()
    assert waited(page, lambda: page.get_by_role("cell", name=tv, exact=True).count() == 2)
