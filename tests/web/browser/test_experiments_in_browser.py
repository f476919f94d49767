"""Claims that what the page's sliders say is what is flown, and what is flown is recorded.

The flights are without physics; that the planner itself takes a number over is claimed in
test_flights_in_browser.
"""

import pytest
from browser_cases import add_rival, alone, choose, field, fill, press, rows, waited

from controllers.presets import PRESETS
from quadsim.record.archive import list_runs
from web.race import PageRace
from web.stored_runs import titled_runs

pytestmark = [pytest.mark.browser, pytest.mark.page]

PRESET = PRESETS["race"]
SAMPLERS = ("colored", "gaussian")


def shown(page, label):
    return float(field(page, label).last.input_value())


def changes(session):
    """Of every competitor, without their times."""
    competitors = session.snapshot.competitors
    return [[(c["name"], c["from"], c["to"]) for c in entry.changes] for entry in competitors]


def planners(session):
    return [entry.spec["planner"] for entry in session.snapshot.competitors]


def start(page, session):
    races = session.snapshot.race
    press(page, "START")
    assert waited(page, lambda: session.snapshot.race > races and session.snapshot.t > 0.05)


@pytest.fixture(autouse=True)
def preset(page):
    """There is one competitor, with the preset's numbers."""
    choose(page, "Mode", "live")
    alone(page)


def paused(page, session):
    session.tell(PageRace.play, False)
    assert waited(page, lambda: not session.snapshot.playing)


def settled(page, session, label, number, value):
    """Fill in a number of the flight, and wait until it is asked for."""
    fill(page, label, value)
    wanted = {number: value}
    competitors = session.snapshot.competitors
    assert waited(
        page, lambda: any(entry.pending_numbers == wanted for entry in session.snapshot.competitors)
    ), competitors


def test_each_competitor_flies_numbers_of_its_own(page, session):
    """Two of one sampler differ in name, colour and line, and in one number."""
    fill(page, "Samples", 512)
    press(page, "add")
    fill(page, "Samples", 1024)
    fill(page, "Sigma scale", 1.5)
    assert waited(page, lambda: "samples 1024 · sigma scale 1.5" in rows(page).last.inner_text())
    rows(page).first.click()  # a click on a row shows its numbers
    assert waited(page, lambda: shown(page, "Samples") == 512)
    start(page, session)
    first, second = session.snapshot.competitors
    assert (first.name, second.name) == ("colored", "colored 2")
    assert first.style.colour != second.style.colour
    assert first.style.dash != second.style.dash
    assert [entry.spec["planner"]["mppi"]["samples"] for entry in (first, second)] == [512, 1024]
    sigma = PRESET["colored"].sampling.sigma
    assert list(first.spec["planner"]["sampling"]["sigma"]) == pytest.approx(sigma)
    wanted = [1.5 * one for one in sigma]
    assert list(second.spec["planner"]["sampling"]["sigma"]) == pytest.approx(wanted)


def test_the_head_up_display_says_who_leads_by_how_much_and_the_chatter(page, session):
    add_rival(page, "gaussian")
    page.get_by_text("They differ in sampler; all else is equal").first.wait_for()
    start(page, session)
    assert waited(page, lambda: session.snapshot.t > 0.5)
    paused(page, session)
    head = page.locator(".hud")
    assert waited(page, lambda: "colored leads gaussian by 0." in head.inner_text())
    assert head.inner_text().count(" chatter") == 2
    assert "less is better" in head.inner_text()


def test_a_choice_of_sampler_keeps_the_numbers_and_says_which_it_has_not(page, session):
    fill(page, "Samples", 512)
    fill(page, "Gamma rates", 1)
    choose(page, "Sampler", "gaussian")
    page.get_by_text("kept, but gaussian sampling has none: gamma").first.wait_for()
    assert waited(page, lambda: "samples 512" in rows(page).inner_text())
    assert waited(page, lambda: "gamma" not in rows(page).inner_text())
    start(page, session)
    assert planners(session)[0]["mppi"]["samples"] == 512
    choose(page, "Sampler", "colored")
    assert waited(page, lambda: "gamma rates 1" in rows(page).inner_text())


def test_four_exponents_are_shown_by_the_sliders_and_flown(page, session):
    """There is one number, whichever control it was typed into last."""
    open_numbers(page)
    fill(page, "Gamma", "1 1 1 3")
    assert waited(page, lambda: shown(page, "Gamma rates") == 1)
    assert shown(page, "Gamma thrust") == 3
    start(page, session)
    assert planners(session)[0]["sampling"]["gamma"] == [1, 1, 1, 3]
    fill(page, "Gamma thrust", 4)
    assert waited(page, lambda: field(page, "Gamma").last.input_value() == "1 1 1 4")
    start(page, session)
    assert planners(session)[0]["sampling"]["gamma"] == [1, 1, 1, 4]
    close_numbers(page)


def test_the_next_start_is_prepared_in_flight_and_a_flight_leaves_it_alone(page, session):
    """Numbers of the next START and those of the flight are controls of their own."""
    start(page, session)
    paused(page, session)
    fill(page, "Samples", 512)
    settled(page, session, "Target ESS now", "target_ess", 20)
    (flight,) = session.snapshot.competitors
    assert flight.numbers(0.0)["samples"] == 1024
    assert shown(page, "Target ESS") == PRESET["colored"].mppi.target_ess
    start(page, session)
    assert planners(session)[0]["mppi"]["samples"] == 512
    assert planners(session)[0]["mppi"]["target_ess"] == PRESET["colored"].mppi.target_ess


def test_a_number_moved_in_flight_changes_it_alone_from_each_ones_own(page, session):
    add_rival(page, "gaussian")
    start(page, session)
    fill(page, "Samples now", 256)
    assert waited(page, lambda: all(changes(session)))
    choose(page, "Of", "gaussian")
    fill(page, "Target ESS now", 20)
    assert waited(page, lambda: len(changes(session)[1]) == 2)
    choose(page, "Of", "everyone")
    samples = [("samples", PRESET[name].mppi.samples, 256) for name in SAMPLERS]
    ess = ("target_ess", PRESET["gaussian"].mppi.target_ess, 20)
    assert changes(session) == [[samples[0]], [samples[1], ess]]


def test_not_comparable_is_said_of_the_competitor_that_was_changed(page, session):
    alone(page)
    choose(page, "Sampler", "gaussian")
    add_rival(page, "colored")
    start(page, session)
    fill(page, "Gamma thrust now", 3)  # which gaussian sampling has not
    assert waited(page, lambda: changes(session)[1])
    assert changes(session)[0] == []
    remark = "colored: interactive, not comparable: 1 change in flight"
    assert waited(page, lambda: remark in page.locator(".hud").inner_text())
    assert "gaussian: interactive" not in page.locator(".hud").inner_text()
    assert waited(page, lambda: shown(page, "Gamma thrust now") == 3)


def test_a_change_that_no_plan_has_used_is_not_recorded(page, session):
    """Paused and moved back; paused, moved, stopped."""
    start(page, session)
    paused(page, session)
    settled(page, session, "Sigma scale now", "sigma", 2)
    fill(page, "Sigma scale now", 1)
    assert waited(page, lambda: session.snapshot.competitors[0].pending_numbers == {})
    frames = len(session.snapshot.competitors[0].t)
    session.tell(PageRace.play, True)
    assert waited(page, lambda: len(session.snapshot.competitors[0].t) > frames + 5)
    assert changes(session) == [[]]
    paused(page, session)
    settled(page, session, "Gamma thrust now", "gamma_thrust", 4)
    press(page, "STOP")
    assert waited(page, lambda: not session.snapshot.flying)
    assert changes(session) == [[]]
    assert session.snapshot.competitors[0].pending_numbers == {}


def test_a_drag_is_one_change_at_the_time_of_the_plan_that_used_it(page, session):
    start(page, session)
    slider = page.get_by_role("slider", name="Sigma scale now").locator("xpath=../..")
    box = slider.bounding_box()
    y = box["y"] + box["height"] / 2
    page.mouse.move(box["x"] + 0.3 * box["width"], y)
    page.mouse.down()
    # Quickly, as a slider that rests for half a second acts
    for k in range(8):
        page.mouse.move(box["x"] + (0.3 + 0.05 * k) * box["width"], y)
    page.mouse.up()
    assert waited(page, lambda: changes(session)[0])
    last = shown(page, "Sigma scale now")
    frames = len(session.snapshot.competitors[0].t)
    assert waited(page, lambda: len(session.snapshot.competitors[0].t) > frames + 30)
    (change,) = session.snapshot.competitors[0].changes
    assert (change["name"], change["from"], change["to"]) == ("sigma", 1, last)
    assert change["t"] in session.snapshot.competitors[0].t
    assert change["t"] > 0.1


def test_a_number_moved_just_after_start_counts_from_the_plan_that_used_it(page, session):
    """The first plan used the number before."""
    start(page, session)
    fill(page, "Sigma scale now", 3)
    assert waited(page, lambda: changes(session)[0])
    (change,) = session.snapshot.competitors[0].changes
    assert change["t"] > 0.0
    assert session.snapshot.competitors[0].numbers(0.0)["sigma"] == 1
    assert session.snapshot.competitors[0].numbers(change["t"])["sigma"] == 3


def test_a_replay_shows_the_runs_numbers_and_leaves_those_of_the_next_start(page, session, root):
    fill(page, "Samples", 512)
    fill(page, "Temperature", 2.5)
    before = set(list_runs(root))
    start(page, session)
    assert waited(page, lambda: session.snapshot.competitors[0].events)
    session.tell(PageRace.end_flights)
    assert waited(page, lambda: set(list_runs(root)) - before)
    fill(page, "Samples", 1024)  # of the next flight
    choose(page, "Mode", "replay")
    (folder,) = set(list_runs(root)) - before
    titles = {path: title for title, path in titled_runs(str(root), 200).items()}
    choose(page, "Run", titles[folder])
    press(page, "REPLAY")
    assert waited(page, lambda: not session.snapshot.competitors[0].live)
    assert waited(page, lambda: shown(page, "Samples now") == 512)
    assert waited(page, lambda: shown(page, "Temperature now") == 2.5)
    choose(page, "Mode", "live")
    assert shown(page, "Samples") == 1024
    start(page, session)
    assert planners(session)[0]["mppi"]["samples"] == 1024


GROUPS = ["Sampling", "MPPI", "Cost", "Model of the vehicle"]


def open_numbers(page):
    page.get_by_text("All numbers", exact=True).click()
    page.get_by_text("Sampling", exact=True).click()
    field(page, "Law").first.wait_for()


def close_numbers(page):
    page.get_by_text("All numbers", exact=True).click()


def groups(page):
    """The titles of the groups of numbers, in order."""
    script = """titles => [...document.querySelectorAll("div")]
        .filter(e => titles.includes(e.childNodes[0]?.nodeType === 3 && e.firstChild.textContent))
        .map(e => e.firstChild.textContent)"""
    return page.evaluate(script, GROUPS)


def test_presets_chosen_quickly_leave_one_set_of_groups_with_the_last_ones_numbers(
    page, session, capfd
):
    page.get_by_text("All numbers", exact=True).click()
    for preset in ("paper", "race", "paper", "race", "paper"):
        choose(page, "Preset", preset)
    choose(page, "Sampler", "gaussian")
    choose(page, "Sampler", "colored")
    assert waited(page, lambda: groups(page) == GROUPS), groups(page)
    page.wait_for_timeout(300)
    assert groups(page) == GROUPS
    page.get_by_text("Cost", exact=True).click()
    speed = PRESETS["paper"]["colored"].cost.desired_speed
    assert waited(
        page, lambda: float(field(page, "Desired speed [m/s]").first.input_value()) == speed
    )
    start(page, session)
    assert session.snapshot.competitors[0].spec["preset"] == "paper"
    assert planners(session)[0]["cost"]["desired_speed"] == speed
    assert "Traceback" not in "".join(capfd.readouterr())
    page.get_by_text("All numbers", exact=True).click()
    choose(page, "Preset", "race")
    choose(page, "Vehicle", "swift")
