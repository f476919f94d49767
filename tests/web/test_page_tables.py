"""Claims about what the page writes: escaped, best and faster, results, the leader's numbers."""

import re
from dataclasses import replace

import numpy as np
import pytest
from web_cases import COURSE, choices, competitor

from quadsim.limit.limits import limit_of
from quadsim.palette import HIT_ON_DARK, NEXT, STYLES
from quadsim.racing.events import sector_times
from quadsim.racing.hand import Hand, HandRates
from quadsim.vehicle import load_vehicle
from quadsim.web.page.parts.course_map import Map
from quadsim.web.page.parts.elements import DIM, SHEET, Element, element, label, table, to_html
from quadsim.web.page.parts.head import coming_head, head_of, next_of
from quadsim.web.page.parts.laps import FEW_LAPS, chatter, coloured_time, laps, splits
from quadsim.web.page.parts.line_up_table import table_of
from quadsim.web.page.parts.sectors import sectors
from quadsim.web.page.parts.time_line import time_line_of
from quadsim.web.page.parts.timing import events, planner
from quadsim.web.page.parts.tower import tower_of
from quadsim.web.page.scene.camera import MODES
from quadsim.web.race.competitor import named
from quadsim.web.race.lap_timing import lap_timings
from quadsim.web.race.snapshot import Preparing, Snapshot
from quadsim.web.state.commands import ChooseRace, SetNumber, apply
from quadsim.web.state.line_up import line_up_of
from quadsim.web.state.page_state import PageState


@pytest.fixture(scope="module")
def competitors():
    return named([competitor("colored"), competitor("gaussian")])


def at(competitors, t):
    return lap_timings(Snapshot(t=t, end=99.0, competitors=tuple(competitors)))


def test_two_runs_of_one_sampler_differ_in_line_and_others_keep_theirs(competitors):
    one, two = named([competitor(), competitor(seed=1)])
    assert one.style == STYLES["colored"] != two.style
    assert two.style.colour != one.style.colour
    assert two.style.dash != one.style.dash
    assert to_html(label(one)) != to_html(label(two)).replace("seed 1", "seed 0")
    assert [x.style for x in competitors] == [STYLES["colored"], STYLES["gaussian"]]


def test_a_long_race_has_columns_for_the_laps_that_have_begun(competitors):
    long = [one.with_record({**one.record, "laps": 1000}) for one in competitors]
    begun = max(len(one.laps) for one in competitors) + 1
    short = [one.with_record({**one.record, "laps": max(begun, FEW_LAPS)}) for one in competitors]
    assert laps(long) == laps(short)


def ended(entry, outcome, *events):
    """The same flight with another end, before the end of its last lap."""
    at_end = [replace(e, t=float(entry.t[-1])) for e in events]
    return replace(
        entry, outcome=outcome, events=(*entry.events[:-1], *at_end), laps=entry.laps[:-1]
    )


def coming(*flights):
    """The head before a START."""
    state = PageState.of(*flights)
    return coming_head(state, line_up_of(state))


def head_at(entries, t):
    s = Snapshot(t=t, end=99.0, competitors=tuple(entries))
    return head_of(s, at(entries, t), coming(choices()))


def said(head):
    """The words of a head, line by line."""
    sentence = "".join(word.text for word in head.sentence)
    numbers = " ".join(word.text for word in head.numbers)
    return "\n".join([sentence, head.differs, numbers, head.state, *head.warnings])


def shown_at(entries, t):
    """What the head and the results of the tower say."""
    rows = tower_of(at(entries, t)).rows
    return "\n".join([said(head_at(entries, t)), *(row.result for row in rows)])


def test_the_head_says_how_a_flight_ended_once_it_has(competitors):
    one = competitors[0]
    last = one.events[-1]
    hit = replace(last, kind="hit", gate=4, lap=2)
    ground = replace(last, kind="ground", gate=0, lap=3)
    results = {
        f"FINISHED {sum(one.laps):.3f} s": one,
        "CRASHED at gate 4, lap 2": ended(one, "crashed", hit),
        "CRASHED on the ground, lap 3": ended(one, "crashed", hit, ground),
        "DNF timeout, lap 3": ended(one, "timeout"),
    }
    for result, entry in results.items():
        assert result in shown_at([entry], 99.0)
        assert result not in shown_at([entry], 0.5)


def test_the_row_of_numbers_is_the_leaders_and_names_it(competitors):
    """The second of the competitors is the faster one."""
    slow, fast = named([competitors[1], competitors[0]])
    (leader,) = at([fast], 1.0)
    numbers = [word.text for word in head_at([slow, fast], 1.0).numbers]
    assert numbers[0] == "colored"
    assert f"gate {leader.gate}/{leader.entry.legs.gates}" in numbers
    assert f"{leader.entry.speed(leader.i):.1f} m/s" in numbers


def test_what_differs_is_said_under_the_headline(competitors):
    assert "They differ in sampler; all else is equal." in shown_at(competitors, 1.0)
    seeds = named([competitor(), competitor(seed=5)])
    assert "They differ in seed (0 / 5); all else is equal." in shown_at(seeds, 1.0)


def test_of_a_flight_without_a_plan_the_page_says_who_flies(competitors):
    record = competitors[0].record
    for flown, said in (
        ({"pilot": {"name": "swift_1", "sha256": "0"}}, "the learned pilot swift_1 flies"),
        ({"hand": Hand(HandRates.of(load_vehicle("swift"))).record()}, "a person flies"),
        ({"excite": True}, "manoeuvres excite the vehicle"),
    ):
        (timing,) = at([competitors[0].with_record(record | flown)], 1.0)
        assert said in read(planner(timing))


def test_runs_of_different_laps_are_compared_over_the_common_ones_in_words():
    long, short = named([competitor("colored", laps=2), competitor("gaussian", laps=1)])
    for t in (0.5, short.last_t + 0.1, 99.0):
        plain = shown_at([long, short], t)
        assert "over the first lap" in plain
        assert "by -" not in plain
    assert tower_of(at([long, short], 0.5)).over == "over the first lap"


def test_not_comparable_is_said_of_the_competitor_that_was_changed_alone(competitors):
    change = {"t": 0.1, "name": "sigma", "from": 1.0, "to": 2.0}
    changed = competitors[1].with_record({**competitors[1].record, "interactive": [change]})
    page = shown_at([competitors[0], changed], 1.0)
    assert "gaussian: interactive, not comparable: 1 change in flight" in page
    assert "colored: interactive" not in page


def test_before_the_first_plan_is_ready_the_head_says_that_it_is_made(competitors):
    none_yet = {name: column[:0] for name, column in competitors[0].x.items()}
    live = replace(competitors[0], live=True, outcome=None, x=none_yet)
    next_one = coming(choices())
    third = Preparing("compiling", 3, 5)
    compiling = Snapshot(flying=True, preparing=third, competitors=(live,))
    assert "Compiling planner 3 of 5" in said(head_of(compiling, [], next_one))
    building = Snapshot(preparing=Preparing("building", 1, 2))
    assert said(head_of(building, [], next_one)).startswith("START: building flight 1 of 2")
    planning = head_of(Snapshot(flying=True, competitors=(live,)), [], next_one)
    assert planning.phase == "planning"
    assert said(planning).startswith("Planning the first step of colored")
    assert head_of(Snapshot(), [], next_one) is next_one


def test_alone_nobody_leads(competitors):
    page = said(head_at([competitors[0]], 1.0))
    assert page.startswith("colored flies lap 1 of 3")
    assert "leads" not in page


def test_a_flight_that_finished_says_how_far_above_the_best_known_limit(competitors):
    entry = competitor()
    limit = limit_of(entry.record)
    above = f"{entry.name} {100 * (sum(entry.laps) / limit.time - 1):.1f} %"
    for shown in ([entry], [competitors[0], entry]):  # also as the second run
        (told,) = head_at(shown, 99.0).warnings  # the limit once
        assert told.startswith(f"above the best known limit of {limit.time:.3f} s: ")
        assert above in told
        assert above not in shown_at(shown, 0.5)
    assert "above" not in shown_at([ended(entry, "timeout")], 99.0)


def test_the_tower_says_who_did_not_finish_and_counts_misses(competitors):
    last = competitors[1].events[-1]
    missed = ended(
        competitors[1], "timeout", replace(last, kind="miss"), replace(last, kind="wrong_way")
    )
    first, second = tower_of(at([competitors[0], missed], 99.0)).rows
    assert (first.is_out, second.is_out, second.time) == (False, True, "DNF")
    assert (first.misses, second.misses) == (0, 2)
    assert not any(row.is_out for row in tower_of(at(competitors, 99.0)).rows)
    stopped = ended(competitors[1], "interrupted")
    assert tower_of(at([stopped], 99.0)).rows[0].time == "stopped"
    assert head_at([stopped], 99.0).phase == "stopped"
    assert head_at([missed], 99.0).phase == "ended"


def test_the_tower_has_the_time_of_the_lap_and_at_the_end_of_the_race_above_the_limit(competitors):
    one = competitors[0]
    during, after = (tower_of(at([one], t)) for t in (one.laps[0] + 0.5, 99.0))
    assert float(during.rows[0].time) == pytest.approx(0.5, abs=0.02)
    assert (during.rows[0].above, during.is_final) == ("", False)
    race = sum(one.laps)
    above = f"{100 * (race / limit_of(one.record).time - 1):+.1f} %"
    assert (after.rows[0].time, after.rows[0].above) == (f"{race:.3f}", above)
    assert after.is_final
    # while another one flies on, nothing is final
    assert not tower_of(at(competitors, one.last_t)).is_final


def test_two_that_end_level_have_the_same_place(competitors):
    same = named([competitors[0], competitors[0]])
    assert [row.place for row in tower_of(at(same, 99.0)).rows] == [1, 1]
    assert [row.place for row in tower_of(at(competitors, 99.0)).rows] == [1, 2]


def test_beside_a_live_flight_recorded_runs_are_called_so(competitors):
    live = replace(competitors[1], live=True)
    shown = tower_of(at([live, competitors[0]], 1.0)).rows
    assert {row.name: row.is_recorded for row in shown} == {"colored": True, "gaussian": False}
    assert not any(row.is_recorded for row in tower_of(at(competitors, 1.0)).rows)


def test_before_a_start_is_said_who_flies_where_and_what_they_differ_in():
    two = PageState.of(choices("colored"), choices("gaussian"))
    state = apply(two, ChooseRace("world", "in one world"))
    words = said(coming_head(state, line_up_of(state)))
    assert words.startswith("START flies colored against gaussian")
    assert f"on {COURSE}, in one world. They differ in sampler; all else is equal" in words


def test_the_table_of_competitors_names_their_numbers_and_why_they_cannot_be_flown():
    two = PageState.of(choices("colored"), choices("gaussian"))
    _, second = (row.number for row in two.rows)
    state = apply(two, SetNumber(second, "samples", 512))
    table = table_of(state, line_up_of(state))
    assert [row.changes for row in table.rows] == ["", "samples 512"]
    assert table.rows[1].colour == STYLES["gaussian"].colour
    assert "They differ in sampler" in table.compared
    wrong = apply(state, ChooseRace("course", "no_such"))
    assert "no_such" in table_of(wrong, line_up_of(wrong)).problem
    # where START stands, too
    head = coming_head(wrong, line_up_of(wrong))
    assert said(head).startswith("START cannot fly this\n")
    assert head.differs == next_of(wrong, line_up_of(wrong), "").problem != ""
    assert next_of(state, line_up_of(state), "").problem == ""


def test_the_tower_says_the_last_and_the_best_lap_of_each(competitors):
    """The first lap is the best, as it begins nearer to the first gate."""
    timings = at(competitors, float(competitors[1].t[-1]))
    rows = {row.name: row for row in tower_of(timings).rows}
    for one, timing in zip(competitors, timings, strict=True):
        assert (timing.best, timing.last) == (one.laps[0], one.laps[-1])
        assert timing.best < timing.last
        row = rows[one.name]
        assert (row.last.text, row.best.text) == (f"{timing.last:.3f}", f"{timing.best:.3f}")
    assert [row.best.mark for row in rows.values()] == ["best", "own"]


def test_the_interval_is_to_the_one_ahead_and_the_gap_to_the_leader(competitors):
    entries = named([*competitors, competitor("gaussian", seed=1)])
    entries[2].x["px"][:] = entries[1].x["px"]
    first, second, third = tower_of(at(entries, 1.0)).rows
    assert (first.place, first.interval, first.gap) == (1, "leads", "")
    assert (second.place, second.interval) == (2, second.gap)
    assert (third.place, third.interval, third.gap) == (3, "level", second.gap)


def test_of_two_that_are_level_nobody_leads(competitors):
    entries = named([competitors[1], competitor("gaussian", seed=1)])
    assert [row.interval for row in tower_of(at(entries, 1.0)).rows] == ["level", "level"]


def test_the_best_time_of_all_a_runs_own_best_and_another_one_look_different():
    best, own, plain = (coloured_time(t, best=1.0, own=1.5) for t in (1.0, 1.5, 2.0))
    assert plain == "2.000"
    assert best.attributes != own.attributes
    # the best of all is that, also where it is a run's own
    assert coloured_time(1.0, best=1.0, own=1.0) == best


def test_the_time_line_has_a_mark_for_every_event_and_the_laps(competitors):
    one = competitors[0]
    last = one.events[-1]
    hit = replace(one, events=(*one.events, replace(last, kind="hit")))
    shown = time_line_of([one, hit])
    plain, crashed = (lane.marks for lane in shown.lanes)
    assert len(plain) == len(one.events) == len(crashed) - 1
    assert [mark.kind for mark in plain].count("lap") == len(one.laps) == 3
    assert (crashed[-1].t, crashed[-1].kind) == (last.t, "bad")
    assert shown.laps == one.lap_starts
    assert shown.lanes[0].end == one.last_t
    assert time_line_of([replace(one, live=True, outcome=None)]).lanes[0].end is None
    (stuck,) = time_line_of([replace(one, outcome="stuck")]).lanes
    assert (stuck.marks[-1].kind, stuck.marks[-1].t) == ("bad", one.last_t)


def test_names_from_files_cannot_run_scripts(competitors):
    evil = "<script>alert(1)</script>"
    named_evil = competitors[0].with_record({**competitors[0].record, "sampler": evil})
    event = replace(competitors[0].events[0], kind=evil)
    bad = [
        replace(named_evil, name=evil, events=(event,), outcome=evil),
        competitors[1],
    ]
    timings = at(bad, 1.0)
    shown = shown_of(bad, timings)
    assert all("script" not in {one.tag for one in nodes(part)} for part in shown)
    assert any(evil in texts(part) for part in shown)
    pages = [to_html(part) for part in shown]
    assert all("<script" not in page for page in pages)
    assert any("&lt;script" in page for page in pages)


def shown_of(entries, timings):
    """All elements that the page shows of a race."""
    between = sectors(entries, entries[0])
    parts = [events(entries, 9.0), laps(entries, between), planner(timings[0]), chatter(entries)]
    return [*parts, Map(entries[0].course).draw(timings)]


def nodes(content):
    """An element and all elements in it."""
    found = [content]
    for child in content.children:
        if isinstance(child, Element):
            found += nodes(child)
    return found


def texts(content):
    return " ".join(
        child for one in nodes(content) for child in one.children if isinstance(child, str)
    )


def read(content):
    """Return the texts of an element and of all elements in it, one after another."""
    if isinstance(content, str):
        return content
    return "".join(map(read, content.children))


def test_what_is_written_into_a_file_is_escaped_and_has_its_values_as_custom_properties():
    found = element(
        "div", "1 < 2", element("img", alt='"'), look="small", values={"colour": "#fff"}
    )
    wanted = '<div class="small" style="--colour:#fff">1 &lt; 2<img alt="&quot;"></div>'
    assert to_html(found) == wanted
    drawn = element("line", x1=1.26, stroke_dasharray="3 4")
    assert to_html(drawn) == '<line x1="1.3" stroke-dasharray="3 4"></line>'


def test_every_class_that_is_written_is_in_the_style_sheet_and_no_style_is(competitors):
    change = {"t": 0.1, "name": "sigma", "from": 1.0, "to": 2.0}
    last = competitors[1].events[-1]
    hit = ended(competitors[1], "crashed", replace(last, kind="hit", gate=1, lap=2))
    changed = hit.with_record({**hit.record, "interactive": [change]})
    entries = [competitors[0], changed]
    timings = at(entries, 1.0)
    few = competitor()
    few.x["ess"][:] = 1.0
    parts = [*shown_of(entries, timings), planner(at([few], 1.0)[0])]
    parts += [laps([few]), table(["a", "b"], [["1", "2"], "spans both"])]
    found = [one for part in parts for one in nodes(part)]
    sheet = SHEET.read_text()
    rules = set(re.findall(r"\.([a-z][a-z-]*)", re.sub(r"/\*.*?\*/", "", sheet, flags=re.S)))
    classes = {name for one in found for name in one.attributes.get("class", "").split()}
    assert len(classes) > 15
    assert classes <= rules
    assert not any("style" in one.attributes for one in found)
    # What a rule reads is written, and what is written is read.
    values = {name for one in found for name in one.values}
    own = set(re.findall(r"^  --([a-z-]+):", sheet, flags=re.M))
    assert set(re.findall(r"var\(--([a-z-]+)\)", sheet)) - own == values


def test_the_colours_of_the_scene_and_of_pictures_are_those_of_the_style_sheet():
    own = dict(re.findall(r"--([a-z-]+): (#[0-9a-f]{6});", SHEET.read_text()))
    assert (own["dim"], own["bad"], own["next"]) == (DIM, HIT_ON_DARK, NEXT)


def test_the_page_has_a_button_for_each_mode_of_the_camera_and_the_speeds_of_flights():
    document = SHEET.with_name("index.html").read_text()
    assert tuple(re.findall(r'data-camera="(.*?)"', document)) == MODES
    assert time_line_of([]).speeds == (0.1, 0.25, 0.5, 1.0, 2.0, 4.0)


def test_the_page_builds_each_tag_and_attribute_that_is_written(competitors):
    script = SHEET.with_name("dom.js").read_text()
    known = set(" ".join(re.findall(r'"([\w -]+)"\.split', script)).split())
    found = [one for part in shown_of(competitors, at(competitors, 1.0)) for one in nodes(part)]
    assert {one.tag for one in found} <= known
    assert {name for one in found for name in one.attributes} <= known


def test_a_replay_shows_the_terms_of_the_last_snapshot_kept(competitors):
    for frame, kept in ((0, 0), (9, 0), (10, 10), (57, 50)):
        (me, *_) = at(competitors, 0.01 * frame)
        page = read(planner(me))
        assert (f"{kept:+.3f}" in page) == (kept > 0)
        assert f"J = {kept - 0.5:.3f}, the sum at {0.01 * kept:.2f} s" in page
        assert "waypoint" in page
        assert "crash" not in page  # a term of zero is left out


@pytest.mark.parametrize("how", ["no snapshots", "snapshots without terms"])
def test_a_run_that_kept_no_terms_says_so_with_a_dash(competitors, how):
    snapshots = (
        replace(competitors[0].snapshots, terms={}) if how == "snapshots without terms" else None
    )
    (me,) = at([replace(competitors[0], snapshots=snapshots)], 0.5)
    assert "J = 1.000; its terms: - (not kept with this run)" in read(planner(me))


def test_the_splits_are_the_times_from_gate_to_gate(competitors):
    page = "".join(map(to_html, splits(competitors)))
    wanted = [f"{t:.2f}" for one in competitors for lap in sector_times(one.events) for t in lap]
    assert re.findall(r">(\d\.\d\d)<", page) == wanted
    assert len(wanted) == 2 * 3 * competitors[0].legs.gates


def test_beside_other_laps_a_run_changed_in_flight_is_named_so(competitors):
    change = {"t": 0.1, "name": "sigma", "from": 1.0, "to": 2.0}
    changed = competitors[1].with_record({**competitors[1].record, "interactive": [change, change]})
    page = read(laps([competitors[0], changed]))
    assert page.count("not comparable") == 1
    assert "comparable" not in read(laps(competitors))


def test_a_change_of_an_unknown_number_is_listed_and_is_no_number_of_the_page(competitors):
    changes = [
        {"t": 0.1, "name": "sigma", "from": 1.0, "to": 2.0},
        {"t": 0.1, "name": "wind", "from": 1.0, "to": 3.0},
    ]
    changed = competitors[1].with_record({**competitors[1].record, "interactive": changes})
    assert changed.numbers(0.2) == competitors[1].numbers(0.2) | {"sigma": 2.0}
    assert "wind 1 → 3" in read(events([changed], 0.2))


def test_the_bar_of_a_strip_is_students_interval(competitors):
    """mean -+ t s / sqrt(n), scipy.stats.t.ppf(.975, 2) = 4.3027; the other run's laps give the
    strip its width."""
    times, others = (5.0, 5.1, 5.3), (4.0, 6.0)
    entries = [replace(competitors[0], laps=times), replace(competitors[1], laps=others)]
    page = to_html(laps(entries))
    bars = re.findall(
        r'<line class="interval" x1="([\d.]+)" x2="([\d.]+)" y1="15.0" y2="15.0"', page
    )
    ((x1, x2),) = [(float(a), float(b)) for a, b in bars]
    low, high = (float(x) for x in re.findall(r'cx="([\d.]+)" cy="45.0"', page))
    scale = (others[1] - others[0]) / (high - low)  # [s/px]
    half = 4.3027 * np.std(times, ddof=1) / np.sqrt(3)
    assert (x2 - x1) / 2 * scale == pytest.approx(half, abs=0.002)
    assert others[0] + ((x1 + x2) / 2 - low) * scale == pytest.approx(np.mean(times), abs=0.002)


def test_samplers_differ_in_colour_and_in_line():
    assert len({s.colour for s in STYLES.values()}) == len(STYLES)
    assert len({s.dash for s in STYLES.values()}) == len(STYLES)


def test_every_sampler_has_its_style():
    from quadsim.controllers.samplers import SAMPLERS

    assert set(SAMPLERS) <= set(STYLES)
