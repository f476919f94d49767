"""Claims about flights on sensors, by a learned pilot: it plans nothing, so they are quick."""

import numpy as np
import pytest
from browser_cases import choose, dashboard, press, waited

from quadsim.record.archive import list_runs, load_run
from web.flight_factory import PILOT, FlightFactory
from web.page.race_scene import visible_scale
from web.race import Race

PILOTED = PILOT + "split_s_swift"


@pytest.fixture(scope="module")
def session(root):
    with dashboard(root, FlightFactory(), laps=1) as session:
        yield session


def node(page, name):
    """Position and visibility of a node of the scene; None: there is none."""
    script = """name => { const n = window.__viserMutable?.nodeRefFromName["/estimate/0/" + name];
                return n ? {at: n.position.toArray(), visible: n.visible} : null }"""
    return page.evaluate(script, name)


@pytest.fixture(scope="module")
def flown(page, session):
    """A pilot that flies on a gate camera, paused in the third second."""
    choose(page, "Sampler", PILOTED)
    choose(page, "Sensing", "gates")
    press(page, "START")
    assert waited(page, lambda: session.snapshot.t > 2.0)
    press(page, "pause")
    assert waited(page, lambda: not session.snapshot.playing)
    return session.snapshot.competitors[0]


def test_what_is_chosen_is_flown_and_said(page, flown):
    assert flown.spec["sampler"] == "pilot"
    assert flown.spec["pilot"]["name"] == "split_s_swift"
    assert flown.spec["sensing"]["name"] == "gates"
    assert waited(page, lambda: "sensing gates" in page.locator(".hud").inner_text(), 10)
    page.get_by_role("tab", name="Planner").click()
    page.get_by_text("the learned pilot split_s_swift flies").wait_for()


def drawn(course, x, i):
    """Where the ghost is: as far off the drone as the estimate is, enlarged as the drone is."""
    truth, estimate = (
        np.array([x[f"{kind}p{axis}"][i] for axis in "xyz"]) for kind in ("", "est_")
    )
    return truth + visible_scale(course) * (estimate - truth)


def test_the_ghost_stands_where_the_estimate_is_with_its_ellipsoid(page, flown):
    estimate = drawn(flown.course, flown.x, -1)
    assert not np.allclose(estimate, flown.rows(("px", "py", "pz"), -1), atol=1e-3)
    for part in ("ghost", "ellipsoid"):
        assert waited(
            page, lambda p=part: np.allclose(node(page, p)["at"], estimate, atol=1e-3), 10
        )


def test_the_corners_of_the_last_picture_are_drawn(page, flown):
    assert flown.corners is not None
    assert waited(
        page,
        lambda: node(page, "corners")["visible"] == (flown.t[-1] - flown.corners.t <= 0.25),
        10,
    )


def test_a_replay_has_the_estimate_too(page, session, root, flown):
    session.tell(Race.end_flights)
    assert waited(page, lambda: list_runs(root))
    run = load_run(list_runs(root)[-1])
    session.tell(Race.start, [], list_runs(root)[-1:])
    session.tell(Race.play, False)
    session.tell(Race.scrub, 1.0)
    i = int(np.argmin(abs(run.telemetry["t"] - 1.0)))
    there = drawn(flown.course, run.telemetry, i)
    assert waited(
        page,
        lambda: node(page, "ghost") and np.allclose(node(page, "ghost")["at"], there, atol=1e-3),
        20,
    )


def test_the_console_holds_no_error_and_no_warning(page, flown):
    assert page.complaints == []
