"""Claims about what pages ask of stored runs over the link."""

from dataclasses import replace

import pytest
from web_cases import COURSE, Glider, choices, competitor, run_of, store, stored, until
from wire import connect, link, press_start

import quadsim
from quadsim.config.changes import changeable_numbers
from quadsim.config.spec import Spec
from quadsim.record.archive import list_runs, read_run
from quadsim.record.run import same_flight
from quadsim.record.schema import NumberChange
from quadsim.web.page.forms.runs_panel import FLYING, link_to
from quadsim.web.race.live_flight import LiveFlight
from quadsim.web.race.live_heat import LiveHeat
from quadsim.web.race.page_race import PageRace
from quadsim.web.state.commands import AddRow, ChooseRace, SetNumber, apply
from quadsim.web.state.line_up_link import line_up_text
from quadsim.web.state.view import View
from quadsim.web.stored.again import AgainChoices, HeatAgainChoices
from tests.small import SHORT


def now(linked):
    """The playback of a visitor."""
    return linked.part("now")


def shown(session):
    return [entry.folder for entry in session.snapshot.competitors]


@pytest.mark.socket
def test_the_table_comes_when_asked_for_and_again_when_a_run_arrives(page, root, monkeypatch):
    monkeypatch.setattr("quadsim.web.page.forms.runs_panel.PERIOD", 0.02)
    wanted = {stored(root).name}

    def listed(table):
        return {row["name"] for row in table["rows"]}

    with link(page.port) as linked:
        table = linked.ask("runs", "list_runs")
        while listed(table) != wanted:  # as it was when the folder was last read
            table = linked.got("runs")
        wanted.add(stored(root, "gaussian").name)
        while listed(table) != wanted:  # until then, as it was
            table = linked.got("runs")


@pytest.mark.socket
def test_two_runs_are_compared_and_paused_at_a_time(page, root):
    session = page.session
    folders = [stored(root, sampler, laps=2) for sampler in ("colored", "gaussian")]
    names = [folder.name for folder in folders]
    with link(page.port) as linked:
        linked.ask("runs", "list_runs")
        linked.send("replay_runs", names=names, t=1.25)
        assert until(lambda: shown(session) == folders and now(linked)["t"] == 1.25)
        assert not now(linked)["playing"]
        linked.send("replay_runs", names=names[1:])
        assert until(lambda: shown(session) == folders[1:] and now(linked)["playing"])


@pytest.mark.socket
def test_an_address_shows_its_time_and_view_to_who_opens_it_alone(page, root):
    folder = stored(root, laps=2)
    with link(page.port) as one, link(page.port) as other:
        one.ask("runs", "list_runs")
        assert one.set("view", "ghosts", "by place") == ""
        assert "expected one of" in one.set("view", "ghosts", "by luck")  # an address may be wrong
        one.send("replay_runs", names=[folder.name], t=0.5)
        assert until(lambda: now(one)["t"] == 0.5)
        race = page.session.snapshot.race
        assert other.set("view", "limit", True) == ""
        other.send("replay_runs", names=[folder.name], t=1.0)
        assert until(lambda: now(other)["t"] == 1.0)
        assert page.session.snapshot.race == race  # as the run is shown already
        assert now(one)["t"] == 0.5
        shown_to = [linked.form("view")[0] for linked in (one, other)]
    wanted = [("by place", False), ("by time", True)]
    assert [(view["ghosts"]["value"], view["limit"]["value"]) for view in shown_to] == wanted


@pytest.mark.socket
def test_a_replay_leaves_the_next_start_as_it_was_and_refused_runs_too(page, root):
    """What START flies is chosen in one place, which no replay changes."""
    session = page.session
    desk = page.dashboard.desk
    before = desk.state
    folder = stored(root)
    damaged = stored(root, "gaussian")
    (damaged / "telemetry.npz").write_bytes(b"")
    with link(page.port) as linked:
        linked.ask("runs", "list_runs")
        linked.send("replay_runs", names=[folder.name])
        assert until(lambda: shown(session) == [folder])
        linked.send("replay_runs", names=[damaged.name])
        assert until(lambda: any(n.kind == "error" for n in session.snapshot.notices))
        assert shown(session) == [folder]
    assert desk.state.start == before.start
    assert desk.state.against == ()


@pytest.mark.socket
def test_stored_runs_fly_beside_the_next_flight_on_their_course(page, root):
    session = page.session
    folder = stored(root, "gaussian")
    page.dashboard.desk.do(ChooseRace("course", "paper_flat"))
    with link(page.port) as linked, connect(page.port):
        linked.ask("runs", "list_runs")
        linked.send("fly_against", names=[folder.name])
        assert until(lambda: page.dashboard.desk.state.against == (folder.name,))
        assert page.dashboard.desk.state.race.course == COURSE
        press_start(page.port)
        assert until(lambda: session.snapshot.flying)
        live, stored_one = session.snapshot.competitors
        assert (live.live, stored_one.folder) == (True, folder)


@pytest.mark.socket
def test_an_address_sets_up_the_next_start_and_nonsense_is_refused(page, root):
    desk = page.dashboard.desk
    state = desk.state
    rival = apply(state, AddRow(0, like=state.rows[0].number))
    asked = apply(rival, SetNumber(rival.rows[1].number, "temperature", 0.2))
    with link(page.port) as linked:
        linked.send("set_up", line_up=line_up_text(asked))
        assert until(lambda: len(desk.state.rows) == 2)
        assert desk.state.start == asked.start
        assert "expected a line-up" in linked.ask("remark", "set_up", line_up="AAAA")["text"]
        assert desk.state.start == asked.start


@pytest.mark.socket
def test_a_run_is_taken_over_as_a_competitor(page, root):
    desk = page.dashboard.desk
    flown = choices("gaussian", laps=2, numbers={"samples": 512})
    folder = store(root, run_of(Glider(flown)))
    with link(page.port) as linked:
        linked.ask("runs", "list_runs")
        linked.send("take_over", name=folder.name)
        assert until(lambda: len(desk.state.rows) == 2)
    taken = desk.state.flights[1]
    assert (taken.sampler, taken.spec().planner.mppi.samples) == ("gaussian", 512)


@pytest.mark.socket
def test_a_name_that_is_not_listed_is_refused_in_one_line(page, root):
    stored(root)
    with link(page.port) as linked:
        linked.ask("runs", "list_runs")
        for name in ("..", "../runs", "limits", "/etc/passwd", "\x00", "<b>"):
            requests = (
                ("replay_runs", {"names": [name]}),
                ("fly_again", {"name": name}),
                ("word_run", {"name": name}),
            )
            for kind, fields in requests:
                remark = linked.ask("remark", kind, **fields)["text"]
                assert "expected one that is listed" in remark, (kind, name)
                assert "\n" not in remark
            remark = linked.ask("remark", "show_report", name=name)["text"]
            assert "expected a report" in remark, name
    assert not page.session.snapshot.competitors


@pytest.mark.socket
def test_nobody_ends_a_flight_by_the_table(page, root):
    session = page.session
    name = stored(root).name
    session.tell(PageRace.set_speed, 0.1)
    session.tell(PageRace.start, [choices(laps=3)])
    assert until(lambda: session.snapshot.flying)
    race = session.snapshot.race
    with link(page.port) as linked:
        linked.ask("runs", "list_runs")
        for kind, fields in (("replay_runs", {"names": [name]}), ("fly_again", {"name": name})):
            assert linked.ask("remark", kind, **fields)["text"] == FLYING
    assert session.snapshot.flying
    assert session.snapshot.race == race


@pytest.mark.socket
def test_a_run_is_flown_again_and_stored(page, root):
    folder = stored(root, "gaussian", laps=2)
    page.session.tell(PageRace.set_speed, 1e6)
    with link(page.port) as linked:
        linked.ask("runs", "list_runs")
        linked.send("fly_again", name=folder.name)
        assert until(lambda: len(list_runs(root)) == 2)
    digests = {read_run(path).digest() for path in list_runs(root)}
    assert digests == {read_run(folder).digest()}


@pytest.mark.socket
def test_a_run_is_worded(page, root):
    folder = stored(root, "gaussian", laps=2)
    with link(page.port) as linked:
        linked.ask("runs", "list_runs")
        texts = linked.ask("run_wording", "word_run", name=folder.name)
    assert texts["command"].startswith("race fly figure8 --sampler gaussian")
    assert "quadsim.fly('figure8', sampler='gaussian'" in texts["python"]
    assert texts["remark"] == ""


def changed_flight():
    """A flight whose temperature changes."""
    spec = Spec.of("figure8", **SHORT)
    after = replace(spec.planner.mppi, temperature=3.0)
    numbers = changeable_numbers(replace(spec.planner, mppi=after))
    change = NumberChange(0.1, "temperature", 1.0, 3.0, numbers)
    return replace(spec, changes=(change,))


def flown_again(choices, root):
    """Fly on the page without a page; return the folder."""
    flight = LiveFlight(choices)
    flight.keep_in(str(root))
    while not flight.is_over:
        flight.turn()
    flight.end()
    return flight.now.folder


@pytest.mark.compiled
@pytest.mark.parametrize("flight", ["plain", "changed in flight", "by a pilot on sensors"])
def test_a_real_flight_is_flown_again_to_the_same_bits(tmp_path, flight):
    if flight == "changed in flight":
        run = quadsim.fly(changed_flight())
    elif flight == "plain":
        run = quadsim.fly("figure8", **SHORT, seed=3, sampler="gaussian", randomize=1.0)
    else:
        run = quadsim.fly("split_s_swift", pilot="split_s_swift", sensing="gates", timeout=0.3)
    folder = run.save(tmp_path)
    again = read_run(flown_again(AgainChoices(folder, str(tmp_path)), tmp_path))
    assert again.digest() == run.digest()


@pytest.mark.compiled
def test_a_real_race_of_several_is_flown_again_to_the_same_bits(tmp_path):
    heat = quadsim.race(["colored", "gaussian"], "figure8", **SHORT, expect="velocity")
    folder = heat.save(tmp_path)
    flight = LiveHeat(HeatAgainChoices(folder, str(tmp_path)))
    flight.keep_in(str(tmp_path))
    while not flight.is_over:
        flight.turn()
    flight.end()
    for entry, run in zip(flight.entries, heat.runs, strict=True):
        assert same_flight(read_run(entry.folder), run)


def test_a_run_on_the_wall_clock_is_flown_again_on_it(tmp_path):
    run = run_of(Glider(choices(clock="wall", deadline_ms="8")))
    again = AgainChoices(store(tmp_path, run), str(tmp_path)).base_spec()
    assert (again.clock, again.deadline_ms) == ("wall", 8.0)


def test_a_link_names_what_is_shown_and_nothing_outside(tmp_path):
    runs = tmp_path / "runs"
    folder = stored(runs)
    entry = replace(competitor(), folder=folder)
    link = link_to([entry], 3.2025, "chase", View(), str(runs))
    assert link == f"?run={folder.name}&t=3.2025&camera=chase"
    link = link_to([entry], 3.25, "top", View(ghosts="by place", limit=True), str(runs))
    assert link == f"?run={folder.name}&t=3.25&camera=top&ghosts=by+place&limit=1"
    with pytest.raises(ValueError, match="nothing is stored yet"):
        link_to([competitor()], 1.0, "free", View(), str(runs))
    with pytest.raises(ValueError, match="a link can name runs of"):
        link_to([entry], 1.0, "free", View(), str(tmp_path))
