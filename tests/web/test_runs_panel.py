"""Claims about what pages ask of stored runs over the link."""

import asyncio
import json
from contextlib import asynccontextmanager
from dataclasses import replace

import pytest
import websockets
from web_cases import Glider, choices, competitor, run_of, store, stored, until

import quadsim
from quadsim.record.archive import list_runs, load_run
from quadsim.record.run import same_flight
from quadsim.spec.changes import PlannerChange
from quadsim.spec.spec import Spec
from web.again import AgainChoices, HeatAgainChoices
from web.live_flight import LiveFlight
from web.live_heat import LiveHeat
from web.page.runs_panel import FLYING, link_to
from web.race import PageRace

SMALL = {"samples": 256, "horizon": 40, "iterations": 1, "laps": 1, "timeout": 0.4}


class Page:
    """The link of an open page."""

    def __init__(self, socket):
        self._socket = socket

    async def send(self, kind, **fields):
        await self._socket.send(json.dumps({"type": kind, **fields}))

    async def got(self, kind):
        """Return the next message of a type."""
        while True:
            message = json.loads(await asyncio.wait_for(self._socket.recv(), 10))
            if message["type"] == kind:
                return message

    async def ask(self, answer, kind, **fields):
        await self.send(kind, **fields)
        return await self.got(answer)


@asynccontextmanager
async def link(server):
    address = f"ws://127.0.0.1:{server.get_port()}/link"
    async with websockets.connect(address, max_size=None) as socket:
        yield Page(socket)


def talk(page, client_does):
    """Run a coroutine function on a link to the page."""

    async def talks():
        async with link(page[1]) as linked:
            await client_does(linked)

    asyncio.run(talks())


async def comes(claim):
    assert await asyncio.to_thread(until, claim)


def shown(session):
    return [entry.folder for entry in session.snapshot.competitors]


def test_the_table_comes_when_asked_for_and_again_when_a_run_arrives(page, session, tmp_path):
    first = stored(tmp_path)

    async def client_does(linked):
        table = await linked.ask("runs", "list_runs")
        while len(table["rows"]) < 1:
            table = await linked.got("runs")
        assert [row["name"] for row in table["rows"]] == [first.name]
        second = stored(tmp_path, "gaussian")
        table = await linked.got("runs")
        assert {row["name"] for row in table["rows"]} == {first.name, second.name}

    talk(page, client_does)


def test_two_runs_are_compared_and_paused_at_a_time(page, session, tmp_path):
    folders = [stored(tmp_path, sampler, laps=2) for sampler in ("colored", "gaussian")]
    names = [folder.name for folder in folders]

    async def client_does(linked):
        await linked.ask("runs", "list_runs")
        await linked.send("replay_runs", names=names, t=1.25)
        await comes(lambda: shown(session) == folders and session.snapshot.t == 1.25)
        assert not session.snapshot.playing
        assert page[0].race.is_replay
        await linked.send("replay_runs", names=names[1:])
        await comes(lambda: shown(session) == folders[1:] and session.snapshot.playing)

    talk(page, client_does)


@pytest.mark.parametrize("name", ["..", "../runs", "limits", "/etc/passwd", "\x00", "<b>"])
def test_a_name_that_is_not_listed_is_refused_in_one_line(page, session, tmp_path, name):
    stored(tmp_path)

    async def client_does(linked):
        await linked.ask("runs", "list_runs")
        requests = (
            ("replay_runs", {"names": [name]}),
            ("fly_again", {"name": name}),
            ("word_run", {"name": name}),
        )
        for kind, fields in requests:
            remark = await linked.ask("remark", kind, **fields)
            assert "expected one that is listed" in remark["text"]
            assert "\n" not in remark["text"]
        assert "expected a report" in (await linked.ask("remark", "show_report", name=name))["text"]
        assert not session.snapshot.competitors

    talk(page, client_does)


def test_nobody_ends_a_flight_by_the_table(page, session, tmp_path):
    name = stored(tmp_path).name
    session.tell(PageRace.set_speed, 0.1)
    session.tell(PageRace.start, [choices(laps=3)])

    async def client_does(linked):
        await comes(lambda: session.snapshot.flying)
        await linked.ask("runs", "list_runs")
        for kind, fields in (("replay_runs", {"names": [name]}), ("fly_again", {"name": name})):
            assert (await linked.ask("remark", kind, **fields))["text"] == FLYING
        assert session.snapshot.flying
        assert session.snapshot.race == 1

    talk(page, client_does)


def test_a_run_is_flown_again_and_stored(page, session, tmp_path):
    folder = stored(tmp_path, "gaussian", laps=2)

    async def client_does(linked):
        await linked.ask("runs", "list_runs")
        await linked.send("fly_again", name=folder.name)
        session.tell(PageRace.set_speed, 1e6)
        await comes(lambda: len(list_runs(tmp_path)) == 2)

    talk(page, client_does)
    digests = {load_run(path).digest() for path in list_runs(tmp_path)}
    assert digests == {load_run(folder).digest()}


def test_a_run_is_worded(page, session, tmp_path):
    folder = stored(tmp_path, "gaussian", laps=2)

    async def client_does(linked):
        await linked.ask("runs", "list_runs")
        texts = await linked.ask("run_wording", "word_run", name=folder.name)
        assert texts["command"].startswith("race fly figure8 --sampler gaussian")
        assert "quadsim.fly('figure8', sampler='gaussian'" in texts["python"]
        assert texts["remark"] == ""

    talk(page, client_does)


def changed_flight():
    """A flight whose temperature changes."""
    spec = Spec.of("figure8", **SMALL)
    after = replace(spec.planner.mppi, temperature=3.0)
    change = PlannerChange(0.1, "temperature", 1.0, 3.0, spec.planner.sampling, after)
    return replace(spec, changes=(change,))


def flown_again(choices, root):
    """Fly on the page without a page; return the folder."""
    flight = LiveFlight(choices)
    flight.keep_in(str(root))
    while not flight.is_over:
        flight.turn()
    flight.end()
    return flight.now.folder


@pytest.mark.parametrize("flight", ["plain", "changed in flight", "by a pilot on sensors"])
def test_a_real_flight_is_flown_again_to_the_same_bits(tmp_path, flight):
    if flight == "changed in flight":
        run = quadsim.fly(changed_flight())
    elif flight == "plain":
        run = quadsim.fly("figure8", **SMALL, seed=3, sampler="gaussian", randomize=1.0)
    else:
        run = quadsim.fly("split_s_swift", pilot="split_s_swift", sensing="gates", timeout=1.0)
    folder = run.save(tmp_path)
    again = load_run(flown_again(AgainChoices(folder, str(tmp_path)), tmp_path))
    assert again.digest() == run.digest()


def test_a_real_race_of_several_is_flown_again_to_the_same_bits(tmp_path):
    heat = quadsim.race(["colored", "gaussian"], "figure8", **SMALL, expect="velocity")
    folder = heat.save(tmp_path)
    flight = LiveHeat(HeatAgainChoices(folder, str(tmp_path)))
    flight.keep_in(str(tmp_path))
    while not flight.is_over:
        flight.turn()
    flight.end()
    for entry, run in zip(flight.entries, heat.runs, strict=True):
        assert same_flight(load_run(entry.folder), run)


def test_a_run_on_the_wall_clock_is_flown_again_on_it(tmp_path):
    run = run_of(Glider(choices(clock="wall", deadline_ms="8")))
    again = AgainChoices(store(tmp_path, run), str(tmp_path)).base_spec()
    assert (again.clock, again.deadline_ms) == ("wall", 8.0)


def test_a_link_names_what_is_shown_and_nothing_outside(tmp_path):
    runs = tmp_path / "runs"
    folder = stored(runs)
    entry = replace(competitor(), folder=folder)
    link = link_to([entry], 3.2, "chase", str(runs))
    assert link == f"?run={folder.name}&t=3.20&camera=chase"
    with pytest.raises(ValueError, match="nothing is stored yet"):
        link_to([competitor()], 1.0, "free", str(runs))
    with pytest.raises(ValueError, match="a link can name runs of"):
        link_to([entry], 1.0, "free", str(tmp_path))
