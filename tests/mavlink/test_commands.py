"""The server answers the messages of several programs; no socket is bound and nothing flies."""

from math import nan
from struct import pack, unpack_from
from types import SimpleNamespace

import pytest

from quadsim.config.spec import Spec
from quadsim.mavlink import commands
from quadsim.mavlink.clock import SimulatorClock
from quadsim.mavlink.commands import Phase
from quadsim.mavlink.downlink import RATES, Downlink
from quadsim.mavlink.messages import (
    CommandAck,
    CommandInt,
    DataTransmissionHandshake,
    FileTransferProtocol,
    Heartbeat,
    MissionAck,
    MissionClearAll,
    MissionCount,
    MissionRequest,
    MissionRequestInt,
    MissionRequestList,
    ParamRequestList,
    ParamRequestRead,
    ParamSet,
    SetMode,
    SetPositionTargetLocalNed,
    Statustext,
)
from quadsim.mavlink.packets import Member
from quadsim.mavlink.race_data import NO_RACE
from quadsim.mavlink.served import Served
from quadsim.mavlink.setpoints import Rates
from quadsim.mavlink.udp_link import Received
from quadsim.sensing import load_sensing
from tests.mavlink.world import (
    ACCEPTED,
    ARM,
    DENIED,
    FORWARD,
    OTHER,
    PILOT,
    UNSUPPORTED,
    World,
    command,
)

HANDSHAKE = DataTransmissionHandshake(2, 0, 0, 0, 0, 0, 0)


@pytest.fixture
def world():
    return World()


def texts(answers):
    """Return the texts among answers."""
    return [message.text.decode() for message in answers if isinstance(message, Statustext)]


def test_the_pilot_is_who_arms_and_others_fly_nothing(world):
    law = world.fly()
    assert texts(world.say(FORWARD, FORWARD, sender=OTHER)) == [
        "setpoint ignored: another program flies"
    ]
    for refused in (ARM, command(400, 0.0), command(31000), command(176, 1.0, 4.0)):
        assert world.result(refused, sender=OTHER) == DENIED
    assert world.say(SetMode(1, 1, 4), sender=OTHER) == []
    assert world.commands.is_armed
    assert world.commands.phase is Phase.RACE
    assert world.downlink.custom_mode == 0
    assert world.client.law is law
    # Its questions are answered.
    assert world.result(command(512, 148.0), sender=OTHER) == ACCEPTED


def test_what_is_for_another_system_is_neither_obeyed_nor_answered(world):
    law = world.fly()
    assert world.say(command(400, 0.0, system=77)) == []
    assert world.commands.is_armed
    assert world.client.law is law
    assert world.link.received["for other systems"] == 1
    # 0 is every system.
    assert world.result(command(400, 0.0, system=0)) == ACCEPTED
    assert not world.commands.is_armed


@pytest.mark.parametrize("number", [nan, 0.7, -1.0, 2.0, float("inf")])
def test_arming_by_another_number_than_0_and_1_is_denied(world, number):
    law = world.fly()
    assert world.result(command(400, number)) == DENIED
    assert world.commands.is_armed
    assert world.client.law is law


def test_disarming_stops_the_motors(world):
    world.fly()
    assert world.result(command(400, 0.0)) == ACCEPTED
    assert world.client.law.setpoint == Rates((0.0, 0.0, 0.0), 0.0)


def test_a_setpoint_before_arming_is_answered_once(world):
    said = texts(world.say(FORWARD, FORWARD))
    assert said == ["setpoint ignored: not armed (COMMAND_LONG 400)"]
    assert world.client.law is None
    assert texts(world.say(FORWARD)) == []
    # anew at the next start
    world.commands.begin_start()
    assert texts(world.say(FORWARD)) == said


def test_a_setpoint_that_cannot_be_flown_is_said_once_and_changes_nothing(world):
    law = world.fly()
    wrong = SetPositionTargetLocalNed(0, 1, 1, 7, 0b110111000111, *11 * (0,))
    unlike = SetPositionTargetLocalNed(0, 1, 1, 1, 0b110111001111, *11 * (0,))
    said = texts(world.say(wrong, wrong, unlike, unlike))
    assert said == [
        "setpoint refused: frame 7, expected 1 or 8",
        "setpoint refused: nothing for x",
    ]
    assert world.link.received["unusable"] == 4
    assert world.client.law is law


def test_a_reset_before_arming_counts(world):
    assert world.commands.counts_from is None
    world.commands._clock.boot = 3.0
    assert world.result(command(31000)) == ACCEPTED
    assert world.downlink.resets == 1
    assert world.commands.counts_from == 3.0
    assert world.commands.phase is Phase.START
    # With a countdown, the vehicle may be armed before the start; a reset disarms it.
    assert world.result(ARM) == ACCEPTED
    world.commands._clock.boot = 4.0
    assert world.result(command(31000)) == ACCEPTED
    assert not world.commands.is_armed
    assert world.link.pilot is None
    assert world.commands.counts_from == 4.0


def test_a_reset_without_a_countdown_says_when_the_race_begins(world):
    assert texts(world.say(command(31000))) == ["the race begins when you arm, see --countdown"]
    world.downlink.has_countdown = True
    world.commands.begin_start()
    assert texts(world.say(command(31000))) == []


def test_the_countdown_begins_when_a_program_is_first_heard(world):
    world.commands._clock.boot = 2.0
    world.say(Heartbeat(6, 8, 0))
    world.commands._clock.boot = 5.0
    world.say(Heartbeat(6, 8, 0))
    assert world.commands.counts_from == 2.0


def test_the_track_is_sent_once_for_a_flood_of_questions(world):
    world.say(*2000 * (HANDSHAKE,))
    assert world.downlink.tracks == 1
    world.say(command(512, 130.0))
    assert world.downlink.tracks == 2


@pytest.mark.parametrize(
    ("numbers", "mode"),
    [((1, 6, 0), 6 << 16), ((129, 4, 3), 3 << 24 | 4 << 16), ((1, 4, 0), 4)],
    ids=["OFFBOARD of PX4", "hold of PX4", "GUIDED of ArduPilot"],
)
def test_a_mode_is_told_back(world, numbers, mode):
    assert world.result(command(176, *numbers)) == ACCEPTED
    assert world.downlink.custom_mode == mode


def test_a_mode_that_is_no_number_is_denied(world):
    assert world.result(command(176, 1.0, nan, 0.0)) == DENIED
    assert world.downlink.custom_mode == 0


OPEN_FILE = 4  # opcode of MAVLink's file transfer
RESET_SESSIONS = 2
ACKNOWLEDGED = 128


def file_transfer(opcode, number=7):
    """Return FILE_TRANSFER_PROTOCOL about the file that MAVProxy asks for at connection."""
    name = b"@PARAM/param.pck?withdefaults=1"
    payload = pack("<HBBBBBBI", number, 3, opcode, len(name), 0, 0, 0, 0) + name
    return FileTransferProtocol(0, 1, 1, payload.ljust(251, b"\0"))


# What QGroundControl sends a vehicle of a generic autopilot: at connection, on its pages of
# parameters and of plans, and by its buttons. It repeats each message until it is answered. The
# answers are told by their names, COMMAND_ACK by its result.
STATION = {
    "the version": (command(512, 148.0), ["AUTOPILOT_VERSION", ACCEPTED]),
    "the version, as older ones ask": (command(520, 1.0), ["AUTOPILOT_VERSION", ACCEPTED]),
    "the version again and again": (command(511, 148.0), ["AUTOPILOT_VERSION", ACCEPTED]),
    "the versions of MAVLink": (command(519, 1.0), [UNSUPPORTED]),
    "the modes": (command(512, 435.0), [UNSUPPORTED]),
    "metadata": (command(512, 397.0), [UNSUPPORTED]),
    "metadata, as older ones ask": (command(512, 395.0), [UNSUPPORTED]),
    "the camera": (command(512, 259.0), [UNSUPPORTED]),
    "the gimbal": (command(512, 280.0), [UNSUPPORTED]),
    "home": (command(512, 242.0), ["HOME_POSITION", ACCEPTED]),
    "home, as older ones ask": (command(410), ["HOME_POSITION", ACCEPTED]),
    "all parameters": (ParamRequestList(1, 1), ["PARAM_VALUE"]),
    "a parameter": (ParamRequestRead(1, 1, b"", 0), ["PARAM_VALUE"]),
    "a parameter by its name": (ParamRequestRead(1, 1, b"MAV_SYS_ID", -1), ["PARAM_VALUE"]),
    "another parameter": (ParamRequestRead(1, 1, b"SYS_AUTOSTART", -1), ["STATUSTEXT"]),
    "another parameter by its index": (ParamRequestRead(1, 1, b"", 7), ["STATUSTEXT"]),
    "to set a parameter": (ParamSet(1, 1, b"MAV_SYS_ID", 9.0, 9), ["PARAM_VALUE"]),
    "to set another parameter": (ParamSet(1, 1, b"MPC_XY_P", 1.0, 9), ["STATUSTEXT"]),
    "the plan": (MissionRequestList(1, 1), ["MISSION_COUNT"]),
    "the fence": (MissionRequestList(1, 1, mission_type=1), ["MISSION_COUNT"]),
    "the rally points": (MissionRequestList(1, 1, mission_type=2), ["MISSION_COUNT"]),
    "a waypoint": (MissionRequestInt(1, 1, 0), ["MISSION_ACK"]),
    "a waypoint, as older ones ask": (MissionRequest(1, 1, 0), ["MISSION_ACK"]),
    "to upload a plan": (MissionCount(1, 1, 3), ["MISSION_ACK"]),
    "to clear the plan": (MissionClearAll(1, 1), ["MISSION_ACK"]),
    "a file": (file_transfer(OPEN_FILE), ["FILE_TRANSFER_PROTOCOL"]),
    "the end of the transfers": (file_transfer(RESET_SESSIONS), ["FILE_TRANSFER_PROTOCOL"]),
    "to take off": (command(22), [UNSUPPORTED]),
    "to go somewhere": (CommandInt(1, 1, 6, 192, *9 * (0,)), [UNSUPPORTED]),
    "to disarm, by COMMAND_INT": (CommandInt(1, 1, 6, 400, *9 * (0,)), [ACCEPTED]),
}


@pytest.mark.parametrize("asked", STATION)
def test_what_stations_ask_is_answered_or_denied(world, asked):
    message, expected = STATION[asked]
    answers = world.say(message)
    assert [m.result if isinstance(m, CommandAck) else m.NAME for m in answers] == expected


def test_answers_about_parameters_and_plans_say_that_there_is_one_and_none(world):
    (parameter,) = world.say(ParamRequestList(1, 1))
    assert (parameter.param_count, parameter.param_index) == (1, 0)
    # A parameter that is set keeps its value.
    assert world.say(ParamSet(1, 1, b"MAV_SYS_ID", 9.0, 9)) == [parameter]
    assert world.say(MissionRequestList(1, 1, mission_type=2)) == [
        MissionCount(0, 0, 0, mission_type=2)
    ]
    assert world.say(MissionClearAll(1, 1, mission_type=1)) == [MissionAck(0, 0, 0, mission_type=1)]
    assert world.say(MissionCount(1, 1, 3)) == [MissionAck(0, 0, 3)]
    assert world.say(MissionRequestInt(1, 1, 0)) == [MissionAck(0, 0, 13)]


@pytest.mark.parametrize(
    ("opcode", "expected", "reason"),
    [(OPEN_FILE, 129, b"\x0a"), (RESET_SESSIONS, ACKNOWLEDGED, b"")],
)
def test_a_transfer_of_files_is_refused_and_its_end_is_granted(world, opcode, expected, reason):
    station = Member(255, 190)
    world.link.given = [Received(file_transfer(opcode, number=65535), PILOT, station)]
    world.commands.listen_until(0.0)
    ((answer, _),) = world.link.answers
    assert (answer.target_system, answer.target_component) == station
    number, session, result, size, asked, *_ = unpack_from("<HBBBBBBI", answer.payload)
    assert (number, session, result, asked) == (0, 3, expected, opcode)
    assert answer.payload[12 : 12 + size] == reason


def test_an_answer_about_files_is_not_answered(world):
    assert world.say(file_transfer(ACKNOWLEDGED)) == []


def test_home_is_not_told_with_sensors_that_measure_no_pose(world):
    world.downlink.tells_poses = False
    assert world.result(command(512, 242.0)) == UNSUPPORTED


def test_a_flood_of_texts_ends(world):
    """Other programs, each of which is refused once."""
    world.fly()
    for port in range(1000):
        world.say(FORWARD, sender=("127.0.0.1", port))
    assert len(world.commands._texts) == 50


def test_a_pilot_that_is_silent_ends_the_race_and_others_do_not_keep_it(world, monkeypatch):
    world.fly()
    world.commands.listen_until(0.0)
    assert world.commands.phase is Phase.RACE
    monkeypatch.setattr(commands, "SILENCE", 0.0)
    world.say(Heartbeat(6, 8, 0), sender=OTHER)
    assert world.commands.phase is Phase.SILENT


def test_in_lock_step_heartbeats_without_setpoints_do_not_keep_the_race(world, monkeypatch):
    world.fly()
    monkeypatch.setattr(commands, "PATIENCE", 0.0)
    world.commands.wanted = 1
    world.commands._setpoints = 0
    world.commands.await_setpoint()
    assert texts(message for message, _ in world.link.answers) == [
        "lock step: no setpoint came for 1 s"
    ]
    assert (world.commands.unanswered, world.commands.phase) == (1, Phase.RACE)
    world.commands._heard_setpoint -= commands.SILENCE
    world.say(Heartbeat(6, 8, 0))
    world.commands.await_setpoint()
    assert world.commands.phase is Phase.SILENT


@pytest.mark.parametrize(
    ("sensing", "round_", "tells"),
    [
        (None, "first", True),
        (None, "second", False),
        ("mocap", "first", True),
        ("aigp_physical", "first", False),
    ],
)
def test_poses_of_vehicle_and_gates_are_told_together(sensing, round_, tells):
    """Gates' poses were told with sensors that measure no pose of the vehicle."""
    spec = Spec.of("aigp_physical", vehicle="archer")
    sent = []
    link = SimpleNamespace(send=sent.append)
    set_of = sensing and load_sensing(sensing)
    downlink = Downlink(link, SimulatorClock(), spec, set_of, Served(round=round_))
    assert downlink.tells_poses is tells
    downlink.send_track()
    first_gate = unpack_from("<7f", sent[1].data, 3 + 2 + 2)
    assert any(first_gate) is tells


@pytest.mark.parametrize(
    ("interval", "rate"),
    [(0.0, RATES["ATTITUDE"]), (100_000.0, 10.0), (-1.0, 0.0), (nan, None), (1.0, None)],
)
def test_the_rate_of_a_message_may_be_changed(interval, rate):
    spec = Spec.of("aigp_physical", vehicle="archer")
    downlink = Downlink(SimpleNamespace(), SimulatorClock(), spec, None, Served())
    downlink.begin(NO_RACE)
    assert downlink.set_interval(30.0, interval) is (rate is not None)
    due = sum(downlink._due("ATTITUDE", 0.0025 * k) for k in range(401))
    usual = RATES["ATTITUDE"]
    assert due == pytest.approx(usual if rate is None else rate, abs=1.1)
    # neither a message that does not exist, nor in lock step
    assert not downlink.set_interval(nan, 0.0)
    assert not downlink.set_interval(105.0, 0.0)
    locked = Downlink(SimpleNamespace(), SimulatorClock(), spec, None, Served(lock_step=True))
    assert not locked.set_interval(30.0, 0.0)


def test_only_the_pilot_changes_a_rate(world):
    world.fly()
    assert world.result(command(511, 30.0, 1e5), sender=OTHER) == DENIED
    assert world.downlink.intervals == []
    assert world.result(command(511, 30.0, 1e5)) == ACCEPTED
    assert world.result(command(511, 105.0, 1e5)) == DENIED
