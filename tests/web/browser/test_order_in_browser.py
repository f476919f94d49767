"""Claims about what the timing tower says, over flights without physics."""

import re

import pytest
from browser_cases import dashboard, waited
from web_cases import COURSE, Glider, Gliders, choices

from quadsim.record.archive import RunFolder, list_runs
from quadsim.record.metrics import chatter
from quadsim.record.run import Run
from web.race import Race


@pytest.fixture(scope="module")
def session(root):
    with dashboard(root, Gliders(), course=COURSE, laps=1) as session:
        yield session


def stored(root, laps, sampler):
    flight = Glider(choices(sampler, laps=laps))
    run = Run.from_frames(flight.spec, list(flight.frames))
    with RunFolder.open(root, flight.spec) as folder:
        folder.save(run)
    return run


def cells(page, row):
    """Of the tower; each run has a row and below it a bar."""
    return (
        page.locator("table:visible")
        .first.locator("tr")
        .nth(1 + 2 * row)
        .locator("td")
        .all_inner_texts()
    )


def test_who_is_farther_on_the_course_leads_also_with_more_laps_to_go(page, session, root):
    """Of its one lap the live flight has flown a larger share than the faster stored one of its
    three."""
    stored(root, 3, "colored")
    session.tell(Race.set_speed, 0.2)
    session.tell(Race.start, [choices("gaussian", laps=1)], list_runs(root)[-1:])
    assert waited(page, lambda: session.snapshot.t > 0.4)
    session.tell(Race.play, False)
    assert waited(page, lambda: not session.snapshot.playing)
    assert waited(page, lambda: "leader" in cells(page, 0), 10)
    assert "colored" in cells(page, 0)[1]
    assert "gaussian" in cells(page, 1)[1]
    assert float(cells(page, 1)[3]) > 0.0  # behind
    # the live flight, shown first, is it
    assert re.search(r"\+\d+\.\d\d s", page.locator(".hud").inner_text())
    session.tell(Race.end_flights)


def test_chatter_is_the_command_lines_total_variation(page, session, root):
    run = stored(root, 2, "colored")
    tv = f"{chatter(run)['commanded']['thrust_tv']:.1f}"
    session.tell(Race.start, [], list_runs(root)[-1:])
    session.tell(Race.play, False)
    session.tell(Race.scrub, 99.0)
    assert waited(page, lambda: tv in cells(page, 0), 10)
    assert page.get_by_text("chatter: total variation of the commanded thrust").count() == 1
    page.get_by_role("tab", name="Spectrum").click()
    assert waited(page, lambda: page.get_by_role("cell", name=tv, exact=True).count() == 2, 10)
    assert page.get_by_text("residual").count() == 0
