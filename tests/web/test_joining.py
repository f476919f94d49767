"""Claims about flying by hand, without a browser: who has the sticks, and when a flight begins."""

import json
from dataclasses import replace
from functools import partial

import pytest
from web_cases import COURSE, PERIOD, Clock, competitor, until
from wire import link

from quadsim.racing.hand import SILENCE, SINKING, Hand, HandRates, Sticks
from quadsim.record.archive import list_runs
from quadsim.record.run import has_planner
from quadsim.vehicle import load_vehicle
from quadsim.web.page.forms.joining import NOBODY, Joining, Take
from quadsim.web.race.cockpit import ABANDONED, Cockpit
from quadsim.web.race.lap_timing import lap_timings
from quadsim.web.race.live_flight import LiveFlight
from quadsim.web.race.pace import Pace
from quadsim.web.race.page_race import PageRace
from quadsim.web.race.snapshot import Snapshot
from quadsim.web.race.stored_competitor import stored_competitor
from quadsim.web.state.choices import Choices, HeatChoices
from tests.small import SMALL

RATES = HandRates.of(load_vehicle("swift"))
HOVER = Sticks(throttle=RATES.hover)
DOWN = Sticks(throttle=0.0)
BY_HAND = Choices(course=COURSE, laps=1, sampler="hand")


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


class HandRace(PageRace):
    """A race in which a person may fly, on a clock that is set by hand."""

    def __init__(self, root, clock):
        self.clock = clock
        self.cockpit = Cockpit(clock)
        super().__init__(str(root), cockpit=self.cockpit)

    @property
    def first(self):
        return self.snapshot().competitors[0]

    def raise_throttle(self):
        self.cockpit.take(1)
        self.cockpit.move(1, DOWN)
        self.cockpit.move(1, HOVER)

    def pass_by(self, seconds, sticks=None):
        """Let time pass; a person moves the sticks, if there are any."""
        for _ in range(round(seconds / PERIOD)):
            self.clock.now += PERIOD
            if sticks:
                self.cockpit.move(1, sticks)
            while self.turn() == 0.0:
                pass


@pytest.fixture
def by_hand(tmp_path, monkeypatch):
    clock = Clock()
    monkeypatch.setattr("quadsim.web.race.page_race.Pace", lambda: Pace(clock))
    monkeypatch.setattr("quadsim.web.state.choices.Hand", partial(Hand, clock=clock))
    race = HandRace(tmp_path, clock)
    yield race
    race.end_flights()


@pytest.fixture
def standing(by_hand):
    """A race whose vehicle stands on its start, at a speed that a person does not fly at."""
    by_hand.set_speed(4.0)
    by_hand.start([BY_HAND])
    return by_hand


def test_a_vehicle_stands_on_its_start_until_the_throttle_is_raised(standing):
    standing.pass_by(0.4)
    assert standing.snapshot().waiting
    assert len(standing.first.t) == 1
    height = standing.first.x["pz"][0]
    standing.raise_throttle()
    standing.pass_by(0.4, HOVER)
    assert standing.snapshot().t == pytest.approx(0.4, abs=1.5 * PERIOD)  # in real time
    assert standing.first.x["pz"][-1] == pytest.approx(height, abs=0.1)


def test_without_sticks_the_failsafe_flies_and_is_recorded(standing):
    standing.raise_throttle()
    standing.pass_by(SILENCE - PERIOD)
    assert standing.first.x["a_cmd"][-1] == pytest.approx(RATES.control(HOVER).thrust)
    standing.pass_by(0.1)
    assert standing.cockpit.sticks is None
    assert standing.first.x["a_cmd"][-1] == pytest.approx(SINKING)
    assert [standing.first.x[f"w{axis}_cmd"][-1] for axis in "xyz"] == [0.0, 0.0, 0.0]


def test_a_person_flies_in_real_time(standing):
    with pytest.raises(ValueError, match=r"^speed: "):
        standing.set_speed(0.1)
    assert standing.snapshot().t == 0.0


@pytest.mark.compiled
def test_a_person_and_a_planner_fly_in_one_world_and_are_kept(by_hand):
    race = by_hand
    colored = Choices(course=COURSE, laps=1, settings={**SMALL, "timeout": 0.3})
    hand = Choices(course=COURSE, laps=1, sampler="hand", settings={"timeout": 0.3})
    race.start([HeatChoices((hand, colored), expect="velocity")])
    race.pass_by(0.1)
    # both stand
    assert [len(entry.t) for entry in race.snapshot().competitors] == [1, 1]
    race.raise_throttle()
    race.pass_by(0.5, Sticks(yaw=1.0, throttle=RATES.hover))
    assert not race.snapshot().flying
    flown, planned = race.snapshot().competitors
    assert (flown.sampler, planned.sampler) == ("hand", "colored")
    assert flown.x["wz_cmd"][5] == pytest.approx(-RATES.yaw.most)
    kept = stored_competitor(flown.folder)
    assert not kept.has_planner
    assert kept.spec.hand == flown.spec.hand


def test_two_competitors_by_hand_are_refused(tmp_path):
    race = PageRace(str(tmp_path))
    for choices in ([BY_HAND, BY_HAND], [HeatChoices((BY_HAND, BY_HAND))]):
        with pytest.raises(ValueError, match="sampler: expected one competitor by hand"):
            race.start(choices)
    assert race.snapshot().race == 0
    assert not list_runs(tmp_path)


def test_a_flight_by_hand_has_no_number_of_a_planner():
    flight = LiveFlight(Choices(course=COURSE, sampler="hand", numbers={"samples": 512}))
    try:
        assert flight.hand is not None
        assert flight.now.spec.planner.mppi.samples != 512
        assert not has_planner(flight.now.record)
    finally:
        flight.close()


STICKS = {"type": "sticks", "roll": 0.25, "pitch": 0.0, "yaw": 0.0, "throttle": 0.5, "stamp": 7.5}
WRONG = [
    {"roll": 1.01},
    {"pitch": -2},
    {"throttle": -0.1},
    {"yaw": None},
    {"yaw": "1"},
    {"more": 1},
    '{"type": "sticks", "roll": NaN, "pitch": 0, "yaw": 0, "throttle": 0, "stamp": 0}',
    '{"type": "sticks", "roll": 1e999, "pitch": 0, "yaw": 0, "throttle": 0, "stamp": 0}',
]


@pytest.mark.socket
def test_sticks_are_answered_with_their_stamp_once_they_were_taken(page):
    cockpit = page.session.cockpit
    cockpit.serve(Hand(RATES))
    with link(page.port) as linked:
        linked.socket.send(json.dumps(STICKS))
        linked.send("take", seat="of nobody")
        linked.socket.send(json.dumps(STICKS | {"stamp": 8.5}))
        assert linked.got("taken")["yours"]
        # those that came before are not answered
        assert linked.got("heard") == {"type": "heard", "stamp": 8.5}
        assert cockpit.sticks == Sticks(roll=0.25, throttle=0.5)
    # the page was closed
    assert until(lambda: cockpit.pilot is None)


@pytest.mark.socket
def test_sticks_that_no_page_sends_are_dropped(page):
    hand = Hand(RATES)
    page.session.cockpit.serve(hand)
    with link(page.port) as linked:
        assert linked.ask("taken", "take", seat="")["yours"]
        for wrong in WRONG:
            linked.socket.send(wrong if isinstance(wrong, str) else json.dumps(STICKS | wrong))
            # messages are handled in their order
            linked.ask("taken", "take", seat="")
            assert hand.sticks is None, wrong
        linked.socket.send(json.dumps(STICKS))
        linked.got("heard")
        assert hand.sticks is not None


class Told:
    """A board with its link, and a visitor: what they are given."""

    number = 1

    def __init__(self):
        self.link = self
        self.handlers = {}
        self.parts = []
        self.sent = []

    def on(self, form, handler):
        self.handlers[form] = handler

    def on_leave(self, handler):
        pass

    def put(self, name, content):
        if [(name, content)] != self.parts[-1:]:
            self.parts.append((name, content))

    def send(self, message):
        self.sent.append(type(message).__name__)

    def client_of(self, seat):
        return None

    def go_live(self, visitor):
        pass


def test_instruments_are_sent_to_the_visitor_who_took_the_sticks_alone():
    told = Told()
    joining = Joining(told, Cockpit(), told, told, None)
    flown = competitor("colored")
    entry = flown.with_record({**flown.record, "sampler": "hand"})
    entry = replace(entry, live=True, outcome=None)
    for k in range(10):
        s = Snapshot(t=0.1 * k, end=9.0, competitors=(entry,), by_hand=True, flying=True)
        if k == 5:
            told.handlers[Take](told, Take(seat=""))
        joining.update(s, lap_timings(s))
    assert told.sent[0] == "Taken"
    assert told.sent[1:] == ["Instruments"] * 5
    # Who flies is a part of every page, which is sent as it changes.
    assert [content.pilot for _, content in told.parts] == [None, 1]
    joining.update(Snapshot(), [])
    assert told.parts[-1] == ("by_hand", NOBODY)
    assert len(told.sent) == 6
