"""Claims that the number that is typed, key by key, is the one that counts, over flights without
physics."""

import pytest
from browser_cases import (
    error_of,
    field,
    press,
    rows,
    waited,
)

from quadsim.controllers.presets import PRESETS
from quadsim.web.race.page_race import PageRace

pytestmark = [pytest.mark.browser, pytest.mark.page]


def typed(page, label, text, leave="Enter"):
    """Type into a box as a person does; return what then stands there."""
    box = field(page, label)
    box.click()
    page.keyboard.press("Control+a")
    page.keyboard.type(text, delay=20)
    page.keyboard.press(leave)
    return box


def flown(page, session):
    """The planner of the next START."""
    races = session.snapshot.race
    press(page, "START")
    assert waited(page, lambda: session.snapshot.race > races)
    session.tell(PageRace.end_flights)
    return session.snapshot.competitors[0].record["planner"]


@pytest.fixture(autouse=True)
def preset(page):
    """The boxes hold the preset's numbers."""
    press(page, "Reset to preset")
    assert waited(page, lambda: field(page, "Samples").input_value() == "1024")
    yield
    press(page, "Reset to preset")


def test_the_typed_number_is_flown_once_it_is_entered_or_left(page, session):
    counts_on_enter_or_leaving(page, session)
    press(page, "Reset to preset")
    before = flown(page, session)["sampling"]["sigma"]
    typed(page, "Sigma scale", ".5")
    typed(page, "Temperature", "0.234", leave="Tab")
    typed(page, "Samples", "1024")
    planner = flown(page, session)
    assert planner["sampling"]["sigma"] == pytest.approx([0.5 * sigma for sigma in before])
    assert planner["mppi"]["temperature"] == 0.234
    assert planner["mppi"]["samples"] == 1024


def counts_on_enter_or_leaving(page, session):
    box = typed(page, "Samples", "1024", leave="End")
    page.wait_for_timeout(300)
    assert box.input_value() == "1024"
    assert "samples" not in rows(page).inner_text()
    page.keyboard.press("Escape")
    assert box.input_value() == "1024"
    typed(page, "Samples", "512", leave="End")
    assert flown(page, session)["mppi"]["samples"] == 512  # START takes the focus


WRONG = [
    ("Samples", "99999", ["Samples", "from 256 to 8192", "got 99999", "it stays 1024"]),
    ("Sigma scale", "0", ["Sigma scale", "from 0.1 to 4", "got 0", "it stays 1"]),
    ("Temperature", "warm", ["Temperature", "expected a number", "got warm"]),
    ("Samples", "1000.5", ["samples: expected a whole number", "got 1000.5"]),
    ("Target ESS", "0.5", ["target_ess: expected", "got 0.5"]),
]


def test_what_is_out_of_range_is_said_and_nothing_of_it_is_taken(page, session):
    for label, text, words in WRONG:
        before = field(page, label).input_value()
        box = typed(page, label, text)
        said = []

        def is_said(label=label, words=words, said=said):
            said[:] = [error_of(page, label)]
            return all(word in said[0] for word in words)

        assert waited(page, is_said, 5), (words, said)
        assert "\n" not in said[0]
        assert waited(page, lambda box=box, old=before: box.input_value() == old), label
    # START flies none of it
    planner = flown(page, session)
    usual = PRESETS["race"]["colored"]
    assert planner["mppi"] == planner["mppi"] | {
        name: getattr(usual.mppi, name) for name in ("samples", "temperature", "target_ess")
    }
    assert planner["sampling"]["sigma"] == pytest.approx(usual.sampling.sigma)
