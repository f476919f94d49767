"""Claims about flying by hand, without a browser: who has the sticks, and when a flight begins."""

import asyncio
import json

import pytest
import websockets
from web_cases import COURSE, until

from quadsim.racing.hand import SILENCE, Hand, HandRates, Sticks
from quadsim.record.archive import list_runs
from quadsim.record.run import has_planner
from quadsim.vehicle import load_vehicle
from web.choices import Choices, HeatChoices
from web.cockpit import ABANDONED, Cockpit
from web.live_flight import LiveFlight
from web.race import PageRace, take_off
from web.session import Session
from web.stored_runs import stored_competitor

RATES = HandRates.of(load_vehicle("swift"))
HOVER = Sticks(throttle=RATES.hover)
DOWN = Sticks(throttle=0.0)
BY_HAND = Choices(course=COURSE, laps=1, sampler="hand")
SMALL = {"samples": 128, "horizon": 60, "first_iterations": 10}


class Clock:
    """A clock that is set by hand."""

    now = 100.0

    def __call__(self):
        return self.now


def test_only_the_visitor_who_took_the_sticks_moves_them():
    clock = Clock()
    cockpit = Cockpit(clock)
    hand = Hand(RATES, clock)
    cockpit.serve(hand)
    assert not cockpit.move(1, HOVER)
    assert cockpit.take(1)
    assert cockpit.move(1, HOVER)
    assert not cockpit.take(2)
    assert not cockpit.move(2, Sticks(roll=1.0))
    assert hand.sticks == HOVER
    cockpit.let_go(2)
    assert cockpit.pilot == 1
    cockpit.let_go(1)
    assert cockpit.pilot is None
    assert not cockpit.move(1, HOVER)


def test_sticks_that_nobody_moves_can_be_taken_by_another_visitor():
    clock = Clock()
    cockpit = Cockpit(clock)
    assert cockpit.take(1)
    clock.now += 0.9 * ABANDONED
    assert not cockpit.take(2)
    clock.now += 0.2 * ABANDONED
    assert cockpit.take(2)
    assert cockpit.pilot == 2


def test_a_gamepad_that_rests_in_the_middle_does_not_begin_a_flight():
    cockpit = Cockpit()
    cockpit.serve(Hand(RATES))
    cockpit.take(1)
    cockpit.move(1, Sticks(throttle=0.5))
    assert not cockpit.is_ready
    cockpit.move(1, DOWN)
    assert not cockpit.is_ready
    cockpit.move(1, Sticks(throttle=0.5))
    assert cockpit.is_ready
    # the next flight begins anew
    cockpit.serve(Hand(RATES))
    cockpit.move(1, HOVER)
    assert not cockpit.is_ready


@pytest.fixture
def flying(tmp_path):
    """A session in which a vehicle stands on its start until the throttle is raised."""
    session = Session(str(tmp_path), take_off)
    session.tell(PageRace.set_speed, 4.0)
    session.tell(PageRace.start, [BY_HAND])
    assert until(lambda: session.snapshot.waiting and len(session.snapshot.competitors[0].t), 30)
    yield session
    session.close()


def raise_throttle(session):
    session.cockpit.take(1)
    session.cockpit.move(1, DOWN)
    session.cockpit.move(1, HOVER)


@pytest.mark.flight
def test_a_vehicle_stands_on_its_start_until_the_throttle_is_raised(flying):
    height = flying.snapshot.competitors[0].x["pz"][0]
    assert not until(lambda: flying.snapshot.t > 0.0, 0.4)
    raise_throttle(flying)

    def hovers():
        flying.cockpit.move(1, HOVER)
        return flying.snapshot.t > 0.4

    assert until(hovers)
    (entry,) = flying.snapshot.competitors
    assert entry.x["pz"][-1] == pytest.approx(height, abs=0.1)
    assert flying.snapshot.factor < 1.3  # in real time, whatever speed was asked for


@pytest.mark.flight
def test_without_sticks_the_failsafe_flies_and_is_recorded(flying):
    raise_throttle(flying)
    assert until(lambda: flying.snapshot.t > SILENCE + 0.4)
    (entry,) = flying.snapshot.competitors
    late = entry.t > SILENCE + 0.2
    assert entry.x["a_cmd"][-1] < RATES.control(HOVER).thrust
    assert not entry.x["wx_cmd"][late].any()
    assert flying.cockpit.sticks is None


@pytest.mark.flight
def test_a_person_flies_in_real_time(flying):
    flying.tell(PageRace.set_speed, 0.1)
    flying.tell(PageRace.play, False)
    flying.tell(PageRace.step)
    assert until(lambda: sum(n.kind == "error" for n in flying.snapshot.notices) == 2)
    assert flying.snapshot.t == 0.0


@pytest.mark.flight
def test_a_person_and_a_planner_fly_in_one_world_and_are_kept(tmp_path):
    colored = Choices(course=COURSE, laps=1, settings={**SMALL, "timeout": 0.6})
    hand = Choices(course=COURSE, laps=1, sampler="hand", settings={"timeout": 0.6})
    cockpit = Cockpit()
    race = PageRace(str(tmp_path), cockpit=cockpit)
    race.start([HeatChoices((hand, colored))])
    race.turn()
    # both stand
    assert {len(entry.t) for entry in race.snapshot().competitors} == {1}
    race.turn()
    assert {len(entry.t) for entry in race.snapshot().competitors} == {1}
    cockpit.take(1)
    cockpit.move(1, DOWN)
    while race.snapshot().flying:
        cockpit.move(1, Sticks(yaw=1.0, throttle=RATES.hover))
        race.turn()
    flown, planned = race.snapshot().competitors
    assert (flown.sampler, planned.sampler) == ("hand", "colored")
    assert flown.x["wz_cmd"][5] == pytest.approx(-RATES.yaw.most)
    kept = stored_competitor(flown.folder)
    assert not kept.has_planner
    assert kept.spec["hand"] == flown.spec["hand"]


def test_two_competitors_by_hand_are_refused(tmp_path):
    race = PageRace(str(tmp_path))
    for choices in ([BY_HAND, BY_HAND], [HeatChoices((BY_HAND, BY_HAND))]):
        with pytest.raises(ValueError, match="sampler: expected one competitor by hand"):
            race.start(choices)
    assert race.snapshot().race == 0
    assert not list_runs(tmp_path)


@pytest.mark.flight
def test_a_flight_by_hand_has_no_number_of_a_planner():
    flight = LiveFlight(Choices(course=COURSE, sampler="hand", numbers={"samples": 512}))
    try:
        assert flight.hand is not None
        assert flight.now.spec["planner"]["mppi"]["samples"] != 512
        assert not has_planner(flight.now.spec)
    finally:
        flight.close()


def talk(server, *messages):
    """Send messages as one visitor; return the answers."""

    async def talks():
        answers = []
        async with websockets.connect(f"ws://127.0.0.1:{server.get_port()}/link") as socket:
            for message in messages:
                await socket.send(message if isinstance(message, str) else json.dumps(message))
            while True:
                try:
                    answers.append(json.loads(await asyncio.wait_for(socket.recv(), 0.5)))
                except TimeoutError:
                    return answers

    return asyncio.run(talks())


STICKS = {"type": "sticks", "roll": 0.25, "pitch": 0.0, "yaw": 0.0, "throttle": 0.5, "stamp": 7.5}


def test_sticks_are_answered_with_their_stamp_once_they_were_taken(page, session):
    _, server = page
    cockpit = session.cockpit
    cockpit.serve(Hand(RATES))
    nobody = [a for a in talk(server, STICKS) if a["type"] == "heard"]
    assert nobody == []
    answers = talk(server, {"type": "take", "seat": "of nobody"}, STICKS)
    taken, heard = (a for a in answers if a["type"] in ("taken", "heard"))
    assert taken["yours"]
    assert heard == {"type": "heard", "stamp": 7.5}
    # the page was closed
    assert until(lambda: cockpit.pilot is None)


@pytest.mark.parametrize(
    "wrong",
    [
        {"roll": 1.01},
        {"pitch": -2},
        {"throttle": -0.1},
        {"yaw": None},
        {"yaw": "1"},
        {"more": 1},
        '{"type": "sticks", "roll": NaN, "pitch": 0, "yaw": 0, "throttle": 0, "stamp": 0}',
        '{"type": "sticks", "roll": 1e999, "pitch": 0, "yaw": 0, "throttle": 0, "stamp": 0}',
    ],
)
def test_sticks_that_no_page_sends_are_dropped(page, session, wrong):
    _, server = page
    hand = Hand(RATES)
    session.cockpit.serve(hand)
    message = wrong if isinstance(wrong, str) else STICKS | wrong
    answers = talk(server, {"type": "take", "seat": ""}, message)
    assert [a["type"] for a in answers if a["type"] != "instruments"] == ["taken"]
    assert hand.sticks is None
