"""Claims about the page in a real browser, with the real planner on fewer samples."""

import json

import numpy as np
import pytest
from browser_cases import SLOW, choose, drone, field, fill, seen, waited

from controllers.presets import PRESETS
from quadsim.record.archive import list_runs, load_run
from web.flight_factory import RANGES
from web.race import Race


@pytest.fixture(scope="module")
def flown(page, session, root):
    """A colored and a Gaussian flight, started from the page, and their runs."""
    choose(page, "Mode", "live: two samplers")
    fill(page, "Samples", 512)
    choose(page, "Speed [x real time]", "4")
    page.get_by_role("button", name="START", exact=True).click()
    assert waited(page, lambda: session.snapshot.flying, 60)
    assert waited(page, lambda: session.snapshot.race and not session.snapshot.flying, 400)
    return [json.loads((folder / "run.json").read_text()) for folder in list_runs(root)]


def test_both_laps_are_in_the_table_as_they_are_in_run_json(page, flown):
    page.get_by_role("tab", name="Laps").click()
    assert {run["spec"]["sampler"] for run in flown} == {"colored", "gaussian"}
    for run in flown:
        (lap,) = run["laps"]
        seen(page, f"{lap:.3f}")


def test_moving_gamma_in_flight_shows_an_event(page, session, flown):
    choose(page, "Mode", "live")
    page.get_by_role("button", name="START", exact=True).click()
    assert waited(page, lambda: session.snapshot.flying and session.snapshot.t > 0.05)
    fill(page, "Gamma rates", 1.5)
    page.get_by_role("tab", name="Events").click()
    seen(page, f"gamma rates {PRESETS['race']['colored'].sampling.gamma[0]:g} → 1.5")
    seen(page, "interactive, not comparable")
    session.tell(Race.end_flights)


def scrubbed(page, t):
    """Whether the time field holds t; typed again where the page set another time in between."""
    if float(field(page, "Time [s]").last.input_value()) != t:
        fill(page, "Time [s]", t)
        page.wait_for_timeout(500)
    return float(field(page, "Time [s]").last.input_value()) == t


def test_a_scrubbed_replay_shows_the_drone_where_the_telemetry_says(page, session, root, flown):
    folder = next(f for f in list_runs(root) if "colored" in f.name)
    x = load_run(folder).telemetry
    choose(page, "Mode", "replay")
    titles = {path: title for title, path in session.titled_runs(9).items()}
    choose(page, "Run", titles[folder])
    page.get_by_role("button", name="REPLAY", exact=True).click()
    assert waited(
        page, lambda: session.snapshot.competitors and not session.snapshot.competitors[0].live
    )
    session.tell(Race.play, False)  # a slider that moves by itself cannot be typed into
    assert waited(page, lambda: session.snapshot.race and not session.snapshot.playing)
    for t in (2.0, 3.5):
        i = int(np.argmin(abs(x["t"] - t)))
        there = np.array([x[k][i] for k in ("px", "py", "pz")])
        assert waited(page, lambda at=t: scrubbed(page, at))
        assert waited(
            page, lambda p=there: drone(page) is not None and np.allclose(drone(page), p, atol=1e-3)
        )
    assert waited(
        page, lambda: page.locator("[role=slider][aria-disabled=true]").count() >= len(RANGES)
    )


def test_the_exported_page_plays_without_a_network(browser, page, session, flown, tmp_path):
    page.get_by_text("Export", exact=True).click()
    with page.expect_download() as download:
        page.get_by_role("button", name="page", exact=True).click()
    path = tmp_path / "race.html"
    download.value.save_as(path)
    context = browser.new_context(offline=True)
    offline = context.new_page()
    offline.goto(path.as_uri(), timeout=SLOW)
    places = []

    def moves():
        at = drone(offline)
        if at is not None:
            places.append(at)
        return len(places) > 1 and np.ptp(np.array(places), axis=0).max() > 1.0

    assert waited(offline, moves, 60)
    assert offline.get_by_text("splits by gate").count() == 1
    context.close()


def test_the_console_holds_no_error_and_no_warning(page, flown):
    """After all of the above: live, two samplers, a replay, an export."""
    assert page.complaints == []
