"""Claims about the table of runs and the charts, as a person uses them."""

import msgspec
import pytest
from browser_cases import (
    DRAWN,
    dashboard,
    is_playing,
    opened,
    press,
    shown_time,
    type_time,
    waited,
)
from web_cases import Glider, Gliders, choices, run_of, store

from quadsim.campaign.document import Document, Heading, Note, Table

pytestmark = [pytest.mark.browser, pytest.mark.page]


REPORT = Document(
    (
        Heading("figure8", "2 laps"),
        Table(("variant", "thrust [m/s^2/s]"), (("<b>a", "5.5"),)),
        Note("mind this"),
    )
)


@pytest.fixture(scope="module")
def root(tmp_path_factory):
    root = tmp_path_factory.mktemp("table") / "runs"
    for seed in (3, 1, 2):
        for sampler in ("colored", "gaussian"):
            store(root, run_of(Glider(choices(sampler, laps=2, seed=seed))))
    broken = store(root, run_of(Glider(choices("colored", laps=1, seed=9))))
    (broken / "run.json").write_text("{}")
    reports = root.parent / "campaigns" / "race.report"
    reports.mkdir(parents=True)
    (reports / "figure8_a.json").write_bytes(msgspec.json.encode(REPORT))
    return root


@pytest.fixture(scope="module")
def session(root):
    with dashboard(root, Gliders(), course="figure8", laps=2) as session:
        yield session


@pytest.fixture(scope="module")
def page(browser, session, root):
    """A page whose address names two runs, a time and a camera."""
    names = sorted(path.name for path in root.iterdir() if "_s1_" in path.name)
    asked = "&".join(f"run={name}" for name in names)
    address = session.address.replace(DRAWN, f"{DRAWN}&{asked}&t=1.5&camera=top")
    with opened(browser, address) as page:
        page.names = names
        yield page


def names_shown(session):
    return [entry.folder.name for entry in session.snapshot.competitors]


def seeds_listed(page):
    return page.locator(".race-sheet tbody tr td:nth-child(8)").all_text_contents()


def test_an_address_shows_its_runs_at_its_time_from_its_camera(page, session):
    assert waited(page, lambda: names_shown(session) == page.names and shown_time(page) == 1.5)
    assert not is_playing(page)
    assert waited(page, lambda: "top" in session.camera_modes())


def test_runs_are_filtered_sorted_and_compared(page, session):
    page.keyboard.press("t")
    sheet = page.get_by_role("dialog", name="Runs and campaigns")
    sheet.wait_for()
    assert sheet.locator("td.problem").count() == 1
    sheet.get_by_role("searchbox").fill("figure8 gauss")
    assert waited(page, lambda: len(seeds_listed(page)) == 3)
    sheet.get_by_role("button", name="seed").click()
    assert seeds_listed(page) == ["1", "2", "3"]
    sheet.get_by_role("button", name="seed").click()
    assert seeds_listed(page) == ["3", "2", "1"]
    # After a click with the mouse the focus is on the page: its keys do not act beneath the table.
    race = session.snapshot.race
    for key in ("s", "x", "Space", "c"):
        page.keyboard.press(key)
    page.wait_for_timeout(300)
    assert session.snapshot.race == race
    assert not is_playing(page)
    assert set(session.camera_modes()) == {"top"}
    page.keyboard.press("Escape")
    assert waited(page, lambda: not sheet.is_visible(), 5)
    page.keyboard.press("t")
    sheet.wait_for()
    for k in (0, 2):
        sheet.get_by_role("checkbox").nth(k).check()
    press(page, "Compare 2")
    assert waited(page, lambda: all("gaussian" in name for name in names_shown(session)))
    assert {name.split("_s")[-1][0] for name in names_shown(session)} == {"1", "3"}
    assert not sheet.is_visible()


def test_a_press_in_a_chart_moves_the_time_and_the_pointer_shows_values(page, session):
    type_time(page, 0.5)
    assert waited(page, lambda: shown_time(page) == 0.5)
    canvas = page.locator('[data-charts="Signals"] canvas').first
    # Charts are laid out anew when the first frames come.
    assert waited(page, lambda: canvas.bounding_box() is not None)
    place = canvas.bounding_box()
    y = place["y"] + place["height"] / 2
    legend = page.locator(".race-chart .legend").first
    legend.get_by_text("commanded").first.wait_for()

    def shown():
        """Return the time that the legend's values are those of [s]."""
        return float(legend.locator(".at").inner_text().split()[1])

    # Without a pointer the values are those of the race's time,
    page.mouse.move(10, 10)
    assert waited(page, lambda: abs(shown() - shown_time(page)) < 0.02)
    # with one those under it,
    began = shown()
    page.mouse.move(place["x"] + 120, y)
    assert waited(page, lambda: abs(shown() - began) > 0.05)
    # and a press moves the race there.
    pointed = shown()
    page.mouse.down()
    assert waited(page, lambda: abs(shown_time(page) - pointed) < 0.02)
    page.mouse.move(place["x"] + 180, y, steps=3)
    assert waited(page, lambda: shown_time(page) > pointed + 0.3)
    page.mouse.up()
    # fewer signals
    charts = page.locator('[data-charts="Signals"] .race-chart')
    count = charts.count()
    page.get_by_text("signals", exact=True).click()
    page.locator(".panes details label", has_text="thrust").click()
    assert waited(page, lambda: charts.count() == count - 1)


def test_a_report_is_shown_as_the_tables_and_remarks_of_its_file(page):
    page.keyboard.press("t")
    sheet = page.get_by_role("dialog", name="Runs and campaigns")
    sheet.get_by_role("button", name="Campaigns").click()
    sheet.get_by_role("button", name="figure8_a").click()
    report = sheet.locator(".report")
    report.get_by_text("mind this").wait_for()
    assert report.get_by_role("heading").inner_text() == "figure8"
    assert report.locator("th, td").all_inner_texts() == [
        "variant",
        "thrust [m/s²/s]",
        "<b>a",
        "5.5",
    ]
    page.keyboard.press("Escape")
