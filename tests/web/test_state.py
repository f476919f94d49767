"""Claims about the state of the page, and the commands that change it, without any page."""

from dataclasses import replace

import msgspec
import pytest
from web_cases import COURSE, choices

from quadsim.controllers.presets import PRESETS
from quadsim.web.state.choices import Choices, CompetitorChoices, HeatChoices, RaceChoices
from quadsim.web.state.commands import (
    MOST_REMOVED,
    AddRow,
    AnyCommand,
    ChooseNames,
    ChooseRace,
    EditRow,
    FlyAgainst,
    Leave,
    OfferCourse,
    PutBack,
    RemoveRow,
    ResetRow,
    SetNumber,
    SetSetting,
    SetUp,
    SetView,
    TakeOver,
    apply,
)
from quadsim.web.state.desk import Desk
from quadsim.web.state.line_up import line_up_of
from quadsim.web.state.line_up_link import line_up_text, set_up_of
from quadsim.web.state.menu import Menu
from quadsim.web.state.page_state import PageState

A, B = 1, 2  # visitors
TWO = PageState.of(choices("colored"), choices("gaussian"))
FIRST, SECOND = (row.number for row in TWO.rows)


def after(*commands, state=TWO):
    for command in commands:
        state = apply(state, command)
    return state


def samplers(state):
    return [row.choices.sampler for row in state.rows]


def test_start_flies_what_was_chosen_each_in_the_race_of_all():
    state = after(
        ChooseRace("seed", "5"), ChooseRace("laps", 2), SetNumber(SECOND, "temperature", 0.2)
    )
    first, second = state.start
    assert (first.seed, first.laps, first.course) == (5, 2, COURSE)
    assert second == replace(first, sampler="gaussian", numbers={"temperature": 0.2})
    (heat,) = after(ChooseRace("world", "in one world"), state=state).start
    assert heat == HeatChoices((first, second))
    # alone, there is nobody to share a world with
    alone = after(ChooseRace("world", "in one world"), RemoveRow(FIRST), state=state)
    assert alone.start == [second]


def test_what_a_visitor_types_lands_on_the_row_in_which_it_was_typed():
    """A types into row 1, B chooses row 2, A presses Enter."""
    state = after(EditRow(B, SECOND))
    assert state.edited(A).number == FIRST
    assert state.edited(B).number == SECOND
    state = after(SetNumber(FIRST, "temperature", 0.3), state=state)
    assert [row.choices.numbers for row in state.rows] == [{"temperature": 0.3}, {}]


def test_each_visitor_edits_a_row_of_its_own():
    state = after(AddRow(B, like=SECOND))
    assert state.edited(A).number == FIRST
    assert state.edited(B).choices.sampler == "gaussian"
    assert state.edited(B).number not in (FIRST, SECOND)
    state = after(Leave(B), state=state)
    assert B not in state.visitors
    assert state.edited(B).number == FIRST  # nobody knows B any more


def test_a_row_that_was_removed_takes_no_number_and_its_editor_goes_to_the_one_before():
    state = after(EditRow(A, SECOND), RemoveRow(SECOND))
    assert state.edited(A).number == FIRST
    with pytest.raises(ValueError, match="competitor: expected one that is there"):
        apply(state, SetNumber(SECOND, "temperature", 0.3))
    added = after(AddRow(A, like=FIRST), state=state)
    assert added.rows[-1].number not in (FIRST, SECOND)  # numbers are never used again


def test_the_view_that_sends_less_draws_neither_samples_nor_pictures():
    state = after(SetView(A, "pictures", True))
    view = state.visitor(A).view
    assert (view.shows_trajectories, view.shows_pictures) == (True, True)
    less = after(SetView(A, "light", True), state=state).visitor(A).view
    assert (less.shows_trajectories, less.shows_pictures) == (False, False)
    assert less.pictures  # what was chosen comes back with the light mode's end


def test_removed_rows_come_back_where_they_stood_with_their_numbers():
    state = after(SetNumber(FIRST, "samples", 512), RemoveRow(FIRST))
    assert samplers(state) == ["gaussian"]
    back = after(PutBack(), state=state)
    assert back.rows == after(SetNumber(FIRST, "samples", 512)).rows
    with pytest.raises(ValueError, match="none was removed"):
        apply(back, PutBack())
    many = TWO
    for _ in range(MOST_REMOVED + 2):
        many = after(AddRow(A, like=FIRST), state=many)
        many = after(RemoveRow(many.rows[-1].number), state=many)
    assert len(many.removed) == MOST_REMOVED


def test_there_is_always_one_competitor_and_never_more_than_fit():
    alone = after(RemoveRow(SECOND))
    with pytest.raises(ValueError, match="expected one at least"):
        apply(alone, RemoveRow(FIRST))
    full = after(*[AddRow(A, like=FIRST)] * 6)
    with pytest.raises(ValueError, match="expected 8 at most"):
        apply(full, AddRow(A, like=FIRST))


@pytest.mark.parametrize(
    ("command", "problem"),
    [
        (SetNumber(FIRST, "temperature", -1.0), "temperature: expected"),
        (SetNumber(FIRST, "samples", 1000.5), "samples: expected a whole number"),
        (SetNumber(FIRST, "wind", 1.0), "wind: expected one of"),
        (SetSetting(FIRST, "horizon", "1"), "horizon: expected a whole number"),
        (SetSetting(SECOND, "gamma", "1 1 1 1"), "gamma: expected a setting of gaussian"),
        (ChooseNames(FIRST, {"colour": "red"}), "colour: expected one of"),
        (ChooseNames(FIRST, {"flight_controller": "px4"}), "flight_controller: expected"),
        (ChooseRace("laps", "many"), "laps: expected a whole number"),
        (ChooseRace("seed", "many"), "seed: expected a whole number"),
        (ChooseRace("deadline_ms", "soon"), "deadline_ms: expected"),
        (ChooseRace("randomize", "4"), "randomize: expected"),
        (ChooseRace("wind", 1), "wind: expected one of"),
        (SetView(A, "ghosts", "by luck"), "ghosts: expected one of"),
        (SetView(A, "limit", "yes"), "limit: expected true or false"),
        (ChooseRace("clock", "sundial"), "clock: expected one of"),
        (EditRow(A, 99), "competitor: expected one that is there"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line_and_changes_nothing(command, problem):
    desk = Desk(choices("colored"), choices("gaussian"))
    before = desk.state
    with pytest.raises(ValueError, match=problem) as refused:
        desk.do(command)
    assert "\n" not in str(refused.value)
    assert desk.state is before


def test_a_setting_and_its_slider_are_one_number_whichever_was_moved_last():
    state = after(SetSetting(FIRST, "gamma", "1 1 1 3"))
    assert tuple(state.flights[0].spec().planner.sampling.gamma) == (1, 1, 1, 3)
    state = after(SetNumber(FIRST, "gamma_thrust", 4), state=state)
    assert tuple(state.flights[0].spec().planner.sampling.gamma) == (1, 1, 1, 4)
    state = after(SetSetting(FIRST, "gamma", "2 2 2 2"), state=state)
    assert tuple(state.flights[0].spec().planner.sampling.gamma) == (2, 2, 2, 2)
    assert after(ResetRow(FIRST), state=state).rows == TWO.rows


def test_a_sampler_keeps_the_numbers_of_another_one_for_later():
    state = after(SetNumber(FIRST, "gamma_rates", 1.0), ChooseNames(FIRST, {"sampler": "gaussian"}))
    assert line_up_of(state).changes[0] == ()
    state = after(ChooseNames(FIRST, {"sampler": "colored"}), state=state)
    assert line_up_of(state).changes[0] == ("gamma rates 1",)


def test_a_preset_brings_its_vehicle():
    state = after(ChooseNames(FIRST, {"preset": "paper"}))
    row = state.rows[0].choices
    assert row.vehicle == state.flights[0].spec().planner.vehicle


def test_a_row_names_the_number_that_is_flown():
    """A target whose effective sample size is more than half of the samples is lowered."""
    state = after(SetNumber(FIRST, "samples", 300), SetNumber(FIRST, "target_ess", 400))
    flown = state.flights[0].spec().planner.mppi
    assert flown.samples == 300
    assert flown.ess_of(300) == pytest.approx(150)
    assert set(line_up_of(state).changes[0]) == {
        "samples 300",
        "target ess 277.128 (asked for 400)",
    }
    # lowered by the samples alone
    few = line_up_of(after(SetNumber(FIRST, "samples", 256))).changes[0]
    assert few == ("samples 256",)


def test_the_line_up_is_called_as_it_will_be_in_flight_and_says_what_differs():
    state = after(
        ChooseNames(SECOND, {"sampler": "colored"}), SetNumber(SECOND, "temperature", 0.2)
    )
    found = line_up_of(state)
    usual = PRESETS["race"]["colored"].mppi.temperature
    assert found.names == ("colored", "colored T 0.2")
    assert found.compared == f"They differ in temperature ({usual:g} / 0.2); all else is equal."
    assert found.problem == ""
    wrong = line_up_of(after(ChooseRace("course", "no_such"), state=state))
    assert "no_such" in wrong.problem
    assert "\n" not in wrong.problem


def test_a_taken_over_competitor_is_the_visitors_own_row():
    taken = CompetitorChoices(sampler="gaussian", numbers={"samples": 512})
    state = after(TakeOver(A, taken))
    assert state.edited(A).choices == taken
    assert len(state.rows) == 3


def test_runs_beside_a_flight_are_named_once():
    assert after(FlyAgainst(("a", "b", "a"))).against == ("a", "b")
    assert after(FlyAgainst(("a",)), FlyAgainst(())).against == ()


def test_a_command_comes_as_json_and_nothing_else_is_one():
    decode = msgspec.json.Decoder(AnyCommand).decode
    wanted = SetNumber(FIRST, "samples", 512.0)
    assert decode(msgspec.json.encode(wanted)) == wanted
    assert decode(b'{"type": "EditRow", "visitor": 1, "row": 2}') == EditRow(1, 2)
    for wrong in (
        b"{}",
        b'{"type": "Exec", "x": 1}',
        b'{"type": "EditRow", "visitor": "x", "row": 2}',
    ):
        with pytest.raises(msgspec.ValidationError):
            decode(wrong)


def test_a_state_is_never_changed_itself():
    before = (TWO.rows, dict(TWO.visitors), TWO.race)
    after(SetNumber(FIRST, "samples", 512), ChooseRace("seed", "3"), RemoveRow(SECOND))
    assert (TWO.rows, dict(TWO.visitors), TWO.race) == before
    assert Choices.of(TWO.race, TWO.rows[0].choices) == choices("colored")


MENU_OF_TWO = Menu((COURSE,), ("swift",), ("race",), ("colored", "gaussian"))
OFFERED = PageState.of(choices("colored"), choices("gaussian"), menu=MENU_OF_TWO)


@pytest.mark.parametrize(
    "command",
    [
        ChooseRace("course", "/etc/passwd"),
        ChooseNames(FIRST, {"sampler": "mine:Code"}),
        ChooseNames(FIRST, {"vehicle": "../secret.yaml"}),
        ChooseNames(FIRST, {"sensing": "other.yaml"}),
        ChooseNames(FIRST, {"preset": "paper"}),
        SetUp(RaceChoices(course="/etc/passwd"), (CompetitorChoices(),)),
        SetUp(RaceChoices(course=COURSE, seed=-1), (CompetitorChoices(),)),
        SetUp(RaceChoices(course=COURSE, laps=10**9), (CompetitorChoices(),)),
        SetUp(RaceChoices(course=COURSE, deadline_ms="soon"), (CompetitorChoices(),)),
        SetUp(RaceChoices(course=COURSE), (CompetitorChoices(vehicle="x.yaml"),)),
        SetUp(RaceChoices(course=COURSE), (CompetitorChoices(settings={"plant": "mine:Code"}),)),
        SetUp(RaceChoices(course=COURSE), (CompetitorChoices(settings={"horizon": 1}),)),
        SetUp(RaceChoices(course=COURSE), (CompetitorChoices(settings={"horizon": {"a": 1}}),)),
        SetUp(RaceChoices(course=COURSE), (CompetitorChoices(numbers={"wind": 1.0}),)),
        TakeOver(A, CompetitorChoices(vehicle="x.yaml")),
    ],
)
def test_no_command_names_what_is_not_on_the_menu(command):
    """No file, and no code of somebody's own, comes in by a name or by a link."""
    with pytest.raises(ValueError, match="expected"):
        apply(OFFERED, command)


def test_a_course_that_was_saved_can_be_chosen():
    state = after(OfferCourse("mine.yaml"), ChooseRace("course", "mine.yaml"), state=OFFERED)
    assert state.race.course == "mine.yaml"
    with pytest.raises(msgspec.ValidationError):
        msgspec.json.decode(msgspec.json.encode(OfferCourse("x.yaml")), type=AnyCommand)


def test_a_link_sets_up_the_same_line_up_on_another_page_with_its_own_folder_of_runs():
    state = after(
        SetNumber(SECOND, "temperature", 0.2),
        SetSetting(FIRST, "gamma", "1 1 1 3"),
        ChooseRace("seed", "5"),
        ChooseRace("world", "in one world"),
        state=OFFERED,
    )
    other = replace(OFFERED, race=replace(OFFERED.race, runs_dir="elsewhere"))
    found = apply(other, set_up_of(line_up_text(state)))
    assert found.race == replace(state.race, runs_dir="elsewhere")
    assert [row.choices for row in found.rows] == [row.choices for row in state.rows]
    assert found.world == state.world
    assert not {row.number for row in found.rows} & {FIRST, SECOND}
    assert found.edited(A) == found.rows[0]


@pytest.mark.parametrize(
    "text", ["", "!", "e30", "AAAA", "%3Cscript%3E", "eyJ0eXBlIjoiUHV0QmFjayJ9"]
)
def test_a_link_that_is_no_line_up_is_refused_in_one_line(text):
    with pytest.raises(ValueError, match="link: expected a line-up") as refused:
        set_up_of(text)
    assert "\n" not in str(refused.value)


def test_numbers_that_follow_from_the_course_begin_there_and_a_typed_one_stays():
    small = replace(
        choices("colored"), course="lsy_level2", vehicle="crazyflie", settings={}, numbers={}
    )
    state = PageState.of(small)
    (flight,) = state.start
    assert flight.planners().chosen.mppi.samples == flight.spec().planner.mppi.samples == 4096
    # The number of the reference is a change here, and none on the reference's course.
    typed = after(SetSetting(FIRST, "clearance", "2500"), state=state)
    assert typed.start[0].spec().planner.cost.clearance == 2500
    assert line_up_of(typed).changes == (("clearance 2500",),)
    elsewhere = after(ChooseRace("course", "figure8"), state=state)
    assert elsewhere.start[0].planners().chosen.cost == PRESETS["race"]["colored"].cost
    same = after(SetSetting(FIRST, "clearance", "2500"), state=elsewhere)
    assert same.start[0].settings == {}
